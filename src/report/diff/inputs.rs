//! Statistics, values, kernels, stages and products that differ.

use crate::{
    difference::{Change, Item, Items, RunDifference, Texts, text},
    products::read::ProfileDocument,
    report::{
        html::{Table, list, paragraph},
        summary::short,
    },
};

/// Range residuals per profile in both runs.
pub(super) fn profiles(site: &RunDifference) -> String {
    if site.profiles.is_empty() {
        return String::new();
    }
    let heads = [
        "profile",
        "shots A",
        "B",
        "mean A, m",
        "B",
        "B − A",
        "st. dev. A, m",
        "B",
        "outliers A",
        "B",
        "verdict",
    ];
    let numbers: &'static [bool] = &[
        false, true, true, true, true, true, true, true, true, true, false,
    ];
    let mut table = Table::new(&heads, numbers);
    for profile in &site.profiles {
        let [a, b] = [profile.a.as_ref(), profile.b.as_ref()];
        let cell = |profile: Option<&ProfileDocument>, value: fn(&ProfileDocument) -> String| {
            profile.map_or_else(|| "–".to_owned(), value)
        };
        let mut cells = vec![profile.profile.clone()];
        let mut pair = |value: fn(&ProfileDocument) -> String| {
            cells.extend([cell(a, value), cell(b, value)]);
        };
        pair(|p| p.range_minus_distance_m.n.to_string());
        pair(|p| format!("{:.3}", p.range_minus_distance_m.mean));
        pair(|p| format!("{:.3}", p.range_minus_distance_m.standard_deviation));
        pair(|p| p.outliers.to_string());
        let change_m = a.zip(b).map(|(a, b)| {
            let mean_m = |profile: &ProfileDocument| profile.range_minus_distance_m.mean;
            format!("{:+.3}", mean_m(b) - mean_m(a))
        });
        cells.insert(5, change_m.unwrap_or_else(|| "–".to_owned()));
        let word = |valid: Option<bool>| match valid {
            Some(true) => "valid",
            Some(false) => "INVALID",
            None => "not there",
        };
        let valid = [a, b].map(|profile| profile.map(|profile| profile.valid));
        cells.push(if valid[0] == valid[1] {
            word(valid[0]).to_owned()
        } else {
            format!("{} → {}", word(valid[0]), word(valid[1]))
        });
        table.row(valid[1] != Some(false), &cells);
    }
    table.finish()
}

/// Keys, corrections, counts, times and model statistics that differ.
pub(super) fn values(site: &RunDifference) -> String {
    let mut table = Table::new(&["of", "value", "A", "B"], &[false; 4]);
    let mut rows = 0;
    let mut add = |of: &str, changes: &[Change]| {
        rows += changes.len();
        for change in changes {
            let [a, b] = [&change.a, &change.b].map(|value| text(value.as_ref()));
            table.row(true, &[of.to_owned(), change.what.clone(), a, b]);
        }
    };
    add("configuration", &site.configuration);
    add("corrections", &site.biases);
    add("counts", &site.counts);
    add("rejected shots", &site.rejected);
    for image in &site.images {
        add(&format!("times of image {}", image.image), &image.times);
        add(&format!("models of image {}", image.image), &image.models);
    }
    if site.a.version != site.b.version {
        rows += 1;
        let [a, b] = [&site.a, &site.b].map(|run| run.version.clone());
        table.row(true, &["program".to_owned(), "version".to_owned(), a, b]);
    }
    let hidden = if site.configuration_changed {
        paragraph(
            "The configurations differ. Keys are compared where products repeat them (mola_clock, range_check); \
             others may differ as well.",
        )
    } else {
        String::new()
    };
    if rows == 0 {
        return hidden;
    }
    table.finish() + &hidden
}

/// Kernels, stages and products that differ.
pub(super) fn items(site: &RunDifference) -> String {
    let mut body = String::new();
    for (what, items) in [
        ("kernel", &site.kernels),
        ("stage, by what entered it", &site.stages),
        ("product", &site.products),
    ] {
        if !items.is_empty() {
            body += &item_table(what, items);
        }
    }
    body
}

fn item_table(what: &str, items: &Items) -> String {
    let mut table = Table::new(&[what, "role", "what happened", "A", "B"], &[false; 5]);
    let role = |role: &Option<String>| role.clone().unwrap_or_default();
    for item in &items.changed {
        table.row(
            true,
            &[
                item.name.clone(),
                role(&item.role),
                "changed".to_owned(),
                short(&item.a),
                short(&item.b),
            ],
        );
    }
    let mut lonely = |item: &Item, happened: &str, [a, b]: [String; 2]| {
        let happened = happened.to_owned();
        table.row(true, &[item.name.clone(), role(&item.role), happened, a, b]);
    };
    for item in &items.removed {
        lonely(item, "removed", [short(&item.hash), String::new()]);
    }
    for item in &items.added {
        lonely(item, "added", [String::new(), short(&item.hash)]);
    }
    let order = if items.reordered {
        ", in another order"
    } else {
        ""
    };
    table.finish() + &paragraph(&format!("The same in both: {}{order}.", items.unchanged))
}

/// Notes and complaints of one run alone.
pub(super) fn texts(site: &RunDifference) -> String {
    let told = |texts: &Texts, what: &str| {
        let runs = [(&texts.only_in_a, "A"), (&texts.only_in_b, "B")].into_iter();
        runs.filter(|(texts, _)| !texts.is_empty())
            .map(|(texts, whose)| paragraph(&format!("{what} only in {whose}:")) + &list(texts))
            .collect::<String>()
    };
    told(&site.notes, "Notes") + &told(&site.complaints, "Complaints")
}
