//! The terrain model of the scene with something changed.

use std::{fs::File, io::BufWriter, path::Path};

use tiff::{
    decoder::{Decoder, DecodingResult},
    encoder::{TiffEncoder, colortype::Gray32Float},
    tags::Tag,
};

/// What stands for no height in the scene.
pub(crate) const NO_HEIGHT: f32 = -32_768.0;

/// A model as its file has it.
pub(crate) struct Model {
    pub(crate) columns: usize,
    pub(crate) heights_m: Vec<f32>,
    pub(crate) scale: Vec<f64>,
    pub(crate) tie: Vec<f64>,
    pub(crate) directory: Vec<u16>,
    pub(crate) numbers: Vec<f64>,
    pub(crate) no_data: String,
}

impl Model {
    /// Changes heights, but not what stands for none.
    pub(crate) fn change(&mut self, change: impl Fn(f32) -> f32) {
        for height_m in &mut self.heights_m {
            if *height_m > NO_HEIGHT {
                *height_m = change(*height_m);
            }
        }
    }
}

/// Writes the model `from` with changes to `to`.
pub(crate) fn edited(from: &Path, to: &Path, edit: impl Fn(&mut Model)) {
    let mut decoder = Decoder::new(File::open(from).unwrap()).unwrap();
    let (columns, rows) = decoder.dimensions().unwrap();
    let mut numbers = |tag| decoder.get_tag_f64_vec(tag).unwrap();
    let scale = numbers(Tag::ModelPixelScaleTag);
    let tie = numbers(Tag::ModelTiepointTag);
    let doubles = numbers(Tag::GeoDoubleParamsTag);
    let directory = decoder.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap();
    let no_data = decoder.get_tag_ascii_string(Tag::GdalNodata).unwrap();
    let DecodingResult::F32(heights_m) = decoder.read_image().unwrap() else {
        panic!("heights of another type");
    };
    let mut model = Model {
        columns: columns as usize,
        heights_m,
        scale,
        tie,
        directory,
        numbers: doubles,
        no_data,
    };
    edit(&mut model);
    let mut encoder = TiffEncoder::new(BufWriter::new(File::create(to).unwrap())).unwrap();
    let mut image = encoder.new_image::<Gray32Float>(columns, rows).unwrap();
    let tags = image.encoder();
    tags.write_tag(Tag::ModelPixelScaleTag, &model.scale[..])
        .unwrap();
    tags.write_tag(Tag::ModelTiepointTag, &model.tie[..])
        .unwrap();
    tags.write_tag(Tag::GeoKeyDirectoryTag, &model.directory[..])
        .unwrap();
    tags.write_tag(Tag::GeoDoubleParamsTag, &model.numbers[..])
        .unwrap();
    if !model.no_data.is_empty() {
        tags.write_tag(Tag::GdalNodata, model.no_data.as_str())
            .unwrap();
    }
    image.write_data(&model.heights_m).unwrap();
}
