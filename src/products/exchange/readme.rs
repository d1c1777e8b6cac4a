//! What the files of the folder `exchange` are, and the commands that read them.

use std::fmt::Write as _;

use super::{LOLA_LIKE_FORMAT, ODE_FORMAT, POINT_Z_HEIGHT};
use crate::products::{coordinates::FRAME, site::SiteProducts};

pub(super) fn text(site: &SiteProducts) -> String {
    let mut text = format!(
        "Products of the site {} for other programs. Commands are given for this folder.\n\n\
         Frame: {FRAME}.\n",
        site.config.site
    );
    if site.footprints.is_empty() {
        text += "\nThe site has no footprints, so there are no tables of footprints here.\n";
    } else {
        text += &footprints();
    }
    if !site.images.is_empty() {
        text += "\nCommunity Sensor Model (usgscsm): image support data\n";
        for image in site.images {
            let _infallible = writeln!(
                text,
                "  usgscsm_cam_test --model ../images/{}/isd.json --sample-rate 100",
                image.times.id
            );
        }
        text += ISD;
    }
    if let Some(geometric) = &site.geometric {
        text += ADJUSTED;
        for image in geometric.adjusted_images {
            let id = &image.times.id;
            let _infallible = writeln!(
                text,
                "  spiceinit from={id}.cub spk=../adjusted/{id}.bsp ck=../adjusted/{id}.bc"
            );
        }
    }
    text += CATALOGUE;
    text
}

fn footprints() -> String {
    format!(
        "\n\
Tables of footprints, radii instead of heights, so that the choice of a datum does not matter; the .json beside\n\
each file names its columns, its --csv-format and what its radii are. The first line names the columns.\n\
\x20 lola_like.csv    as LOLA's reduced data records: UTC, longitude, latitude, radius km, range km, ...\n\
\x20 ode_pts.csv      as the Orbital Data Explorer's points\n\
\n\
Ames Stereo Pipeline (D_MARS is a sphere of 3396190 m)\n\
\x20 pc_align --max-displacement 1000 --csv-format '{LOLA_LIKE_FORMAT}' --datum D_MARS dem.tif lola_like.csv -o run/out\n\
\x20 pc_align --max-displacement 1000 --csv-format '{ODE_FORMAT}' --datum D_MARS dem.tif ode_pts.csv -o run/out\n\
\n\
ISIS (cubes need spiceinit first)\n\
\x20 lrolola2isis from=lola_like.csv cubes=cubes.lis pointid=MOLA???? to=lidar.json\n\
Lidar points of ISIS need the line and sample at which each image sees the shot, which lrolola2isis computes (a\n\
site with tie points has them ready in lidar.json). It reads column 4, the radius after the crossover correction; the measured range of\n\
column 5 belongs to the radius before it, column 6. For range constraints exchange the two first:\n\
\x20 awk -F, -v OFS=, '{{ t = $4; $4 = $6; $6 = t; print }}' lola_like.csv > lola_raw.csv\n\
\n\
GIS: IAU_2015:49900, longitudes -180..180, areocentric latitudes; {POINT_Z_HEIGHT}\n\
\x20 ogrinfo -al -so footprints.gpkg                  GeoPackage, all columns\n\
\x20 ogrinfo -al -so footprints.shp                   3-D shapefile; names of at most ten letters, no windows\n\
\x20 ogrinfo -al -so ../footprints.geojson            two-dimensional\n\
\x20 python3 -c 'import geopandas; print(geopandas.read_parquet(\"../footprints.parquet\"))'\n\
\x20 QGIS: Layer > Add Layer > Add Vector Layer, any of these.\n\
The dates inside the GeoPackage and the shapefile are those of the newest shot.\n\
\n\
../footprints.xml is a label in the style of PDS4 for ../footprints.csv.\n"
    )
}

const ISD: &str = "\
They differ from the files of ALE where those do not say what the camera does: the time of a line includes the\n\
summing, samples and the detector's centre count from the detector's edge, there is no distortion, and the\n\
pointing covers the whole image. The member areograph.interpolation holds the measured interpolation error.\n";

const ADJUSTED: &str = "\n\
The adjusted site (../adjustment.json says what was adjusted and how well)\n\
\x20 lidar.json       shots with ranges for ISIS: a priori and adjusted points, where the adjusted images see them\n\
\x20   jigsaw fromlist=cubes.lis cnet=ties.net onet=out.net lidardata=lidar.json olidarfile=out spsolve=position\n\
\x20 adjusted.gcp     adjusted tie points for Ames Stereo Pipeline; standard deviations along x, y, z, so not with\n\
\x20                  --use-lon-lat-height-gcp-error; the images are called <id>.cub\n\
\x20   bundle_adjust --datum D_MARS IMAGES CAMERAS adjusted.gcp -o run/out\n\
../images/<id>/adjusted_isd.json is the adjusted camera. Its positions are geometric, those of ../images/<id>/isd.json\n\
have light time and aberration as ISIS and ALE have them. Kernels to be loaded after the original ones, each pair for\n\
its image alone:\n";

const CATALOGUE: &str = "\n\
kernels.json       kernels by type with the keys of SpiceQL, and under areograph hashes and coverage\n\
stac_item.json     the site for STAC catalogues: where, when, files with sizes and hashes; there is none for a\n\
\x20                  site of which nothing says where it lies\n\
\x20 stac-validator stac_item.json\n";
