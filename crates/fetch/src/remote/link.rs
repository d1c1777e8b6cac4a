//! Links of a listing: which of them name a part of the archive.

use crate::{filling::host_of, safe::is_path};

/// What a link of a listing names.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Link {
    /// A file, by its path below the address of the archive.
    File(String),
    /// A folder, likewise; it ends in a slash.
    Folder(String),
    /// The page itself, a folder above it, or something that is no part of any archive.
    Other,
    /// A folder or a PEDR file that is not understood, and might be one of the archive.
    Unclear,
}

impl Link {
    /// A link in the listing of the folder `folder` (empty, or ending in a slash) of the archive at `url`.
    pub(super) fn of(link: &str, folder: &str, url: &str) -> Self {
        let host = host_of(url);
        let root = &url[host.len()..];
        let page = format!("{root}{folder}");
        let is_part = link.ends_with('/') || is_pedr(link);
        let unclear = if is_part { Self::Unclear } else { Self::Other };
        let bare = link.split(['?', '#']).next().unwrap_or_default();
        let path = if let Some((scheme, rest)) = bare.split_once("://") {
            if !scheme.bytes().all(|byte| byte.is_ascii_alphanumeric()) {
                return unclear;
            }
            on_host(rest, host)
        } else if let Some(rest) = bare.strip_prefix("//") {
            on_host(rest, host)
        } else if bare.starts_with('/') {
            Some(bare.to_owned())
        } else if bare.is_empty() {
            return Self::Other;
        } else {
            Some(format!("{page}{bare}"))
        };
        let Some(path) = path else {
            // The page of another host, such as that of the server's software.
            let after = bare.find("//").map_or(0, |at| at + 2);
            let is_site = bare[after..]
                .find('/')
                .is_none_or(|at| after + at + 1 == bare.len());
            return if is_site { Self::Other } else { unclear };
        };
        let Some(path) = normal(&path) else {
            return unclear;
        };
        // Some servers do not distinguish cases: a wrong guess ends in a missing file, which is reported.
        if path.ends_with('/') && begins(&page, &path) {
            return Self::Other;
        }
        let below = begins(&path, root).then(|| &path[root.len()..]);
        let name = below.map(|below| below.strip_suffix('/').unwrap_or(below));
        match (below, name) {
            (Some(below), Some(name)) if is_path(name) && bare == link => {
                if below.ends_with('/') {
                    Self::Folder(below.to_owned())
                } else {
                    Self::File(below.to_owned())
                }
            }
            _ => unclear,
        }
    }
}

/// The path of an address without its scheme, if its host is that of the archive.
fn on_host(rest: &str, host: &str) -> Option<String> {
    let own = host.split_once("://").map_or(host, |(_, name)| name);
    let start = rest.find('/').unwrap_or(rest.len());
    let path = &rest[start..];
    let path = if path.is_empty() { "/" } else { path };
    rest[..start]
        .eq_ignore_ascii_case(own)
        .then(|| path.to_owned())
}

fn begins(text: &str, with: &str) -> bool {
    let start = text.as_bytes().get(..with.len());
    start.is_some_and(|start| start.eq_ignore_ascii_case(with.as_bytes()))
}

/// A path without `.` and `..`; `None` if it leads above the host.
fn normal(path: &str) -> Option<String> {
    let mut parts: Vec<&str> = Vec::new();
    let mut is_folder = false;
    for part in path.trim_start_matches('/').split('/') {
        is_folder = matches!(part, "" | "." | "..");
        match part {
            "" | "." => {}
            ".." => drop(parts.pop()?),
            part => parts.push(part),
        }
    }
    let end = if is_folder && !parts.is_empty() {
        "/"
    } else {
        ""
    };
    Some(format!("/{}{end}", parts.join("/")))
}

/// Whether a name or an address has the ending of PEDR files.
pub(super) fn is_pedr(name: &str) -> bool {
    let ending = name.rsplit_once('.').map(|(_, ending)| ending);
    ending.is_some_and(|ending| ending.eq_ignore_ascii_case("b"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_names_a_part_of_the_archive_or_none_or_is_unclear() {
        let of = |link| Link::of(link, "ap19xxx/", "https://a.gov/mgs/data/");
        let file = Link::File("ap19xxx/ap19020k.b".to_owned());
        for link in [
            "ap19020k.b",
            "./ap19020k.b",
            "../ap19xxx/ap19020k.b",
            "/mgs/data/ap19xxx/ap19020k.b",
            "/MGS/data/ap19xxx/ap19020k.b",
            "https://a.gov/mgs/data/ap19xxx/ap19020k.b",
            "http://A.GOV/mgs/data/ap19xxx/ap19020k.b",
            "//a.gov/mgs/data/ap19xxx/ap19020k.b",
        ] {
            assert_eq!(of(link), file, "{link}");
        }
        for link in [
            "old/",
            "/mgs/data/ap19xxx/old/",
            "https://a.gov/mgs/data/ap19xxx/old/",
        ] {
            assert_eq!(of(link), Link::Folder("ap19xxx/old/".to_owned()), "{link}");
        }
        for link in [
            "../",
            "..",
            "./",
            "",
            "#top",
            "?C=N;O=D",
            "/mgs/data/ap19xxx/?C=M",
            "/mgs/data/",
            "/MGS/",
            "/",
            "https://a.gov/mgs/",
            "https://httpd.apache.org/",
            "https://a.gov",
            "mailto:a@a.gov",
            "javascript:back()",
            "/icons/folder.gif",
            "https://b.gov/manual.html",
        ] {
            assert_eq!(of(link), Link::Other, "{link}");
        }
        for link in [
            "/other/",
            "https://b.gov/mgs/data/ap19xxx/",
            "https://b.gov/ap19020k.b",
            "/mirror/ap19020k.b",
            "ap%2019/",
            "my folder/",
            "a%2e.b",
            ".hidden/",
            "get?file=ap19020k.b",
            "../../../../../a.b",
        ] {
            assert_eq!(of(link), Link::Unclear, "{link}");
        }
    }
}
