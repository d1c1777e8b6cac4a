//! Named things with a hash: kernels, stages, products.

use schemars::JsonSchema;
use serde::Serialize;

use areograph_base::body::Body;
use areograph_store::manifest::Manifest;

/// A named item.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Item {
    /// Name; repeated names are numbered `name (2)` and so on.
    pub name: String,
    /// Role of a kernel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub role: Option<String>,
    /// BLAKE3 hash of the file, or fingerprint of the stage.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub hash: String,
}

/// An item in both runs that differs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ChangedItem {
    /// Name.
    pub name: String,
    /// Role of a kernel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub role: Option<String>,
    /// Hash in the first run.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub a: String,
    /// Hash in the second run.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub b: String,
}

/// Differences between two lists of items.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Items {
    /// Items only in the second run.
    pub added: Vec<Item>,
    /// Items only in the first run.
    pub removed: Vec<Item>,
    /// Items in both runs with different hashes.
    pub changed: Vec<ChangedItem>,
    /// Number of items that are the same in both runs.
    pub unchanged: usize,
    /// Whether the order of the common items differs: of kernels with the same data, the last takes precedence.
    pub reordered: bool,
}

impl Items {
    pub(super) fn between(a: &[Item], b: &[Item]) -> Self {
        let find =
            |items: &[Item], name: &str| items.iter().find(|item| item.name == name).cloned();
        let unmatched = |items: &[Item], others: &[Item]| -> Vec<Item> {
            let unmatched = items
                .iter()
                .filter(|item| find(others, &item.name).is_none());
            unmatched.cloned().collect()
        };
        let pairs: Vec<(&Item, Item)> = a
            .iter()
            .filter_map(|first| Some((first, find(b, &first.name)?)))
            .collect();
        let changed: Vec<ChangedItem> = pairs
            .iter()
            .filter(|(first, second)| first.hash != second.hash)
            .map(|(first, second)| ChangedItem {
                name: first.name.clone(),
                role: second.role.clone(),
                a: first.hash.clone(),
                b: second.hash.clone(),
            })
            .collect();
        let order_of_b = b.iter().filter(|second| find(a, &second.name).is_some());
        Self {
            added: unmatched(b, a),
            removed: unmatched(a, b),
            unchanged: pairs.len() - changed.len(),
            reordered: !pairs
                .iter()
                .map(|(first, _)| &first.name)
                .eq(order_of_b.map(|second| &second.name)),
            changed,
        }
    }

    /// Whether both lists are the same.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.added.is_empty()
            && self.removed.is_empty()
            && self.changed.is_empty()
            && !self.reordered
    }
}

/// Items of one list, repeated names numbered.
fn items<'a>(entries: impl Iterator<Item = (&'a str, Option<&'a str>, &'a str)>) -> Vec<Item> {
    let mut items: Vec<Item> = Vec::new();
    for (plain, role, hash) in entries {
        let mut name = plain.to_owned();
        let mut place = 1;
        while items.iter().any(|item| item.name == name) {
            place += 1;
            name = format!("{plain} ({place})");
        }
        items.push(Item {
            name,
            role: role.map(str::to_owned),
            hash: hash.to_owned(),
        });
    }
    items
}

/// Kernels in load order.
pub(super) fn kernels(manifest: &Manifest) -> Vec<Item> {
    let kernels = manifest.kernels.iter();
    items(kernels.map(|kernel| (&*kernel.name, Some(&*kernel.role), &*kernel.blake3)))
}

/// Stages in the order of the flow.
pub(super) fn stages(manifest: &Manifest) -> Vec<Item> {
    let stages = manifest.stages.iter();
    items(stages.map(|stage| (&*stage.name, None, &*stage.fingerprint)))
}

/// Product files.
pub(super) fn products(manifest: &Manifest) -> Vec<Item> {
    let products = manifest.products.iter();
    items(products.map(|product| (&*product.path, None, &*product.blake3)))
}

/// Identifiers of images with that orientation.
pub(super) fn images(manifest: &Manifest, orientation: &str) -> Vec<String> {
    let image = |path: &str| {
        let inner = path.strip_prefix("images/")?.strip_suffix(".parquet")?;
        Some(
            inner
                .strip_suffix(orientation)?
                .strip_suffix('/')?
                .to_owned(),
        )
    };
    let products = manifest.products.iter();
    products
        .filter_map(|product| image(&product.path))
        .collect()
}

/// Names of `a` in order, then those only in `b`.
pub(super) fn united(a: &[String], b: &[String]) -> Vec<String> {
    let unmatched = b.iter().filter(|name| !a.contains(name));
    a.iter().chain(unmatched).cloned().collect()
}

/// The body of a run, by its configuration.
pub(super) fn body(of: &Manifest) -> Body {
    let written = of.configuration.keys.get("body");
    let is_it = |word: &str| written.is_some_and(|text| text.trim_matches('"') == word);
    let known = Body::WORDS.into_iter().find(|(word, _)| is_it(word));
    known.map_or_else(Body::default, |(_, body)| body)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_of_one_name_are_distinguished_and_order_counts() {
        let list = |entries: &[(&'static str, &'static str)]| {
            items(entries.iter().map(|(name, hash)| (*name, None, *hash)))
        };
        let a = list(&[("x.bc", "1"), ("x.bc", "2"), ("y.bsp", "3"), ("gone", "4")]);
        let b = list(&[("y.bsp", "3"), ("x.bc", "1"), ("x.bc", "5"), ("new", "6")]);
        let difference = Items::between(&a, &b);
        assert_eq!(difference.changed.len(), 1);
        assert_eq!(difference.changed[0].name, "x.bc (2)");
        assert_eq!((difference.unchanged, difference.reordered), (2, true));
        assert_eq!(difference.added[0].name, "new");
        assert_eq!(difference.removed[0].name, "gone");
        assert!(Items::between(&a, &a).is_empty());
    }
}
