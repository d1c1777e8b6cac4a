//! A pair of images, before and after the adjustment.

use std::collections::{HashMap, HashSet};

use super::super::{
    html::{Cell, Markup, html},
    numbers::whole,
    plots::label,
};
use areograph_products::{GeometricProducts, IMAGES_SHOWN};
use areograph_stages::compare_pairs::PairComparison;

/// Largest number of pairs with separate rows: all pairs of a site whose images are all shown.
pub(crate) const PAIRS_TABLED: usize = IMAGES_SHOWN * (IMAGES_SHOWN - 1) / 2;

/// A pair of images before the adjustment and, if tie points still join it, after.
pub(crate) struct BeforeAfter<'a> {
    pub(crate) before: &'a PairComparison,
    pub(crate) after: Option<&'a PairComparison>,
    /// Indices of both among the pairs of their state.
    places: [usize; 2],
    /// Whether there is an adjustment.
    adjusted: bool,
}

impl<'a> BeforeAfter<'a> {
    pub(crate) fn all(geometric: &GeometricProducts<'a>) -> Vec<Self> {
        let adjusted = geometric
            .adjustment
            .map_or(&[][..], |adjustment| adjustment.pairs);
        let mut places: HashMap<&[String; 2], usize> = HashMap::new();
        for (index, pair) in adjusted.iter().enumerate() {
            places.entry(&pair.images).or_insert(index);
        }
        let of = |(index, before): (usize, &'a PairComparison)| {
            let after = places.get(&before.images).copied();
            Self {
                before,
                after: after.map(|at| &adjusted[at]),
                places: [index, after.unwrap_or_default()],
                adjusted: geometric.adjustment.is_some(),
            }
        };
        geometric.pairs.iter().enumerate().map(of).collect()
    }

    /// The pair with the largest along-track parallax of its tie points before the adjustment.
    pub(crate) fn worst(pairs: &[Self]) -> Option<&Self> {
        let size = |pair: &&Self| pair.before.along_track_parallax_m.abs();
        pairs.iter().max_by(|a, b| size(a).total_cmp(&size(b)))
    }

    /// The pairs with separate rows: all of a few pairs, and of many the ones with the largest along-track parallax,
    /// after the adjustment where there is one, in the order of the site.
    pub(crate) fn tabled(mut pairs: Vec<Self>) -> Vec<Self> {
        if pairs.len() > PAIRS_TABLED {
            let apart_m = |pair: &Self| {
                let last = pair.after.unwrap_or(pair.before);
                last.along_track_parallax_m.abs()
            };
            pairs.sort_by(|one, other| apart_m(other).total_cmp(&apart_m(one)));
            pairs.truncate(PAIRS_TABLED);
            pairs.sort_by_key(|pair| pair.places[0]);
        }
        pairs
    }

    /// The images of the pairs with separate rows.
    pub(crate) fn images_tabled(geometric: &GeometricProducts<'a>) -> HashSet<&'a [String; 2]> {
        let tabled = Self::tabled(Self::all(geometric)).into_iter();
        tabled.map(|pair| &pair.before.images).collect()
    }

    /// A paragraph that states that rows are of some pairs only; empty where they are of all.
    pub(crate) fn some_of_all(geometric: &GeometricProducts) -> Markup {
        let all = geometric.pairs.len();
        html! {
            @if all > PAIRS_TABLED {
                p {
                    "Rows show the " (PAIRS_TABLED) " of " (whole(all))
                    " pairs with the largest along-track parallax; adjustment.json contains all pairs."
                }
            }
        }
    }

    /// Both images by name.
    pub(crate) fn name(&self) -> String {
        self.before.images.join(" and ")
    }

    /// Place of a state in the products, which have it if there is an adjustment.
    pub(crate) fn place(&self, state: &str) -> String {
        let [before, after] = self.places;
        let index = if state == "after" { after } else { before };
        if self.adjusted {
            format!("adjustment.json#/{state}/pairs/{index}")
        } else {
            String::new()
        }
    }

    /// Each state with its name.
    pub(crate) fn states(&self) -> impl Iterator<Item = (&'static str, &'a PairComparison)> {
        let after = self.after.map(|pair| ("after", pair));
        [("before", self.before)].into_iter().chain(after)
    }

    /// A cell on one of its profiles.
    pub(super) fn traced(&self, state: &str, profile: usize, name: &str, text: String) -> Cell {
        let place = self.place(state);
        if place.is_empty() {
            return text.into();
        }
        Cell::from(text).traced(format!("{place}/footprints/profiles/{profile}/{name}"))
    }

    /// The cells that begin a row.
    pub(super) fn head(&self, state: &'static str, found: &PairComparison) -> Vec<Cell> {
        let ties = Cell::from(whole(found.ties)).traced("/ties");
        vec![self.name().into(), state.into(), ties]
    }

    /// Disagreement of the two images on one position, before and after.
    pub(crate) fn sentence(&self) -> String {
        let (before, after) = (
            self.apart(self.before),
            self.after.map(|after| self.apart(after)),
        );
        let what = if self.by_footprints() {
            "the two positions of a footprint"
        } else {
            "the two positions of a tie point"
        };
        if !self.adjusted {
            return format!(
                "{}, along track: {what} are on average {} apart.",
                self.name(),
                before.in_words()
            );
        }
        let after = after.map_or_else(
            || "after it, no tie point joins the images".to_owned(),
            |after| format!("{} after it", after.in_words()),
        );
        format!(
            "{}, along track: {what} were on average {} apart before the adjustment; {after}.",
            self.name(),
            before.in_words()
        )
    }

    /// Whether footprints give the disagreement of the images, before and after alike; otherwise tie points do.
    fn by_footprints(&self) -> bool {
        self.states().all(|(_, pair)| by_footprints(pair).is_some())
    }

    /// Disagreement of the images of `pair`, one of the states.
    fn apart(&self, pair: &PairComparison) -> Apart {
        let by_footprints = by_footprints(pair).filter(|_| self.by_footprints());
        let metres = by_footprints.map_or(pair.along_track_parallax_m, |[metres, _]| metres);
        Apart {
            metres,
            sigma_m: by_footprints.map(|[_, sigma_m]| sigma_m),
            spacings: pair.mola_spacing_m.map(|spacing_m| metres / spacing_m),
        }
    }
}

/// Along-track disagreement of two images.
struct Apart {
    /// Metres on the ground, without sign.
    metres: f64,
    /// Its standard deviation; `None` if by tie points.
    sigma_m: Option<f64>,
    /// The disagreement in distances of successive footprints.
    spacings: Option<f64>,
}

impl Apart {
    fn in_words(&self) -> String {
        let metres = |metres| format!("{} m", label(metres, usize::from(metres < 10.0)));
        let sigma = self
            .sigma_m
            .map(|sigma_m| format!(", σ {}", metres(sigma_m)));
        let metres = metres(self.metres) + &sigma.unwrap_or_default();
        self.spacings.map_or_else(
            || metres.clone(),
            |spacings| {
                let decimals = if spacings < 0.1 { 3 } else { 2 };
                format!("{} shot spacings ({metres})", label(spacings, decimals))
            },
        )
    }
}

/// Disagreement of two images on their footprints, and its standard deviation, metres.
pub(crate) fn by_footprints(pair: &PairComparison) -> Option<[f64; 2]> {
    let found = pair.footprints.as_ref()?;
    Some([found.apart_m?, found.apart_sigma_m?])
}
