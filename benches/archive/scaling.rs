//! Times as a function of the size of the archive, as a plot.

use std::path::Path;

use plotters::prelude::*;
use serde_json::Value;

/// Sizes of the archives, gigabytes.
pub(super) const SIZES_GB: [f64; 4] = [0.5, 1.0, 2.0, 4.0];

/// Width of the names of lines, to their right.
const LABELS_PX: u32 = 200;

/// The plotted series, from the cheapest to the one that reads everything; colours are those of Okabe and Ito.
const SERIES: [(&str, &str, RGBColor); 7] = [
    ("indexed", "one window, with index", RGBColor(0, 114, 178)),
    (
        "index update, nothing new",
        "index, nothing new",
        RGBColor(86, 180, 233),
    ),
    ("scan", "one window, without index", RGBColor(0, 158, 115)),
    (
        "1000 windows",
        "1,000 windows, without index",
        RGBColor(230, 159, 0),
    ),
    (
        "index build",
        "index of a new archive",
        RGBColor(213, 94, 0),
    ),
    (
        "range check",
        "range of every shot against kernels",
        RGBColor(204, 121, 167),
    ),
    (
        "cold scan",
        "one window, without index, cold",
        RGBColor(0, 0, 0),
    ),
];

/// Draws milliseconds over gigabytes, both on logarithmic axes.
pub(super) fn plot(path: &Path, measured: &[Value]) {
    let root = SVGBackend::new(path, (860, 460)).into_drawing_area();
    root.fill(&WHITE).unwrap();
    let mut chart = ChartBuilder::on(&root)
        .margin(14)
        .margin_right(LABELS_PX)
        .x_label_area_size(40)
        .y_label_area_size(60)
        .caption(
            "Searching an archive of PEDR files, two threads",
            ("sans-serif", 18),
        )
        .build_cartesian_2d((0.4..5.0_f64).log_scale(), (0.05..50_000.0_f64).log_scale())
        .unwrap();
    chart
        .configure_mesh()
        .x_desc("size of the archive, GB")
        .y_desc("time, ms")
        .x_label_formatter(&|gb| format!("{gb}"))
        .draw()
        .unwrap();
    for (name, label, colour) in SERIES {
        let points: Vec<(f64, f64)> = measured
            .iter()
            .map(|of| {
                let of = &of["searches_and_checks"];
                let taken_s = of["seconds"][name].as_f64().unwrap();
                (of["gb"].as_f64().unwrap(), taken_s * 1e3)
            })
            .collect();
        let line = LineSeries::new(points.iter().copied(), colour.stroke_width(2));
        chart.draw_series(line.point_size(3)).unwrap();
        // Beside the end of the line, away from the other lines.
        let (x, y) = chart.backend_coord(&points[points.len() - 1]);
        let style = ("sans-serif", 12).into_font().color(&colour);
        root.draw(&Text::new(label, (x + 10, y - 6), style))
            .unwrap();
    }
    root.present().unwrap();
}
