//! Appendix: cost of the published iterations from ground to image, figure 4 of Shan et al. 2005 for this site.

use super::{
    html::{Cell, Column, Markup, Table, folded, html},
    many,
    numbers::whole,
    plots::{Panel, Plot, Series, figure, label},
    registration::{place, registered},
    section::Section,
};
use areograph_base::error::Result;
use areograph_geom::pushbroom::CameraModel;
use areograph_products::{ImageProducts, SiteProducts};
use areograph_stages::register::{Method, MethodRun};

pub(super) const SECTION: Section = Section {
    title: "Appendix: iterations from ground to image",
    anchor: "iterations",
    checks: &[],
    appears: |site| site.images.iter().any(registered),
    write,
};

fn write(site: &SiteProducts) -> Result<Markup> {
    let images = many::shown(site).into_iter();
    let body = html! {
        (many::some_of_all(site))
        (methods(site))
        div.plots {
            @for (_, image) in images.filter(|(_, image)| converges(image)) { (figure(&convergence_plot(image))?) }
        }
    };
    Ok(folded("Cost of the published iterations", &body))
}

fn name(run: &MethodRun) -> String {
    let method = match run.method {
        Method::FrameFirst => "frame first",
        Method::FixedPoint => "fixed point, eq. 4",
    };
    format!("{method}, order {}", order(run.model))
}

const fn order(model: CameraModel) -> &'static str {
    match model {
        CameraModel::FirstOrder => "1",
        _ => "2",
    }
}

/// Cost of the published iterations on this site's footprints.
fn methods(site: &SiteProducts) -> Markup {
    let mut table = Table::new(
        "Iterations per footprint within the image's lines",
        &[
            Column::Text("image"),
            Column::Text("method"),
            Column::Number("footprints"),
            Column::Number("converged"),
            Column::Number("iterations, mean"),
            Column::Number("most"),
            Column::Number("line − Newton's, mean"),
            Column::Number("standard deviation"),
        ],
    );
    for (of_site, image) in many::shown(site) {
        for (index, run) in image.registration.methods.iter().enumerate() {
            let difference = &run.difference_lines;
            table.row_of(
                &format!("{}/methods/{index}", place(of_site)),
                u64::from(run.evaluations.n) == run.points,
                [
                    (&image.times.id).into(),
                    name(run).into(),
                    Cell::from(whole(run.points)).traced("/points"),
                    Cell::from(whole(run.evaluations.n)).traced("/evaluations/n"),
                    Cell::from(format!("{:.2}", run.evaluations.mean)).traced("/evaluations/mean"),
                    Cell::from(format!("{:.0}", run.evaluations.max)).traced("/evaluations/max"),
                    Cell::from(label(difference.mean, 4)).traced("/difference_lines/mean"),
                    Cell::from(label(difference.standard_deviation, 4))
                        .traced("/difference_lines/standard_deviation"),
                ],
            );
        }
    }
    let words = format!(
        "Tolerance {} lines, at most {} steps. The frame-first method diverges where pixels are more than twice as long as wide.",
        site.config.registration.tolerance_lines, site.config.registration.steps_max
    );
    html! { (table.finish()) p { (words) } }
}

/// Whether an iteration has steps to draw.
fn converges(image: &ImageProducts) -> bool {
    let mut runs = image.registration.methods.iter();
    runs.any(|run| !run.mean_step_lines.is_empty())
}

/// Figure 4: the mean step of every iteration.
fn convergence_plot(image: &ImageProducts) -> Plot {
    // The first-order curves coincide with the second-order curves.
    let runs = image.registration.methods.iter();
    let second_order = runs.filter(|run| run.model == CameraModel::SecondOrder);
    let series = second_order.enumerate().map(|(colour, run)| {
        let steps = (1_u32..).zip(&run.mean_step_lines);
        let logarithms = steps
            .filter(|(_, step)| **step > 0.0)
            .map(|(iteration, step)| (f64::from(iteration), step.log10()));
        Series::line(name(run), colour, logarithms.collect())
    });
    let words =
        "Mean absolute step over the footprints within the image's lines; the step of a converged footprint counts as \
         0.".to_owned();
    Plot::of(
        format!("Convergence on {}", image.times.id),
        words,
        "iteration",
        vec![Panel {
            log: true,
            ..Panel::of("mean step, lines", series.collect())
        }],
    )
}
