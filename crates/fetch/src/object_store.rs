//! Object stores with the interface of S3: `s3://BUCKET/PREFIX/` names a folder of objects, `s3://BUCKET/KEY` an object.
//!
//! Requests are addresses that contain their signature (AWS Signature Version 4, query string). The store is that of the
//! variables that programs for S3 share: `AWS_ENDPOINT_URL_S3` or `AWS_ENDPOINT_URL`, `AWS_REGION` or `AWS_DEFAULT_REGION`,
//! `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY` and `AWS_SESSION_TOKEN`. Without a key, requests are not signed, as public
//! buckets permit. Messages name objects, never signed addresses.

use std::{borrow::Cow, collections::BTreeSet, env, fmt::Write as _, time::Duration};

use rusty_s3::{
    Bucket, Credentials, S3Action as _, UrlStyle,
    actions::{ListObjectsV2, ListObjectsV2Response},
};

use crate::{address::permitted, error::FetchError, page::excerpt};

/// Time for which a signed address is valid: a request is made at once, and signed again when it is repeated.
const VALID: Duration = Duration::from_mins(15);
const REGION: &str = "us-east-1";
/// Answers of a listing, of up to a thousand objects each.
const PAGES_MAX: usize = 1_000;

/// An object, or a folder of objects, and access to it.
#[derive(Debug)]
pub(crate) struct Stored {
    bucket: Bucket,
    credentials: Option<Credentials>,
    key: String,
}

/// Whether an address names objects of a store.
pub(crate) fn is_stored(url: &str) -> bool {
    url.starts_with("s3://")
}

impl Stored {
    /// The object or folder of objects with an address.
    ///
    /// # Errors
    /// No bucket; variables of the environment that cannot be used.
    #[expect(
        clippy::disallowed_methods,
        reason = "keys do not belong into a file; every client of object stores reads these variables"
    )]
    pub(crate) fn at(url: &str) -> Result<Self, FetchError> {
        Self::with(url, |name| {
            env::var(name).ok().filter(|value| !value.is_empty())
        })
    }

    fn with(url: &str, variable: impl Fn(&str) -> Option<String>) -> Result<Self, FetchError> {
        let wrong = |problem: String| refused(url, problem);
        let either = |names: [&'static str; 2]| {
            let mut values = names.into_iter().map(|name| Some((name, variable(name)?)));
            values.find_map(|found| found)
        };
        let (bucket, key) = url
            .strip_prefix("s3://")
            .and_then(|path| path.split_once('/'))
            .filter(|(bucket, _)| !bucket.is_empty())
            .ok_or_else(|| wrong("names no bucket; expected s3://BUCKET/PREFIX/".to_owned()))?;
        let region = either(["AWS_REGION", "AWS_DEFAULT_REGION"]);
        let (region_name, region) = region.unwrap_or(("AWS_REGION", REGION.to_owned()));
        let endpoint = either(["AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL"]);
        // Certificates of Amazon do not cover names of buckets with a dot.
        let style = if endpoint.is_some() || bucket.contains('.') {
            UrlStyle::Path
        } else {
            UrlStyle::VirtualHost
        };
        let (name, endpoint) = endpoint.unwrap_or_else(|| {
            let amazon = format!("https://s3.{region}.amazonaws.com");
            (region_name, amazon)
        });
        let expected = || {
            wrong(format!(
                "{name} leads to {endpoint:?}; expected the address of an object store: https://, or http:// on this computer"
            ))
        };
        if endpoint.contains('@') {
            return Err(wrong(format!(
                "{name} contains a user name or a password; expected them in AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"
            )));
        }
        permitted(&endpoint).map_err(|_| expected())?;
        let endpoint = endpoint.parse().map_err(|_| expected())?;
        let bucket = Bucket::new(endpoint, style, bucket.to_owned(), region);
        let bucket = bucket.map_err(|_| expected())?;
        let credentials = match ["AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"].map(&variable) {
            [Some(key), Some(secret)] => Some(match variable("AWS_SESSION_TOKEN") {
                Some(token) => Credentials::new_with_token(key, secret, token),
                None => Credentials::new(key, secret),
            }),
            [None, None] => None,
            [Some(_), None] => {
                return Err(wrong(
                    "AWS_ACCESS_KEY_ID is set without AWS_SECRET_ACCESS_KEY; expected both or none"
                        .to_owned(),
                ));
            }
            [None, Some(_)] => {
                return Err(wrong(
                    "AWS_SECRET_ACCESS_KEY is set without AWS_ACCESS_KEY_ID; expected both or none"
                        .to_owned(),
                ));
            }
        };
        Ok(Self {
            bucket,
            credentials,
            key: key.to_owned(),
        })
    }

    /// Signed address of the object.
    pub(crate) fn address(&self) -> String {
        let object = self.bucket.get_object(self.credentials.as_ref(), &self.key);
        object.sign(VALID).into()
    }

    /// Signed address of an answer of the listing of the folder.
    fn listing(&self, after: Option<&str>) -> String {
        let mut list = self.bucket.list_objects_v2(self.credentials.as_ref());
        list.with_delimiter("/");
        list.with_prefix(self.key.as_str());
        if let Some(after) = after {
            list.with_continuation_token(Cow::Owned(after.to_owned()));
        }
        list.sign(VALID).into()
    }

    /// The listing of the folder, as a server of files writes it.
    ///
    /// # Errors
    /// Those of `request`, which returns the text at an address; another answer than a listing.
    pub(crate) fn page<E: From<FetchError>>(
        &self,
        url: &str,
        mut request: impl FnMut(&str) -> Result<String, E>,
    ) -> Result<String, E> {
        let (mut rows, mut seen, mut after) = (BTreeSet::new(), BTreeSet::new(), None);
        let mut is_empty = true;
        while seen.len() < PAGES_MAX {
            let text = request(&self.listing(after.as_deref()))?;
            let listed = ListObjectsV2::parse_response(&text).map_err(|error| {
                let text = excerpt(&text);
                let problem =
                    format!("the answer is not a complete listing of objects ({error}): {text}");
                refused(url, problem)
            })?;
            is_empty &= listed.contents.is_empty() && listed.common_prefixes.is_empty();
            let added = self.add(&listed, &mut rows);
            added.map_err(|problem| refused(url, problem))?;
            let Some(next) = listed.next_continuation_token else {
                // A store lists a folder that it does not have as an empty one.
                let (url, status) = (url.to_owned(), 404);
                return if is_empty {
                    Err(FetchError::Status { url, status }.into())
                } else {
                    Ok(rows.into_iter().collect())
                };
            };
            if !seen.insert(next.clone()) {
                break;
            }
            after = Some(next);
        }
        let problem = "the listing of objects does not end".to_owned();
        Err(refused(url, problem).into())
    }

    /// Adds the rows of an answer; the problem of an object that cannot be listed.
    fn add(
        &self,
        listed: &ListObjectsV2Response,
        rows: &mut BTreeSet<String>,
    ) -> Result<(), String> {
        let folders = listed.common_prefixes.iter();
        let folders = folders.map(|folder| (&folder.prefix, Some(0)));
        let objects = listed.contents.iter();
        let objects = objects.map(|object| (&object.key, object.size));
        for (key, bytes) in folders.chain(objects) {
            let name = key.strip_prefix(self.key.as_str()).ok_or_else(|| {
                format!(
                    "the listing names {key:?}; expected names that begin with {:?}",
                    self.key
                )
            })?;
            let bytes = bytes.ok_or_else(|| format!("the listing states no size of {key:?}"))?;
            // A folder that was created by itself is an object with an empty name.
            if !name.is_empty() {
                let name = in_address(name);
                rows.insert(format!("<a href=\"{name}\">{name}</a> 00:00 {bytes}\n"));
            }
        }
        Ok(())
    }
}

/// A name as an address has it: readers of listings refuse files whose names are encoded.
fn in_address(name: &str) -> String {
    let mut text = String::new();
    for letter in name.chars() {
        if letter.is_control() || "\"'<>&?#%\\".contains(letter) {
            // Writing to a text does not fail.
            let _ = write!(text, "%{:02X}", u32::from(letter));
        } else {
            text.push(letter);
        }
    }
    text
}

fn refused(url: &str, problem: String) -> FetchError {
    let url = url.to_owned();
    FetchError::ObjectStore { url, problem }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stored(url: &str, variables: &[(&str, &str)]) -> Result<Stored, String> {
        let variable = |name: &str| {
            let found = variables.iter().find(|(known, _)| *known == name)?;
            Some(found.1.to_owned())
        };
        Stored::with(url, variable).map_err(|error| error.to_string())
    }

    #[test]
    fn addresses_follow_the_variables_that_programs_for_s3_share() {
        let of = |url, variables: &[_]| stored(url, variables).unwrap().address();
        let key = "s3://mola/pedr/ap01578l.b";
        assert_eq!(
            of(key, &[]),
            "https://mola.s3.us-east-1.amazonaws.com/pedr/ap01578l.b"
        );
        let west = [("AWS_DEFAULT_REGION", "us-west-2")];
        assert_eq!(
            of("s3://a.b/x+y.b", &west),
            "https://s3.us-west-2.amazonaws.com/a.b/x%2By.b"
        );
        let own = [
            ("AWS_ENDPOINT_URL", "https://other.example.org"),
            ("AWS_ENDPOINT_URL_S3", "http://127.0.0.1:9000"),
        ];
        assert_eq!(of(key, &own), "http://127.0.0.1:9000/mola/pedr/ap01578l.b");
        let secret = [
            ("AWS_ACCESS_KEY_ID", "KEY"),
            ("AWS_SECRET_ACCESS_KEY", "SECRET"),
            ("AWS_SESSION_TOKEN", "TOKEN"),
        ];
        let signed = of(key, &secret);
        for part in [
            "X-Amz-Credential=KEY%2F",
            "X-Amz-Signature=",
            "X-Amz-Security-Token=TOKEN",
        ] {
            assert!(signed.contains(part), "{signed}");
        }
        assert!(!signed.contains("SECRET"), "{signed}");
    }

    #[test]
    fn incomplete_settings_are_refused() {
        for (url, variables, expected) in [
            ("s3://", [("", ""); 1], "s3://BUCKET/PREFIX/"),
            ("s3://mola", [("", "")], "s3://BUCKET/PREFIX/"),
            ("s3:///x", [("", "")], "s3://BUCKET/PREFIX/"),
            ("s3://a/", [("AWS_ENDPOINT_URL", "store")], "https://"),
            (
                "s3://a/",
                [("AWS_ENDPOINT_URL", "https://user:word@a.gov")],
                "AWS_ENDPOINT_URL contains a user name",
            ),
            (
                "s3://a/",
                [("AWS_ENDPOINT_URL", "http://a.gov:9000")],
                "on this computer",
            ),
            (
                "s3://a/",
                [("AWS_ACCESS_KEY_ID", "k")],
                "without AWS_SECRET_ACCESS_KEY",
            ),
            (
                "s3://a/",
                [("AWS_SECRET_ACCESS_KEY", "k")],
                "without AWS_ACCESS_KEY_ID",
            ),
        ] {
            let error = stored(url, &variables).unwrap_err();
            assert!(
                error.contains(expected) && error.starts_with(url),
                "{error}"
            );
        }
    }

    #[test]
    fn listings_of_several_answers_become_one_page() {
        let of = |body: &str| {
            let namespace = "http://s3.amazonaws.com/doc/2006-03-01/";
            format!("<ListBucketResult xmlns=\"{namespace}\">{body}</ListBucketResult>")
        };
        let object = |key: &str, bytes: u32| {
            format!("<Contents><Key>{key}</Key><Size>{bytes}</Size></Contents>")
        };
        let first = of(&format!(
            "<EncodingType>url</EncodingType><IsTruncated>true</IsTruncated>\
             <NextContinuationToken>t/2=</NextContinuationToken>{}{}\
             <CommonPrefixes><Prefix>p%2Fap01xxx%2F</Prefix></CommonPrefixes>",
            object("p%2F", 0),
            object("p%2Fb.b", 7)
        ));
        let second = of(&format!(
            "<IsTruncated>false</IsTruncated>{}",
            object("p/a.b", 5)
        ));
        let folder = stored("s3://m/p/", &[("AWS_ENDPOINT_URL", "http://localhost:1")]).unwrap();
        let mut asked = Vec::new();
        let page: Result<String, FetchError> = folder.page("s3://m/p/", |address| {
            asked.push(address.to_owned());
            Ok([&first, &second][asked.len() - 1].clone())
        });
        assert_eq!(
            page.unwrap(),
            "<a href=\"a.b\">a.b</a> 00:00 5\n<a href=\"ap01xxx/\">ap01xxx/</a> 00:00 0\n\
             <a href=\"b.b\">b.b</a> 00:00 7\n"
        );
        assert!(asked[0].contains("prefix=p%2F") && !asked[0].contains("continuation"));
        assert!(
            asked[1].contains("continuation-token=t%2F2%3D"),
            "{asked:?}"
        );
        let encoded = "<EncodingType>url</EncodingType>";
        let quoted = of(&format!("{encoded}{}", object("p%2Fa%22.b", 1)));
        let page: Result<String, FetchError> = folder.page("s3://m/p/", |_| Ok(quoted.clone()));
        assert_eq!(page.unwrap(), "<a href=\"a%22.b\">a%22.b</a> 00:00 1\n");
        // The same continuation again and again; another answer.
        let listing_of = |name: &str| of(&object(name, 1));
        for (answer, expected) in [
            (&*first, "does not end"),
            (&*of(""), "HTTP status 404"),
            (&*of("<IsTruncated>true</IsTruncated>"), "complete listing"),
            (&*of("<Contents><Key>p/a.b</Key></Contents>"), "no size"),
            (&*listing_of("q/a.b"), "begin with"),
            ("<html><title>Login</title>", "): Login"),
        ] {
            let page: Result<String, FetchError> =
                folder.page("s3://m/p/", |_| Ok(answer.to_owned()));
            let error = page.unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
