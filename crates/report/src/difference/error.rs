//! Reasons why two outputs cannot be compared.

use areograph_base::error::Cause;

#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
pub(super) enum DifferenceError {
    /// Neither a site's folder nor a folder of sites.
    #[error("no manifest.json in this folder or below it; expected products of `areograph run`")]
    #[cause(Input: "name the folder given to --out, or a site folder in it")]
    NoProducts,
    /// Products of another flow.
    #[error(
        "the products are those of another flow (net, calibration, match or archive); expected those of a site"
    )]
    #[cause("name the products of a site: the comparison is defined for sites only")]
    NoSite,
    /// Two names of one folder.
    #[error("A and B are the same folder; expected the products of two runs")]
    #[cause("copy the first products elsewhere before the second run, or use a different --out")]
    SameFolder,
    /// A site's folder beside a folder of sites.
    #[error(
        "this folder contains the products of one site, the other the products of several sites"
    )]
    #[cause("name two folders of one site, or two output folders with sites")]
    OneAndSeveral,
    /// Products of two sites.
    #[error("these products belong to site \"{b}\", the others to site \"{a}\"; expected one site")]
    #[cause("compare runs of the same site")]
    DifferentSites { a: String, b: String },
    /// Two roots without a common site.
    #[error("A and B have no site in common: A contains {a}; B contains {b}")]
    #[cause(like = DifferentSites)]
    NoneInBoth { a: String, b: String },
}
