//! Products made elsewhere: the report, and the metakernel.

use super::{
    files::write_text,
    product::{Content, Declaration, Role, Write},
};

/// Path of the report below a site's folder.
pub const REPORT: &str = "report/index.html";

pub(super) static PAGE: Declaration = Declaration {
    path: REPORT,
    what: "the report of the site",
    readers: "people",
    rows: "",
    role: Role::Overview,
    content: Content::Foreign,
    write: Write::Site(|path, of| write_text(path, of.pages.report).map(|()| Some(0))),
    uses: &[],
};

pub(super) static OVERLAYS: Declaration = Declaration {
    path: "report/overlays.html",
    what: "images with marked footprints and tie points, before and after the adjustment, and pairs of images of the same \
        ground (for a site with image pixels)",
    readers: "people",
    rows: "",
    role: Role::Overview,
    content: Content::Foreign,
    write: Write::Site(|path, of| {
        let page = of.pages.overlays;
        page.map(|page| write_text(path, page).map(|()| 0))
            .transpose()
    }),
    uses: &[],
};

pub(super) static METAKERNEL: Declaration = Declaration {
    path: "kernels.tm",
    what: "metakernel with the site kernels in load order",
    readers: "SPICE",
    rows: "",
    role: Role::Metadata,
    content: Content::Foreign,
    write: Write::Site(|path, of| write_text(path, of.site.metakernel).map(|()| Some(0))),
    uses: &[],
};
