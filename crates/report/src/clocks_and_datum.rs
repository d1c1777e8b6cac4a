//! The clock corrections and the datum as used, with their sources.

use super::{
    html::{Column, Markup, Table, counted, folded, html},
    many,
    numbers::{number as label, signed, whole},
    section::Section,
};
use areograph_base::altimetry::{BiasScope, DatumChoice, TagSign};
use areograph_products::SiteProducts;

pub(super) const SECTION: Section = Section {
    title: "Clock corrections and datum",
    anchor: "clock-corrections-and-datum",
    checks: &[],
    appears: |_| true,
    write: |site| Ok(html! { (biases(site)) (datum(site)) }),
};

fn biases(site: &SiteProducts) -> Markup {
    let clock = &site.config.altimeter_clock;
    let sign = match clock.sign {
        TagSign::Late => "tags are late",
        TagSign::Early => "tags are early",
    };
    let terms = site.config.terms();
    let body = terms.body();
    let scope = match clock.scope {
        BiasScope::SpkLookup => "the spacecraft position in the range check".to_owned(),
        BiasScope::Rotation => format!("the rotation of {body} into {}", terms.short_frame()),
        BiasScope::Both => {
            format!("the spacecraft position in the range check and the rotation of {body}")
        }
        BiasScope::None => "nothing (switched off)".to_owned(),
    };
    let mut table = Table::new(
        "Clock corrections",
        &[
            Column::Text("bias"),
            Column::Number("correction, s"),
            Column::Text("applies to"),
            Column::Text("source"),
        ],
    );
    let pointing = site.pointing_biases();
    for of in &pointing {
        let name = match pointing.len() {
            1 => "attitude (CK)".to_owned(),
            _ => format!("attitude (CK) of {}", of.camera),
        };
        table.row(
            true,
            [
                name.into(),
                signed(of.bias.seconds(), 3).into(),
                format!(
                    "the time at which the attitude is read; the position and the rotation of {body} are those at the \
                     exposure"
                )
                .into(),
                of.source.into(),
            ],
        );
    }
    let supported = site.images.iter();
    let supported = supported.filter(|image| image.times.support.is_some());
    let ids: Vec<&str> = supported.map(|image| &*image.times.id).collect();
    if !ids.is_empty() {
        let named = match ids.len() {
            count if many::are_many(site) => counted(count, "image"),
            _ => ids.join(", "),
        };
        table.row(
            true,
            [
                format!("attitude and line times of {named}").into(),
                "–".into(),
                "no correction of support data".into(),
                "the files under Support data".into(),
            ],
        );
    }
    table.row(
        true,
        [
            format!("{} clock", site.config.altimeter.name).into(),
            signed(clock.correction_s(), 3).into(),
            format!("{scope}; {:.3} s, {sign}", clock.bias_s).into(),
            (&clock.source).into(),
        ],
    );
    table.finish()
}

const OF_PEDR: [Column; 8] = datum_columns("PEDR file");
const OF_TABLES: [Column; 8] = datum_columns("table");

const fn datum_columns(file: &'static str) -> [Column; 8] {
    [
        Column::Text(file),
        Column::Text("version"),
        Column::Text("datum of the file"),
        Column::Number("W0, degrees"),
        Column::Text("transformation"),
        Column::Number("shots"),
        Column::Number("mean shift, m"),
        Column::Number("mean longitude change, degrees"),
    ]
}

fn datum(site: &SiteProducts) -> Markup {
    if site.footprints.files.is_empty() {
        return Markup::default();
    }
    let decided = match site.config.pedr.datum {
        _ if !site.config.shots.is_empty() => "from the configuration of the tables".to_owned(),
        DatumChoice::Auto => "from the version letter and the label".to_owned(),
        DatumChoice::Stated(datum) => format!("stated in the configuration: {datum}"),
    };
    let (sort, columns) = if site.config.shots.is_empty() {
        ("PEDR", &OF_PEDR)
    } else {
        (&*site.config.altimeter.name, &OF_TABLES)
    };
    let mut table = Table::new(&format!("Datum of the {sort} coordinates"), columns);
    for (file, conversion) in site.footprints.files.iter().zip(site.conversions) {
        let moved = conversion.shift_m.max > 0.0;
        let number = |text: String| if moved { text } else { "–".to_owned() };
        table.row(
            true,
            [
                (&file.name).into(),
                file.version
                    .map_or_else(|| "–".to_owned(), String::from)
                    .into(),
                file.datum.to_string().into(),
                format!("{:.3}", file.datum.model().meridian_deg).into(),
                if moved {
                    format!("through J2000 to {}", site.config.body.names().short_frame)
                } else {
                    "not transformed".to_owned()
                }
                .into(),
                whole(conversion.shots).into(),
                number(label(conversion.shift_m.mean, 1)).into(),
                number(signed(conversion.longitude_shift_deg.mean, 5)).into(),
            ],
        );
    }
    let choice = site.footprints.ground_choice();
    let radii = choice.map_or_else(String::new, |of| {
        format!(" Products use ground radii {}.", of.words())
    });
    let words = format!(
        "Datum {decided}; products are in {}, W0 = {:.3}°.{radii}",
        site.config.body.names().short_frame,
        site.config.body.model().meridian_deg
    );
    html! { p { (words) } (folded("Datum, file by file", &table.finish())) }
}
