//! Why two outputs cannot be compared.

use crate::error::{Cause, Kind};

#[derive(Debug, thiserror::Error)]
pub(super) enum DifferenceError {
    /// Neither a site's folder nor a folder of sites.
    #[error("no manifest.json in this folder or below it; expected products of `areograph run`")]
    NoProducts,
    /// Two names of one folder.
    #[error("A and B are the same folder; expected the products of two runs")]
    SameFolder,
    /// A site's folder beside a folder of sites.
    #[error("it holds the products of one site, the other folder those of several")]
    OneAndSeveral,
    /// Products of two sites.
    #[error("these are products of site \"{b}\", the others of site \"{a}\"; expected one site")]
    DifferentSites { a: String, b: String },
    /// Two roots without a common site.
    #[error("A and B have no site in common: A has {a}; B has {b}")]
    NoneInBoth { a: String, b: String },
}

impl Cause for DifferenceError {
    fn kind(&self) -> Kind {
        match self {
            Self::NoProducts => Kind::Input,
            _ => Kind::Configuration,
        }
    }

    fn advice(&self) -> String {
        match self {
            Self::NoProducts => "name the folder given to --out, or a site's folder in it",
            Self::SameFolder => {
                "copy the first products elsewhere before running again, or run into another --out"
            }
            Self::OneAndSeveral => "name two folders of one site, or two output folders with sites",
            Self::DifferentSites { .. } | Self::NoneInBoth { .. } => {
                "compare runs of the same site"
            }
        }
        .to_owned()
    }
}
