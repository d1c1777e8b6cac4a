//! Orthoimages of a small site: their files as other programs read them, and the page against the document.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use std::{collections::BTreeMap, fs::File, path::Path};

use areograph::{
    capabilities::{self, write_products},
    column::Tiles,
    geom::height_grid::HeightGrid,
    products::{PageData, SiteProducts, listed},
    stage::{Output, Provenance, Round},
    stages::{
        map_surface::{ShotComparison, Surface, SurfaceAccount, SurfaceLook, SurfaceModel},
        mosaic_images::{Mosaic, MosaicAccount, MosaicPart},
        rectify_images::{Orthoimage, OrthoimageAccount, OrthoimageLook},
    },
};
use serde_json::json;
use tiff::{
    decoder::{Decoder, DecodingResult},
    tags::Tag,
};

use crate::{
    common::{self, products_site::Site},
    qgis::{document, in_qgis, layers_refer_to_products},
};

/// Rows and columns of the orthoimage, and of the terrain model, whose cells are twice as large.
const SIZE: [usize; 2] = [6, 8];
const TERRAIN: [usize; 2] = [3, 4];
const RADIUS_M: f64 = 3_396_190.0;

/// A map without heights, its cells `cell_m` wide.
fn map(size: [usize; 2], cell_m: f64) -> HeightGrid {
    HeightGrid {
        size,
        first_rad: [1.0, 0.2],
        cell_rad: [cell_m / RADIUS_M; 2],
        radius_m: RADIUS_M,
        heights_m: Vec::new(),
    }
}

pub(crate) fn surface() -> Surface {
    let heights = HeightGrid {
        heights_m: (0..12_u8).map(f32::from).collect(),
        ..map(TERRAIN, 10.0)
    };
    let sigmas_m = vec![2.0; 12];
    Surface {
        account: SurfaceAccount {
            images: [0, 0],
            directions: [[0.0; 3]; 2],
            cell_m: 10.0,
            sample_m: 5.0,
            compared_m: 50.0,
            cells: 12,
            filled: 12,
            unfilled: BTreeMap::new(),
            is_refused: false,
            convergence_rad: 0.3,
            height_of_pixel_m: 12.0,
            sigma_m: 2.0,
            jitter_m: 1.0,
            smoothing_m: 0.5,
            correlation: 0.9,
            aside_m: 0.1,
            common_sigma_m: Some(1.5),
            shots_take_part: true,
            reference: None,
            joint: None,
            shots: ShotComparison::default(),
            look: SurfaceLook {
                heights: heights.clone(),
                sigmas_m: sigmas_m.clone(),
            },
        },
        model: SurfaceModel {
            heights,
            parallel_rad: 0.0,
            sigmas_m,
            pairs: Vec::new(),
        },
    }
}

/// Brightness 0 (empty) to 47; no jitter was measured.
pub(crate) fn orthoimage() -> Orthoimage {
    let brightness: Vec<u8> = (0..48).collect();
    Orthoimage {
        account: OrthoimageAccount {
            image: 0,
            map: map(SIZE, 5.0),
            parallel_rad: 0.0,
            cell_m: 5.0,
            pixel_m: 3.5,
            filled: 47,
            without_pixels: 1,
            terrain_cells: 11,
            hidden: 2,
            interpolated: 3,
            sigma_m: 4.25,
            jitter_m: None,
            drift_m: Some(2.75),
            shared_sigma_m: Some([113.0, 108.0]),
            image_sigma_m: None,
            look: OrthoimageLook {
                size: SIZE,
                brightness: brightness.clone(),
            },
        },
        brightness: Tiles::of(SIZE, &brightness),
        sigmas_m: vec![4.25; 12],
    }
}

/// The orthoimage alone as a mosaic.
fn mosaic() -> Mosaic {
    let Orthoimage {
        account,
        brightness,
        ..
    } = orthoimage();
    Mosaic {
        account: MosaicAccount {
            map: account.map,
            parallel_rad: account.parallel_rad,
            cell_m: account.cell_m,
            images: vec![MosaicPart {
                image: 0,
                tone: [1.0, 0.0],
                cells: 47,
            }],
            seams: Vec::new(),
            look: account.look,
            detail: None,
        },
        sources: {
            let sources = brightness.bytes().into_iter().map(|of| u8::from(of > 0));
            Tiles::of(SIZE, &sources.collect::<Vec<_>>())
        },
        brightness,
    }
}

pub(crate) fn output<T>(value: T) -> Output<T> {
    let nowhere = Provenance {
        blake3: String::new(),
        fingerprint: String::new(),
    };
    Output::known(String::new(), value, nowhere)
}

#[test]
fn files_and_page_state_what_was_computed() {
    let folder = tempfile::tempdir().unwrap();
    let (surface, orthoimages) = (surface(), vec![orthoimage()]);
    let (id, page) = Site::small().with(true, |site| {
        let mut book = site.book.clone();
        book.enter_heavy(Round::Initial, output(surface), Surface::without_model)
            .unwrap();
        let shown = |of: &Vec<Orthoimage>| of.iter().map(Orthoimage::without_cells).collect();
        book.enter_heavy(Round::Initial, output(orthoimages.clone()), shown)
            .unwrap();
        let without = |of: &Option<Mosaic>| of.as_ref().map(Mosaic::without_cells);
        book.enter_heavy(Round::Initial, output(Some(mosaic())), without)
            .unwrap();
        let site = SiteProducts {
            book: &book,
            ..*site
        };
        let listed = listed(&site, capabilities::declarations());
        let site = SiteProducts {
            listed: &listed,
            ..site
        };
        write_products(folder.path(), &site, "").unwrap();
        let id = site.images[0].times.id.clone();
        (id, capabilities::page(&site).unwrap())
    });
    // The data of the page have no cells, and give the same page.
    let data = PageData::read(folder.path()).unwrap();
    let again = data.with(capabilities::declarations(), |site| {
        let orthoimages = site.find::<Vec<Orthoimage>>()?.unwrap();
        assert!(orthoimages[0].brightness.is_empty());
        capabilities::page(site)
    });
    assert_eq!(again.unwrap(), page);

    let path = folder.path().join(format!("images/{id}/orthoimage.tif"));
    let mut decoder = Decoder::new(File::open(path).unwrap()).unwrap();
    assert_eq!(decoder.dimensions().unwrap(), (8, 6));
    let scale_m = decoder.get_tag_f64_vec(Tag::ModelPixelScaleTag).unwrap();
    // Rounding of an angle of a microradian, metres.
    assert!((scale_m[0] - 5.0).abs() < 1e-6 && (scale_m[1] - 5.0).abs() < 1e-6);
    let corner_m = decoder.get_tag_f64_vec(Tag::ModelTiepointTag).unwrap();
    let edges_m = [RADIUS_M * 1.0 - 2.5, RADIUS_M * 0.2 + 2.5];
    assert!((corner_m[3] - edges_m[0]).abs() < 1e-6 && (corner_m[4] - edges_m[1]).abs() < 1e-6);
    assert_eq!(decoder.get_tag_ascii_string(Tag::GdalNodata).unwrap(), "0");
    let DecodingResult::U8(bytes) = decoder.read_image().unwrap() else {
        panic!("other numbers");
    };
    assert_eq!(bytes, orthoimages[0].brightness.bytes());

    rasters_are_layers_of_the_project(&folder.path().join("exchange/site.qgz"), &id);

    let document = common::json(&folder.path().join("orthoimages.json"));
    let stated = &document["orthoimages"][0];
    assert_eq!(stated["image"], json!(id));
    assert_eq!(stated["jitter_m"], json!(null));
    assert_eq!(stated["shared_sigma_m"], json!([113.0, 108.0]));
    let section = page.split("id=\"orthoimages\"").nth(1).unwrap();
    let row = section.split("</table>").next().unwrap();
    for number in ["5.00", "3.50", "47", "4.25", "2.75", "113, 108"] {
        assert!(row.contains(&format!(">{number}<")), "{number}: {row}");
    }
    assert!(row.contains("not known"), "{row}");
}

/// The mosaic with its images, the orthoimage, and below it the terrain model twice, on the map of their files.
fn rasters_are_layers_of_the_project(project: &Path, id: &str) {
    let sources = layers_refer_to_products(project);
    let orthoimage = format!("../images/{id}/orthoimage.tif");
    let rasters = [
        "../mosaic_source.tif",
        "../mosaic.tif",
        &*orthoimage,
        "../surface_above_sphere.tif",
        "../surface_above_sphere.tif",
    ];
    assert_eq!(sources[sources.len() - 5..], rasters);
    let text = document(project);
    // The colours of the images have their names, and the mosaic is shown in place of the orthoimage.
    let palette = text.split("type=\"paletted\"").nth(1).unwrap();
    let entry =
        format!("<paletteEntry value=\"1\" color=\"#ddcc77\" alpha=\"255\" label=\"{id}\">");
    assert!(
        palette.split("</pipe>").next().unwrap().contains(&entry),
        "{palette}"
    );
    for (name, state) in [
        ("Images of the mosaic", "Unchecked"),
        ("Mosaic", "Checked"),
        (&*format!("Orthoimage {id}"), "Unchecked"),
    ] {
        let entry = text.split(&format!("name=\"{name}\" ")).nth(1).unwrap();
        let entry = entry.split('>').next().unwrap();
        assert!(
            entry.contains(&format!("checked=\"Qt::{state}\"")),
            "{entry}"
        );
    }
    let Some(found) = in_qgis(project, "orthoimages in QGIS") else {
        return;
    };
    let layers = found["layers"].as_array().unwrap();
    let renderers = [
        "paletted",
        "singlebandgray",
        "singlebandgray",
        "singlebandpseudocolor",
        "hillshade",
    ];
    for (layer, renderer) in layers[layers.len() - 5..].iter().zip(renderers) {
        assert_eq!(
            (&layer["valid"], &layer["renderer"]),
            (&json!(true), &json!(renderer))
        );
        let crs = layer["crs"].as_str().unwrap();
        assert!(
            crs.starts_with("+proj=eqc +lat_ts=0 ") && crs.contains("+R=3396190"),
            "{crs}"
        );
    }
}

#[test]
fn a_site_without_orthoimages_has_neither_files_nor_section() {
    let folder = tempfile::tempdir().unwrap();
    let page = Site::small().with(true, |site| {
        write_products(folder.path(), site, "").unwrap();
        capabilities::page(site).unwrap()
    });
    assert!(!page.contains("id=\"orthoimages\""));
    assert!(!folder.path().join("orthoimages.json").exists());
}
