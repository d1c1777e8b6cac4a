//! The table of checksums of a volume, `checksum.tab`: MD5, two blanks, path.

use std::collections::BTreeMap;

use crate::{error::FetchError, safe::is_path};

/// MD5, hexadecimal in lower case, by path below the volume.
pub type Checksums = BTreeMap<String, String>;

/// The checksums of a table.
///
/// # Errors
/// [`FetchError::Index`] for the first malformed row, a path that leads out of the volume, two checksums of one file, and
/// an empty table.
pub fn checksums(table: &[u8]) -> Result<Checksums, FetchError> {
    let wrong = |line: usize, problem: String| FetchError::Index { line, problem };
    let text = str::from_utf8(table).map_err(|_| wrong(1, "not ASCII text".to_owned()))?;
    let mut checksums = Checksums::new();
    for (number, row) in text.lines().enumerate() {
        let row = row.trim_end();
        if row.is_empty() {
            continue;
        }
        let line = number + 1;
        let parts = row.split_once("  ").filter(|(md5, _)| is_md5(md5));
        let Some((md5, path)) = parts else {
            return Err(wrong(
                line,
                format!("{row:?}; expected 32 hexadecimal digits, two spaces and a path"),
            ));
        };
        if !is_path(path) {
            return Err(wrong(
                line,
                format!("{path:?} is not a path below the volume"),
            ));
        }
        let md5 = md5.to_ascii_lowercase();
        if let Some(earlier) = checksums.insert(path.to_owned(), md5.clone())
            && earlier != md5
        {
            return Err(wrong(
                line,
                format!("{path} has two checksums, {earlier} and {md5}"),
            ));
        }
    }
    if checksums.is_empty() {
        return Err(wrong(1, "the table is empty".to_owned()));
    }
    Ok(checksums)
}

fn is_md5(text: &str) -> bool {
    text.len() == 32 && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_read_and_malformed_ones_refused() {
        let md5 = "6522b3fd4666798873765bc0d3b5d240";
        let good =
            format!("{md5}  aareadme.htm                        \r\n{md5}  data/ck/a.bc\r\n");
        let read = checksums(good.as_bytes()).unwrap();
        assert_eq!(read["data/ck/a.bc"], md5);
        assert_eq!(read.len(), 2);
        for (table, expected) in [
            (format!("{md5} a.bc\n"), "expected 32 hexadecimal"),
            (format!("{}  a.bc\n", &md5[1..]), "expected 32 hexadecimal"),
            (
                format!("{md5}  a.bc\n{md5}  ../a.bc\n"),
                "line 2: \"../a.bc\" is not a path",
            ),
            (
                format!("{md5}  a.bc\n{}  a.bc\n", "0".repeat(32)),
                "two checksums",
            ),
            (String::new(), "empty"),
        ] {
            let told = checksums(table.as_bytes()).unwrap_err().to_string();
            assert!(told.contains(expected), "{told}");
        }
    }
}
