//! `areograph export`.

use std::path::PathBuf;

use clap::{
    Args,
    builder::{PossibleValuesParser, TypedValueParser as _},
};

use super::output;
use crate::{config::ShotFormat, error::Result, flow::export_site};

/// Writes the footprints in the products of a site in the formats of other programs.
///
/// The files are those that a run writes for `products.formats` in the site file. No site file, kernel or stored stage
/// is read; products that are missing, damaged or of another version are refused.
///
/// Example: `areograph export out/gusev_crater gpkg csv --to gis`
#[derive(Debug, Args)]
#[allow(clippy::doc_markdown, reason = "help is printed verbatim")]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Products of a site.
    #[arg(value_name = "OUT/SITE")]
    folder: PathBuf,
    /// csv, with a PDS4 label; geojson; gpkg, a GeoPackage; shp, a shapefile; lola, ode: tables for ISIS and Ames Stereo
    /// Pipeline.
    #[arg(value_name = "FORMAT", required = true, value_parser = format_parser(), hide_possible_values = true)]
    formats: Vec<ShotFormat>,
    /// Folder for the files, created if missing [default: SITE_export].
    #[arg(long, value_name = "DIR")]
    to: Option<PathBuf>,
}

fn format_parser() -> impl clap::builder::TypedValueParser<Value = ShotFormat> {
    PossibleValuesParser::new(ShotFormat::WORDS.map(|(word, _)| word)).try_map(|word| {
        let found = ShotFormat::WORDS.iter().find(|(known, _)| *known == word);
        found.map(|(_, format)| *format).ok_or("an unknown format")
    })
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let exported = export_site(
        &arguments.folder,
        &arguments.formats,
        arguments.to.as_deref(),
    )?;
    for (file, shots) in &exported.files {
        let shots = match shots {
            0 => String::new(),
            shots => format!(" ({shots} shots)"),
        };
        output::line(format_args!("{}: {}{shots}", exported.site, file.display()));
    }
    Ok(())
}
