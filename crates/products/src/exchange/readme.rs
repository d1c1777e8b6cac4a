//! Descriptions of the files in the folder `exchange`, and the commands that read them.

use std::{fmt::Write as _, path::Path};

use crate::{
    coordinates::frame,
    files::write_text,
    gis::{crs_code, point_z_height},
    light_time::convention,
    product::{Content, Context, Declaration, IMAGE, Program, Role, Write},
    site::SiteProducts,
};
use areograph_base::terms::Terms;

pub(crate) static README: Declaration = Declaration {
    path: "exchange/README.txt",
    what: "descriptions of the files in this folder, and the commands that read them",
    readers: "people",
    rows: "",
    role: Role::Metadata,
    content: Content::Foreign,
    write: Write::Site(|path, of| write_text(path, &text(of)).map(|()| Some(0))),
    uses: &[],
};

/// Programs in the order of their sections.
const PROGRAMS: [Program; 6] = [
    Program::StereoPipeline,
    Program::Isis,
    Program::Gis,
    Program::CameraModel,
    Program::AdjustedKernels,
    Program::Catalogue,
];

/// Columns of the file names.
const NAME_WIDTH: usize = 20;

fn text(of: &Context) -> String {
    let site = of.site;
    let terms = site.config.terms();
    let mut text = format!(
        "Products of the site {} for other programs. Run the commands in this folder.\n\n\
         Frame: {}.\n\n",
        site.config.site,
        frame(site.config.body)
    );
    if !site.images.is_empty() {
        text += &light_time(site);
    }
    text += &calibrated(site);
    if site.footprints.is_empty() {
        text += "The site has no footprints, so there are no tables of footprints here.\n\n";
    } else if site.config.products.formats.is_empty() {
        text += "Footprints are in ../footprints.parquet; `areograph export` writes them in other formats.\n\n";
    }
    let files = files(of);
    for file in &files {
        if let Some(name) = file.path.strip_prefix("exchange/") {
            let _infallible = writeln!(text, "{name:NAME_WIDTH$} {}", terms.fill(file.what));
        }
    }
    for program in PROGRAMS {
        let uses = files
            .iter()
            .flat_map(|file| file.uses.iter().map(move |of| (*file, of)));
        let lines: Vec<(&Declaration, &str)> = uses
            .filter(|(_, of)| of.program == program)
            .flat_map(|(file, of)| of.lines.lines().map(move |line| (file, line)))
            .collect();
        if lines.is_empty() {
            continue;
        }
        let _infallible = write!(text, "\n{}\n", about(program, &terms));
        for (file, line) in lines {
            for line in for_images(file, line, of) {
                let _infallible = writeln!(text, "  {line}");
            }
        }
    }
    text
}

/// The convention of camera positions in all files, and the programs that it suits.
fn light_time(site: &SiteProducts) -> String {
    if site
        .images
        .iter()
        .all(|image| image.times.support.is_some())
    {
        return format!("{}.\n\n", convention(site));
    }
    let body = site.config.terms().body();
    let mut text = format!(
        "Files in the folder centre/ follow the light-time convention of ISIS and ALE in every run: positions as seen from the\n\
         centre of {body} (LT+S). Other camera models, lines and samples, and kernels follow the convention of this run,\n\
         {}.\n\
         With the orientation from the kernels, a ground point has different lines in the two conventions: ../registration.json\n\
         states the differences for each image; isis_line and isis_sample of ../registration.parquet are those of ISIS.\n\n",
        convention(site)
    );
    if site.adjustment().is_some() {
        text += ADJUSTED;
    }
    text
}

/// Images whose camera programs with SPICE kernels do not know; empty without them.
fn calibrated(site: &SiteProducts) -> String {
    let images = site
        .images
        .iter()
        .filter(|image| image.times.instrument.calibration.is_some());
    let names: Vec<&str> = images.map(|image| &*image.times.id).collect();
    if names.is_empty() {
        return String::new();
    }
    format!(
        "The cameras of {} are calibrated. Camera models (ISD) contain the calibrated camera. Kernels contain the attitude of the\n\
         spacecraft only: programs that take the mounting and the optics of the camera from SPICE kernels, such as ISIS,\n\
         do not apply the calibration.\n\n",
        names.join(", ")
    )
}

/// Conventions after an adjustment.
const ADJUSTED: &str = "\
    Adjusted rays are the same in both conventions: points, networks, ground control, residuals and\n\
    ../images/<image>/adjusted_isd.json suit every program, and only the adjusted kernels depend on the program that reads\n\
    them. Ranges of lidar data are geometric: with the adjusted kernels in centre/, the ranges that jigsaw computes \
    agree\n\
    within 0.2 m; with the original kernels, they differ by up to 330 m.\n\n";

/// Files written and not empty, each file of images once, and files to be written: those declared after this text.
fn files(of: &Context) -> Vec<&'static Declaration> {
    let mut files: Vec<&Declaration> = Vec::new();
    // An empty table exists, but no program is pointed to it.
    let used = of
        .written
        .iter()
        .filter(|(product, declaration)| product.rows > 0 || declaration.rows.is_empty());
    let written = used.map(|(_, declaration)| *declaration);
    let to_come = of
        .declarations
        .iter()
        .skip_while(|file| file.path != README.path);
    for file in written.chain(to_come.skip(1).copied()) {
        if files.iter().all(|known| known.path != file.path) {
            files.push(file);
        }
    }
    files
}

/// The line, once per image for a file of images, where it has been written or is still to be written.
fn for_images(file: &Declaration, line: &str, of: &Context) -> Vec<String> {
    let line = of.site.config.terms().fill(line);
    if !line.contains(IMAGE) {
        return vec![line.into_owned()];
    }
    let own = of
        .written
        .iter()
        .filter(|(_, declaration)| declaration.path == file.path);
    let written: Vec<&Path> = own.map(|(product, _)| product.path.as_path()).collect();
    let images = of.site.images.iter().map(|image| &image.times.id);
    images
        .filter(|image| written.is_empty() || written.contains(&Path::new(&file.path_of(image))))
        .map(|image| line.replace(IMAGE, image))
        .collect()
}

/// Notes for users of a program, before its commands.
fn about(program: Program, terms: &Terms<'_>) -> String {
    let body = terms.body;
    match program {
        Program::StereoPipeline => format!(
            "\
            Ames Stereo Pipeline ({} is a sphere of {} m). Tables contain radii instead of heights, so\n\
            that the choice of a datum does not matter. The .json file of a table states its columns, --csv-format \
            and\n\
            radii. The first line of a table names the columns.",
            body.map().asp_datum,
            body.map().radius_m
        ),
        Program::Isis => "ISIS (cubes need spiceinit first)".to_owned(),
        Program::Gis => format!(
            "GIS: {}, longitudes -180..180, {} latitudes; {}.\n\
             The dates inside the GeoPackage and the shapefile are those of the newest shot.\n\
             QGIS: open site.qgz, or single files by Layer > Add Layer > Add Vector Layer.",
            crs_code(body),
            terms.latitude(),
            point_z_height(body)
        ),
        Program::CameraModel => "\
            Community Sensor Model (usgscsm): image support data of the cameras. These data differ from the\n\
            ALE files where the latter describe the camera incorrectly: the time of a line includes the summing, \
            samples\n\
            and the detector's centre count from the detector's edge, there is no distortion, and the pointing covers\n\
            the whole image. The member areograph.interpolation states the measured interpolation error. The models\n\
            in centre/ follow the light-time convention of ISIS and ALE."
            .to_owned(),
        Program::AdjustedKernels => "\
            The adjusted site (../adjustment.json describes the adjustment and its accuracy).\n\
            ../images/<image>/adjusted_isd.json is the adjusted camera. ISIS and ALE load the kernels in centre/ after the\n\
            original kernels, each pair only for its image:"
            .to_owned(),
        Program::Catalogue => "STAC".to_owned(),
    }
}
