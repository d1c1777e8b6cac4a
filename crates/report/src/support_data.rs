//! Images by support data: contents of their files, to which nothing is applied.

use super::{
    html::{Column, Markup, Table, counted, html},
    many,
    numbers::whole,
    section::Section,
};
use areograph_base::instruments::{DistortionModel, Instrument};
use areograph_products::SiteProducts;
use areograph_stages::tag_times::{ImageTimes, SupportFile};

pub(super) const SECTION: Section = Section {
    title: "Support data",
    anchor: "support-data",
    checks: &[],
    appears: |site| supported(site).next().is_some(),
    write: |site| Ok(write(site)),
};

/// The images of support data, with the files.
fn supported<'a>(
    site: &SiteProducts<'a>,
) -> impl Iterator<Item = (&'a ImageTimes, &'a SupportFile)> {
    let images = site.images.iter();
    images.filter_map(|image| Some((image.times, image.times.support.as_ref()?)))
}

fn write(site: &SiteProducts) -> Markup {
    let ids: Vec<&str> = supported(site).map(|(times, _)| &*times.id).collect();
    let named = |ids: &[&str]| match ids.len() {
        count if many::are_many(site) => counted(count, "image"),
        _ => ids.join(", "),
    };
    let mut words = format!(
        "Camera, line times and orientation of {} come from image support data (CSM, as written by ALE). Nothing is applied \
         to them: no pointing (CK) bias, clock correction, light time or kernel. The adjusted orientations are in \
         adjusted_isd.json, not in SPICE kernels.",
        named(&ids)
    );
    let apart = supported(site).filter(|(_, support)| !support.has_laser);
    let apart: Vec<&str> = apart.map(|(times, _)| &*times.id).collect();
    if !apart.is_empty() {
        words += &format!(
            " Positions from ALE usually include light time and aberration, which amount to hundreds of metres: \
             neither ranges nor the laser mounting is used for {}.",
            named(&apart)
        );
    }
    let mut table = Table::new(
        "Contents of the support data",
        &[
            Column::Text("image"),
            Column::Text("file"),
            Column::Text("camera"),
            Column::Text("spacecraft"),
            Column::Number("focal length, mm"),
            Column::Number("pixel, µm"),
            Column::Number("offset of the line from the boresight, px"),
            Column::Text("distortion"),
            Column::Number("positions"),
            Column::Number("every, s"),
            Column::Number("attitudes"),
            Column::Number("every, s"),
            Column::Number("before the first line, s"),
            Column::Number("after the last line, s"),
        ],
    );
    let shown = many::shown(site).into_iter();
    let shown = shown.filter_map(|(_, image)| Some((image.times, image.times.support.as_ref()?)));
    for (times, file) in shown {
        let Instrument {
            optics, detector, ..
        } = &times.instrument;
        let tables = &file.tables;
        let (held, exposed) = (tables.span(), times.exposures());
        table.row(
            true,
            [
                (&times.id).into(),
                (&file.name).into(),
                (&times.instrument.name).into(),
                (&file.platform).into(),
                format!("{:.3}", optics.focal_length_mm).into(),
                format!("{:.3}", 1e3 * optics.pixel_pitch_mm).into(),
                format!("{:.1}", detector.along_track_px).into(),
                distortion(&times.instrument.distortion).into(),
                whole(tables.position.et_s.len()).into(),
                spacing(&tables.position.et_s).into(),
                whole(tables.pointing.et_s.len()).into(),
                spacing(&tables.pointing.et_s).into(),
                format!("{:.3}", exposed.start.since(held.start).max(0.0)).into(),
                format!("{:.3}", held.stop.since(exposed.stop).max(0.0)).into(),
            ],
        );
    }
    html! { p { (words) } (many::some_of_all(site)) (table.finish()) }
}

const fn distortion(model: &DistortionModel) -> &'static str {
    match model {
        DistortionModel::None => "none",
        DistortionModel::RadialPolynomial { .. } => "radial",
        DistortionModel::AcrossQuotient { .. } => "across the track (lrolrocnac)",
        DistortionModel::Transverse { .. } => "transverse",
        DistortionModel::AnglePolynomial { .. } => "angle off the boresight",
    }
}

/// Mean time between rows.
fn spacing(et_s: &[f64]) -> String {
    let (Some(first), Some(last)) = (et_s.first(), et_s.last()) else {
        return "–".to_owned();
    };
    format!("{:.3}", (last - first) / (et_s.len() - 1).max(1) as f64)
}
