//! Site configuration: a TOML file, read raw, checked whole, turned into [`SiteConfig`].

mod site;

pub use site::*;
