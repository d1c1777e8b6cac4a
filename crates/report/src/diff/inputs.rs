//! Statistics, values, kernels, stages and products that differ.

use crate::{
    difference::{Change, Item, Items, RunDifference, Texts, text},
    html::{Cell, Column, Markup, Table, counted, html, list},
    numbers::{self, number, whole},
};
use areograph_products::read::ProfileDocument;
use areograph_store::files::short_hash;

/// Range residuals of the profiles that differ.
pub(super) fn profiles(site: &RunDifference) -> Markup {
    let changed = || site.profiles.iter().filter(|profile| profile.changed);
    if changed().next().is_none() {
        return Markup::default();
    }
    let mut table = Table::new(
        "Range − distance to the spacecraft in the kernels",
        &[
            Column::Text("profile"),
            Column::Number("shots A"),
            Column::Number("B"),
            Column::Number("mean A, m"),
            Column::Number("B"),
            Column::Number("B − A"),
            Column::Number("st. dev. A, m"),
            Column::Number("B"),
            Column::Number("outliers A"),
            Column::Number("B"),
            Column::Text("verdict"),
        ],
    );
    for profile in changed() {
        let [a, b] = [profile.a.as_ref(), profile.b.as_ref()];
        let cell = |profile: Option<&ProfileDocument>, value: fn(&ProfileDocument) -> String| {
            profile.map_or_else(|| "–".to_owned(), value)
        };
        let mut cells = vec![profile.profile.clone()];
        let mut pair = |value: fn(&ProfileDocument) -> String| {
            cells.extend([cell(a, value), cell(b, value)]);
        };
        pair(|p| whole(p.range_minus_distance_m.n));
        pair(|p| number(p.range_minus_distance_m.mean, 3));
        pair(|p| number(p.range_minus_distance_m.standard_deviation, 3));
        pair(|p| whole(p.outliers));
        let change_m = a.zip(b).map(|(a, b)| {
            let mean_m = |profile: &ProfileDocument| profile.range_minus_distance_m.mean;
            numbers::signed(mean_m(b) - mean_m(a), 3)
        });
        cells.insert(5, change_m.unwrap_or_else(|| "–".to_owned()));
        let word = |valid: Option<bool>| match valid {
            Some(true) => "valid",
            Some(false) => "INVALID",
            None => "absent",
        };
        let valid = [a, b].map(|profile| profile.map(|profile| profile.valid));
        cells.push(if valid[0] == valid[1] {
            word(valid[0]).to_owned()
        } else {
            format!("{} → {}", word(valid[0]), word(valid[1]))
        });
        table.row(valid[1] != Some(false), cells.into_iter().map(Cell::from));
    }
    let same = site.profiles.len() - changed().count();
    html! { (table.finish()) p { "The same in both: " (same) "." } }
}

/// A difference in the fewest digits that show it.
fn signed(difference: f64) -> String {
    if difference.abs() < 1e-3 {
        format!("{difference:+.1e}").replace('-', "−")
    } else {
        numbers::signed(difference, 3)
    }
}

/// Keys, corrections, counts, times and model statistics that differ.
pub(super) fn values(site: &RunDifference) -> Markup {
    let mut table = Table::new(
        "Values that differ",
        &[
            Column::Text("of"),
            Column::Text("value"),
            Column::Number("A"),
            Column::Number("B"),
            Column::Number("B − A"),
        ],
    );
    let (mut rows, mut rounding) = (0, 0);
    let mut add = |of: &str, changes: &[Change]| {
        let (small, listed): (Vec<&Change>, Vec<&Change>) =
            changes.iter().partition(|change| change.is_rounding());
        rounding += small.len();
        rows += listed.len();
        for change in listed {
            let [a, b] = [&change.a, &change.b].map(|value| text(value.as_ref()));
            let difference = change.difference().map(signed).unwrap_or_default();
            let what = (&change.what).into();
            table.row(
                true,
                [of.into(), what, a.into(), b.into(), difference.into()],
            );
        }
    };
    add("configuration", &site.configuration);
    add("corrections", &site.biases);
    add("counts", &site.counts);
    add("figures", &site.figures);
    add("rejected shots", &site.rejected);
    for image in &site.images {
        add(&format!("times of image {}", image.image), &image.times);
        add(&format!("models of image {}", image.image), &image.models);
    }
    if site.a.version != site.b.version {
        rows += 1;
        let [a, b] = [&site.a, &site.b].map(|run| run.version.clone());
        table.row(
            true,
            [
                "program".into(),
                "version".into(),
                a.into(),
                b.into(),
                "".into(),
            ],
        );
    }
    html! {
        @if rows > 0 { (table.finish()) }
        @if rounding > 0 {
            p { "Not listed: " (counted(rounding, "value")) " that differ by less than one part in a million." }
        }
    }
}

/// Kernels, stages and products that differ.
pub(super) fn items(site: &RunDifference) -> Markup {
    let kinds = [
        ("Kernels", &site.kernels),
        ("Stages, by their inputs", &site.stages),
        ("Products", &site.products),
    ];
    html! {
        @for (what, items) in kinds {
            @if !items.is_empty() { (item_table(what, items)) }
        }
    }
}

/// Columns of differing items.
const NO_ROLES: &[Column] = &[
    Column::Text("name"),
    Column::Text("change"),
    Column::Text("A"),
    Column::Text("B"),
];
const ROLES: &[Column] = &[
    Column::Text("name"),
    Column::Text("role"),
    Column::Text("change"),
    Column::Text("A"),
    Column::Text("B"),
];

fn item_table(what: &str, items: &Items) -> Markup {
    let changed = items.changed.iter().map(|item| &item.role);
    let others = items.removed.iter().chain(&items.added);
    // Only kernels have roles.
    let have_roles = changed
        .chain(others.map(|item| &item.role))
        .any(Option::is_some);
    let mut table = Table::new(what, if have_roles { ROLES } else { NO_ROLES });
    let mut row = |name: &str, role: &Option<String>, happened: &str, [a, b]: [Option<&str>; 2]| {
        let hash = |hash: Option<&str>| Cell::from(hash.map(short_hash).unwrap_or_default());
        let role = have_roles.then(|| Cell::from(role.clone().unwrap_or_default()));
        let hashes = [happened.into(), hash(a), hash(b)];
        table.row(
            true,
            [Cell::from(name)].into_iter().chain(role).chain(hashes),
        );
    };
    for item in &items.changed {
        row(
            &item.name,
            &item.role,
            "changed",
            [Some(&item.a), Some(&item.b)],
        );
    }
    for Item { name, role, hash } in &items.removed {
        row(name, role, "removed", [Some(hash), None]);
    }
    for Item { name, role, hash } in &items.added {
        row(name, role, "added", [None, Some(hash)]);
    }
    let order = if items.reordered {
        ", in another order"
    } else {
        ""
    };
    html! { (table.finish()) p { "The same in both: " (items.unchanged) (order) "." } }
}

/// Notes and problems of one run only.
pub(super) fn texts(site: &RunDifference) -> Markup {
    let all = [("Notes", &site.notes), ("Problems", &site.complaints)];
    html! {
        @for (what, Texts { only_in_a, only_in_b }) in all {
            @for (texts, whose) in [(only_in_a, "A"), (only_in_b, "B")] {
                @if !texts.is_empty() { p { (what) " only in " (whose) ":" } (list(texts)) }
            }
        }
    }
}
