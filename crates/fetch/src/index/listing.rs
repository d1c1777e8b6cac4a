//! Listings of folders as web servers write them: plain text or a table, size behind or before the name.

use crate::safe::is_name;

/// A file of a listing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Name.
    pub name: String,
    /// Size in bytes; rounded where the listing rounds it.
    pub bytes: Option<u64>,
    /// Whether the listing states the size to the byte.
    pub is_exact: bool,
}

/// The files that a page links to. Folders, other pages and names that lead elsewhere are left out.
///
/// Rows of Apache have the size behind the name, `<a href="a.b">a.b</a> 2009-02-26 17:19 2.2K`, in plain text or in
/// cells of a table; other servers have it before: `2/26/2009 5:19 PM 2270 <a href="/data/a.b">a.b</a><br>`.
#[must_use]
pub fn listing(page: &str) -> Vec<Listed> {
    let lower = page.to_ascii_lowercase();
    let links: Vec<usize> = lower.match_indices("<a ").map(|(at, _)| at).collect();
    let mut files: Vec<Listed> = Vec::new();
    for (place, at) in links.iter().enumerate() {
        let (end, before) = (
            links.get(place + 1).copied().unwrap_or(page.len()),
            place.checked_sub(1).map_or(0, |earlier| links[earlier]),
        );
        let Some((name, behind)) = named(&page[*at..end]) else {
            continue;
        };
        // A row ends with its line, or where the next row begins.
        let row = behind
            .split(['\n', '\r'])
            .find(|part| !part.trim().is_empty());
        let row = row.unwrap_or_default();
        let row = &row[..first_of(&row.to_ascii_lowercase(), &["</tr", "<br"])];
        let size = size_in(row).or_else(|| {
            let ahead = page[before..*at].to_ascii_lowercase();
            let start = ["<br>", "<br/>", "<br />", "\n", "</a>"].iter();
            let start = start.filter_map(|part| Some(ahead.rfind(part)? + part.len()));
            size_in(&ahead[start.max().unwrap_or(0)..])
        });
        if !files.iter().any(|file| file.name == name) {
            files.push(Listed {
                name: name.to_owned(),
                bytes: size.map(|(bytes, _)| bytes),
                is_exact: size.is_some_and(|(_, is_exact)| is_exact),
            });
        }
    }
    files
}

/// The addresses of all links of a page.
pub(crate) fn addresses(page: &str) -> Vec<&str> {
    let lower = page.to_ascii_lowercase();
    let links = lower.match_indices("<a").filter_map(|(at, _)| {
        let is_link = page[at + 2..].starts_with(|letter: char| letter.is_ascii_whitespace());
        address_of(&page[at..]).filter(|_| is_link)
    });
    links.collect()
}

/// The address of a link.
fn address_of(link: &str) -> Option<&str> {
    let start = link.to_ascii_lowercase().find("href=")? + "href=".len();
    let quote = link[start..].chars().next()?;
    match quote {
        '"' | '\'' => link[start + 1..].split(quote).next(),
        _ => link[start..].split([' ', '>']).next(),
    }
}

/// The last part of the address of a link, and the text behind the link.
fn named(link: &str) -> Option<(&str, &str)> {
    let lower = link.to_ascii_lowercase();
    let address = address_of(link)?;
    let name = address.rsplit('/').next()?;
    let behind = &link[lower.find("</a>")? + "</a>".len()..];
    (is_name(name) && name.contains('.')).then_some((name, behind))
}

fn first_of(text: &str, ends: &[&str]) -> usize {
    let ends = ends.iter().filter_map(|end| text.find(end));
    ends.min().unwrap_or(text.len())
}

/// The size in a row behind or before a name: the word after a time of day.
fn size_in(row: &str) -> Option<(u64, bool)> {
    let mut text = String::new();
    let mut is_tag = false;
    for letter in row.chars() {
        match letter {
            '<' => is_tag = true,
            '>' => {
                is_tag = false;
                text.push(' ');
            }
            _ if !is_tag => text.push(letter),
            _ => {}
        }
    }
    let text = text.replace("&nbsp;", " ");
    let words = text.split_whitespace();
    let mut words = words.skip_while(|word| !is_time(word)).skip(1);
    let half_day = |word: &&str| ["am", "pm"].contains(&&*word.to_ascii_lowercase());
    size_of(words.find(|word| !half_day(word))?)
}

fn is_time(word: &str) -> bool {
    let mut parts = word.split(':');
    let digits =
        |part: &str| (1..=2).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit());
    parts.clone().count() > 1 && parts.all(digits)
}

/// Bytes, and whether they are exact: `2270`, `2.2K`, `14M`.
fn size_of(word: &str) -> Option<(u64, bool)> {
    let word = word.replace(',', "");
    if let Ok(bytes) = word.parse() {
        return Some((bytes, true));
    }
    let unit = word.chars().next_back()?;
    let factor = match unit.to_ascii_uppercase() {
        'K' => 1024.0,
        'M' => 1024.0 * 1024.0,
        'G' => 1024.0 * 1024.0 * 1024.0,
        _ => return None,
    };
    let number: f64 = word[..word.len() - unit.len_utf8()].parse().ok()?;
    (0.0..1e6)
        .contains(&number)
        .then(|| (whole(number * factor), false))
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "from 0 to 1e15"
)]
fn whole(bytes: f64) -> u64 {
    bytes.round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str, bytes: u64, is_exact: bool) -> Listed {
        let bytes = Some(bytes);
        Listed {
            name: name.to_owned(),
            bytes,
            is_exact,
        }
    }

    #[test]
    fn listings_of_all_forms_are_read() {
        let plain = "<pre><a href=\"?C=N;O=D\">Name</a> <a href=\"?C=M;O=A\">Last modified</a>\n\
            <a href=\"/pub/naif/\">Parent Directory</a>                       -   \n\
            <a href=\"aareadme.txt\">aareadme.txt</a>            26-Feb-2009 17:19  2.2K  \n\
            <a href=\"sub/\">sub/</a>                            2009-02-26 17:19    -   \n\
            <a href=\"mgs_ext1.bsp\">mgs_ext1.bsp</a>            2009-02-26 17:19   14M  \n\
            <a href=\"mgs_ext2.bsp\">mgs_ext2.bsp</a>            2009-02-26 17:19  8712192\n</pre>";
        let expected = [
            file("aareadme.txt", 2253, false),
            file("mgs_ext1.bsp", 14_680_064, false),
            file("mgs_ext2.bsp", 8_712_192, true),
        ];
        assert_eq!(listing(plain), expected);
        let table = "<tr><td><a href=\"mgs_ext1.bsp\">mgs_ext1.bsp</a></td><td align=\"right\">2009-02-26 17:19  </td>\
            <td align=\"right\"> 14M</td><td>&nbsp;</td></tr>\n\
            <tr><td valign=\"top\"><img src=\"x.gif\"></td><td><a href=\"mgs_ext2.bsp\">mgs_ext2.bsp</a></td>\
            <td>2009-02-26 17:19</td><td>8712192</td></tr>";
        assert_eq!(listing(table), expected[1..]);
        let before = "<pre><A HREF=\"/mgs/data/\">[To Parent Directory]</A><br><br> \
            8/12/2003  9:45 AM      7224560 <A HREF=\"/mgs/data/ap01578l.b\">ap01578l.b</A><br> \
            12/1/2003 12:45 PM        &lt;dir&gt; <A HREF=\"/mgs/data/old/\">old</A><br> \
            8/12/2003  9:46 AM      100 <A HREF=\"/mgs/data/ap01593l.b\">ap01593l.b</A><br></pre>";
        assert_eq!(
            listing(before),
            [
                file("ap01578l.b", 7_224_560, true),
                file("ap01593l.b", 100, true)
            ]
        );
    }

    #[test]
    fn links_that_lead_elsewhere_are_left_out() {
        let page = "<a href=\"../../etc/pas swd\">x</a> <a href=\"..\">up</a> <a href=\"a%2e%2e.b\">x</a> <a href='b.b'>b</a> \
            <a href=c.b>c</a> <a name=\"top\">top</a> <a href=\"d.b";
        let names: Vec<String> = listing(page).into_iter().map(|file| file.name).collect();
        assert_eq!(names, ["b.b", "c.b"]);
        assert_eq!(listing(page)[0].bytes, None);
    }

    proptest::proptest! {
        #[test]
        fn no_page_stops_the_reader(page in "(<a href=|</a>|\"|é|<br>|>| 1:2|9K|\n|a.b){0,40}") {
            let _ = addresses(&page);
            for file in listing(&page) {
                proptest::prop_assert!(is_name(&file.name));
            }
        }
    }
}
