//! Registration: profiles on the image plane.

use super::{
    html::{Cell, Column, Markup, Table, counted, folded, html, paragraph},
    many,
    numbers::whole,
    plots::{COLOURS, Extent, GREY, INK, Mark, Panel, Plot, Series, Style, figure, label, thinned},
    section::Section,
};
use areograph_base::{column::Column as Values, error::Result, verdict::CheckKind};
use areograph_geom::pushbroom::CameraModel;
use areograph_products::{ImageProducts, SiteProducts};
use areograph_stages::group_profiles::Profile;

/// Number of profiles with separate colours; the others share the last, grey one.
const COLOURED: usize = COLOURS.len() - 1;
/// Largest number of dots of one series.
const DOTS_MAX: usize = 600;
/// Widths of the image shown on either side of it.
const WIDTHS_BESIDE: f64 = 0.15;

/// An image with its index in the site.
type Indexed<'a> = (usize, &'a ImageProducts<'a>);

pub(super) const SECTION: Section = Section {
    title: "Registration",
    anchor: "registration",
    checks: &[CheckKind::FootprintsInside, CheckKind::SupportPosition],
    appears: |site| site.images.iter().any(registered),
    write,
};

/// Whether a footprint has a line in `image`.
pub(super) fn registered(image: &ImageProducts) -> bool {
    image.registration.has_points()
}

fn write(site: &SiteProducts) -> Result<Markup> {
    let images = many::shown(site).into_iter();
    let images: Vec<Indexed> = images.filter(|(_, image)| registered(image)).collect();
    let evidence = html! {
        div.plots { @for (_, image) in &images { (figure(&plane(site.profiles, image))?) } }
        (models(&images))
    };
    Ok(html! {
        (many::some_of_all(site))
        (profiles(site, &images))
        (folded("Footprints along the lines, and the effect of other camera models", &evidence))
    })
}

/// Place of the image with this index in the products.
pub(super) fn place(index: usize) -> String {
    format!("registration.json#/images/{index}")
}

/// Profiles in the images, and their positions.
fn profiles(site: &SiteProducts, images: &[Indexed]) -> Markup {
    let mut table = Table::new(
        "Profiles in the images",
        &[
            Column::Text("image"),
            Column::Text("profile"),
            Column::Text("simultaneous"),
            Column::Number("footprints in the image"),
            Column::Number("lines"),
            Column::Number("samples"),
            Column::Number("shot spacing, lines"),
        ],
    );
    for (of_site, image) in images {
        let points = &image.registration.points;
        let of_image = place(*of_site);
        let each = site.profiles.iter().zip(&image.registration.profiles);
        for (index, (profile, on_image)) in (0_u32..).zip(each) {
            if on_image.inside == 0 {
                continue;
            }
            let inside = |values: &Values<f64>| {
                let of = points.profile.iter().zip(&points.inside).zip(values);
                let own = of.filter(|((profile, inside), _)| *profile == index && *inside);
                let (low, high) = own.fold((f64::INFINITY, f64::NEG_INFINITY), |ends, (_, at)| {
                    (ends.0.min(at), ends.1.max(at))
                });
                format!("{low:.0} to {high:.0}")
            };
            let mut simultaneous = profile.simultaneous.iter();
            let together = simultaneous.any(|of| of.image == *of_site);
            let spacing = on_image.shot_spacing_lines;
            table.row_of(
                &format!("{of_image}/profiles/{index}"),
                true,
                [
                    (&image.times.id).into(),
                    (&profile.id).into(),
                    if together { "yes" } else { "no" }.into(),
                    Cell::from(whole(on_image.inside)).traced("/inside"),
                    inside(&points.line).into(),
                    inside(&points.sample).into(),
                    Cell::from(
                        spacing.map_or_else(|| "–".to_owned(), |lines| format!("{lines:.1}")),
                    )
                    .traced("/shot_spacing_lines"),
                ],
            );
        }
    }
    let all = || site.images.iter().filter(|image| registered(image));
    let elsewhere = all()
        .flat_map(|image| &image.registration.profiles)
        .filter(|on_image| on_image.inside == 0)
        .count();
    let rejected: u64 = all()
        .flat_map(|image| image.registration.rejected.values())
        .sum();
    let mut words = Vec::new();
    if elsewhere > 0 {
        words.push(format!(
            "Not listed: {elsewhere} pairs of a profile and an image without any of its footprints."
        ));
    }
    if rejected > 0 {
        words.push(format!(
            "Failed projections of footprints into images: {rejected} (behind the camera or beyond the horizon)."
        ));
    }
    html! { (table.finish()) (paragraph(&words.join(" "))) }
}

/// Samples of the footprints near the image, against their lines.
fn plane(profiles: &[Profile], image: &ImageProducts) -> Plot {
    let points = &image.registration.points;
    let (lines, samples) = (
        f64::from(image.times.line_times.lines()),
        f64::from(image.times.samples),
    );
    let beside = WIDTHS_BESIDE * samples;
    let near = Extent {
        low: -beside,
        high: samples + beside,
    };
    let mut dots: Vec<Vec<(f64, f64)>> = vec![Vec::new(); profiles.len()];
    for index in 0..points.len() {
        let (line, sample) = (points.line.at(index), points.sample.at(index));
        if !points.extrapolated.at(index) && near.contains(sample) {
            dots[points.profile.at(index) as usize].push((line, sample));
        }
    }
    let mut series: Vec<Series> = Vec::new();
    let mut others = Vec::new();
    for (profile, dots) in profiles.iter().zip(dots) {
        if dots.is_empty() {
            continue;
        }
        if series.len() < COLOURED {
            series.push(Series {
                label: profile.id.clone(),
                style: Style::Dots,
                colour: series.len(),
                points: thinned(&dots, DOTS_MAX),
            });
        } else {
            others.extend(dots);
        }
    }
    if !others.is_empty() {
        series.push(Series {
            label: "other profiles".to_owned(),
            style: Style::Dots,
            colour: GREY,
            points: thinned(&others, DOTS_MAX),
        });
    }
    let shown = series.len();
    let ends = [0.0, f64::from(image.times.lines_delivered)].map(|x| Mark {
        x,
        half_width: 0.0,
        colour: INK,
    });
    let panel = Panel {
        y: near,
        limits: vec![0.0, samples],
        marks: ends.to_vec(),
        ..Panel::of("sample", series)
    };
    let words = format!(
        "{} of {} footprints inside, of {}. Flight to the right; dashed: image sides; solid: image ends.",
        whole(points.inside_count()),
        whole(points.len()),
        counted(shown, "profile")
    );
    Plot {
        x: Extent::of([0.0, lines].into_iter()),
        ..Plot::of(
            format!("Profiles on {}", image.times.id),
            words,
            "line",
            vec![panel],
        )
    }
}

/// Effect of the choice of the model.
fn models(images: &[Indexed]) -> Markup {
    let mut table = Table::new(
        "Other models compared with the model used, for footprints within the image's lines",
        &[
            Column::Text("image"),
            Column::Text("used"),
            Column::Text("other"),
            Column::Number("lines, mean"),
            Column::Number("standard deviation"),
            Column::Number("samples, mean"),
            Column::Number("standard deviation"),
        ],
    );
    let word = |required: CameraModel| {
        let words = CameraModel::WORDS.into_iter();
        words
            .filter(|(_, model)| *model == required)
            .map(|(word, _)| word.replace('_', " "))
            .collect::<String>()
    };
    for (of_site, image) in images {
        for (index, other) in image.registration.models.iter().enumerate() {
            let mut cells: Vec<Cell> = vec![
                (&image.times.id).into(),
                word(image.registration.model).into(),
                word(other.model).into(),
            ];
            for (summary, name) in [(&other.lines, "lines"), (&other.samples, "samples")] {
                let mean = Cell::from(label(summary.mean, 4));
                let deviation = Cell::from(label(summary.standard_deviation, 4));
                cells.push(mean.traced(format!("/{name}/mean")));
                cells.push(deviation.traced(format!("/{name}/standard_deviation")));
            }
            table.row_of(&format!("{}/models/{index}", place(*of_site)), true, cells);
        }
    }
    table.finish()
}
