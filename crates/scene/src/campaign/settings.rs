//! `campaign.toml` and `README.txt` of a campaign.

use super::misregistration::USED_ORBIT;
use areograph_config::{usual_altimeter, usual_instrument};

/// Source stated in the products.
const INJECTED: &str = "injected by areograph scene";

/// Largest emission and incidence angle that the campaign selects, degrees: its images have less.
pub(super) const EMISSION_MAX_DEG: f64 = 30.0;
pub(super) const INCIDENCE_MAX_DEG: f64 = 85.0;

/// The campaign: selection, pairs, and the template of its sites.
pub(super) fn campaign_toml() -> String {
    format!(
        "# Written by `areograph scene campaign`; paths are relative to the folder of this file.\n\
         campaign = \"synthetic\"\n\
         description = \"Synthetic images of five mission phases\"\n\n\
         [archive]\nindexes = [\"index/cumindex.tab\"]\nfolder = \"labels\"\n\n\
         [select]\ncameras = [\"{}\"]\nemission_max_deg = {EMISSION_MAX_DEG:?}\nincidence_deg = [0.0, {INCIDENCE_MAX_DEG:?}]\n\n\
         [pairs]\noverlap_min = 0.3\nconvergence_deg = [4.0, 60.0]\nsun_max_deg = 40.0\npixel_ratio_max = 2.0\n\
         # Tables of tie points state the standard deviations of their measurements.\n\
         ties = \"ties/{{site}}.csv\"\n\n\
         [kernels]\nroot = \"kernels\"\nspk_family = \"{USED_ORBIT}\"\n\n\
         [pointing]\nck_bias_s = {}\nsource = \"{INJECTED}\"\n\n\
         [altimeter_clock]\nbias_s = {}\nsign = \"late\"\nscope = \"spk_lookup\"\nsource = \"{INJECTED}\"\n\n\
         [pedr]\nfiles = [\"pedr/*.b\"]\ndatum = \"auto\"\n",
        usual_instrument().id,
        usual_instrument().pointing.ck_bias_s,
        usual_altimeter().clock_bias_s,
    )
}

/// Text of `README.txt` below its first line.
pub(super) const README: &str = "\
campaign.toml  the campaign: selection from the index, pairs, and the template of the sites
index/         cumindex.tab with its label: the images, and rows that the selection rejects
labels/        labels of the images; no pixels
kernels/       text kernels; orbit (three rival versions) and attitude of each phase, Mars and Sun as binary kernels
pedr/          a MOLA PEDR file of five minutes around each image; version K refers to IAU 1991, L to IAU 2000
ties/          tie points of each pair, <first image>_<second image>.csv; some are blunders
truth.json     true values: errors of images, offsets of phases, misregistration of images and pairs, blunders,
               rejected rows, and the distributions from which the errors were drawn

Places, terrain, orbits, attitudes and errors are invented.
";
