//! Names and paths that come from outside.

/// Whether a name may become a file name: it leads nowhere else, and is not hidden.
#[must_use]
pub(crate) fn is_name(name: &str) -> bool {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"._-+".contains(&byte);
    !name.is_empty()
        && name.len() <= 128
        && !name.starts_with(['.', '-'])
        && name.bytes().all(plain)
}

/// Whether a path of an index leads below its root: names with slashes between them.
#[must_use]
pub(crate) fn is_path(path: &str) -> bool {
    !path.is_empty() && path.split('/').all(is_name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_below_the_root_pass() {
        for good in ["a.bsp", "data/ck/mgs_sc_ext1.bc", "AP00001L.B"] {
            assert!(is_path(good), "{good}");
        }
        for bad in [
            "", "..", "../a", "a/../b", "/a", "a//b", "a\\b", "a b", ".fetch/a", "a/.lock", "-rf",
            "a%2e", "a?b", "a\0", "C:a", "é",
        ] {
            assert!(!is_path(bad), "{bad}");
        }
        assert!(!is_name("a/b") && !is_name(&"a".repeat(129)));
    }
}
