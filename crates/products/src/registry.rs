//! All products of sites, in the order in which they are written.

use super::{
    adjusted_footprints, adjusted_kernels, adjustment, control_points, correlations,
    exchange::{adjusted, geopackage, jigsaw, matched, qgis, readme, shapefile, stac, tables},
    figures, footprints, heights, isd, kernel_report, orientation, overlays, page, page_data,
    product::Declaration,
    profile_check, ranges, registered_footprints, registration, ties,
};

/// Products before those of further capabilities. Those of an image that follow each other are written image by image.
static FIRST: &[&Declaration] = &[
    &footprints::CSV,
    &footprints::PARQUET,
    // Tables of footprints that follow each other are written in parallel; the label describes the finished CSV.
    &footprints::LABEL,
    &footprints::GEOJSON,
    &ranges::TABLE,
    &ranges::DOCUMENT,
    &profile_check::DOCUMENT,
    &registration::TABLE,
    &registration::DOCUMENT,
    &orientation::TABLE,
    &orientation::DOCUMENT,
    &isd::ISD,
    &isd::CENTRE,
    &control_points::TABLE,
    &overlays::PICTURE,
    &overlays::MARKS,
    &ties::TABLE,
    &adjusted_footprints::TABLE,
    &heights::TABLE,
    &correlations::TABLE,
    &adjustment::DOCUMENT,
    &registered_footprints::PARQUET,
    &registered_footprints::CSV,
    &registration::ADJUSTED,
    &orientation::ADJUSTED_TABLE,
    &orientation::ADJUSTED_DOCUMENT,
    &isd::ADJUSTED,
    &adjusted_kernels::ATTITUDE,
    &adjusted_kernels::POSITION,
    &adjusted_kernels::CENTRE_ATTITUDE,
    &adjusted_kernels::CENTRE_POSITION,
    &adjusted_kernels::METAKERNEL,
];

/// Pages and files for other programs; the catalogue is last, as it lists the others.
static LAST: &[&Declaration] = &[
    &page::PAGE,
    &page::OVERLAYS,
    &figures::FIGURE,
    &page_data::DATA,
    &page::METAKERNEL,
    &tables::LOLA_LIKE,
    &tables::LOLA_LIKE_SIDECAR,
    &tables::ODE,
    &tables::ODE_SIDECAR,
    &geopackage::GEOPACKAGE,
    &registered_footprints::GEOPACKAGE,
    &shapefile::POINTS,
    &shapefile::INDEX,
    &shapefile::ATTRIBUTES,
    &shapefile::PROJECTION,
    &shapefile::ENCODING,
    &matched::TABLE,
    &matched::NETWORK,
    &matched::BINARY_NETWORK,
    &adjusted::LIDAR,
    &adjusted::CONTROL,
    &jigsaw::NETWORK,
    &jigsaw::BINARY_NETWORK,
    &jigsaw::RESIDUALS,
    &jigsaw::POINTS,
    &jigsaw::IMAGES,
    &kernel_report::KERNELS,
    &qgis::OUTLINES,
    &qgis::RESIDUALS,
    &qgis::PROJECT,
    &readme::README,
    &stac::ITEM,
];

/// All products that a site may have, with those of further capabilities, in the order in which they are written.
#[must_use]
pub fn declarations(of_capabilities: &[&'static Declaration]) -> Vec<&'static Declaration> {
    [FIRST, of_capabilities, LAST].concat()
}
