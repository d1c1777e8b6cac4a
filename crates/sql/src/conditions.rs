//! Bounds on position, time and file of shots from the conditions of a query. They are never narrower than the
//! conditions; the query tests every row again.

use std::{collections::BTreeSet, iter};

use datafusion::{
    common::{Column, ScalarValue},
    logical_expr::{Between, BinaryExpr, Expr, Operator, expr::InList},
};

use areograph_base::{
    time::{Et, Interval},
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::window::{Region, WindowShape};

/// Alternatives kept separate; further ones are merged.
const ALTERNATIVES_MAX: usize = 64;
/// Margin of windows around the conditions, degrees: far above the rounding of a longitude, far below a footprint.
const ROUNDING_DEG: f64 = 1e-7;
/// Margin of intervals, seconds.
const ROUNDING_S: f64 = 1e-6;

/// Columns whose conditions are evaluated.
const LONGITUDE: &str = "longitude_deg";
const LATITUDE: &str = "latitude_deg";
const TIMES: [&str; 2] = ["et_tag_s", "et_s"];
const FILE: &str = "source_file";

/// From the first number to the second.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Span(f64, f64);

impl Span {
    const ALL: Self = Self(f64::NEG_INFINITY, f64::INFINITY);

    fn both(self, other: Self) -> Self {
        Self(self.0.max(other.0), self.1.min(other.1))
    }

    fn hull(self, other: Self) -> Self {
        Self(self.0.min(other.0), self.1.max(other.1))
    }
}

/// Bounds of one alternative.
#[derive(Debug, Clone, PartialEq)]
struct Allowed {
    longitude_deg: Span,
    latitude_deg: Span,
    time_s: Span,
    /// `None` allows every file.
    files: Option<BTreeSet<String>>,
}

impl Allowed {
    const ALL: Self = Self {
        longitude_deg: Span::ALL,
        latitude_deg: Span::ALL,
        time_s: Span::ALL,
        files: None,
    };

    fn both(&self, other: &Self) -> Self {
        let files = match (&self.files, &other.files) {
            (Some(files), Some(others)) => Some(files.intersection(others).cloned().collect()),
            (Some(files), None) | (None, Some(files)) => Some(files.clone()),
            (None, None) => None,
        };
        Self {
            longitude_deg: self.longitude_deg.both(other.longitude_deg),
            latitude_deg: self.latitude_deg.both(other.latitude_deg),
            time_s: self.time_s.both(other.time_s),
            files,
        }
    }

    fn hull(&self, other: &Self) -> Self {
        let files = match (&self.files, &other.files) {
            (Some(files), Some(others)) => Some(files.union(others).cloned().collect()),
            _ => None,
        };
        Self {
            longitude_deg: self.longitude_deg.hull(other.longitude_deg),
            latitude_deg: self.latitude_deg.hull(other.latitude_deg),
            time_s: self.time_s.hull(other.time_s),
            files,
        }
    }

    /// The window of longitudes and latitudes; `None` if it is empty.
    fn region(&self) -> Option<Region> {
        let within = |span: Span, least: f64, greatest: f64| {
            let wider = Span(span.0 - ROUNDING_DEG, span.1 + ROUNDING_DEG);
            let span = wider.both(Span(least, greatest));
            (span.0 < span.1).then(|| [span.0, span.1].map(|edge| edge * RADIANS_PER_DEGREE))
        };
        let [west_rad, east_rad] = within(self.longitude_deg, 0.0, 360.0)?;
        let [south_rad, north_rad] = within(self.latitude_deg, -90.0, 90.0)?;
        Some(Region::new(&WindowShape::Box {
            west_rad,
            east_rad,
            south_rad,
            north_rad,
        }))
    }
}

/// Bounds from conditions that must all hold: alternatives, of which a shot must meet one.
#[derive(Debug, Clone)]
pub(super) struct Conditions(Vec<Allowed>);

impl Conditions {
    /// Bounds from the conditions of a query.
    pub(super) fn of(conditions: &[Expr]) -> Self {
        let all = iter::once(Allowed::ALL).collect();
        Self(conditions.iter().fold(all, |allowed, condition| {
            both(&allowed, &alternatives(condition))
        }))
    }

    /// Whether a search can use a condition.
    pub(super) fn can_use(condition: &Expr) -> bool {
        alternatives(condition) != [Allowed::ALL]
    }

    /// The windows that may contain shots.
    pub(super) fn regions(&self) -> Vec<Region> {
        self.0.iter().filter_map(Allowed::region).collect()
    }

    /// The allowed time tags; `None` for any.
    pub(super) fn time(&self) -> Option<Interval> {
        let span = self.0.iter().map(|allowed| allowed.time_s);
        let Span(start, stop) = span.reduce(Span::hull)?;
        let at = |seconds| Et::from_seconds(seconds);
        (Span(start, stop) != Span::ALL)
            .then(|| Interval::new(at(start - ROUNDING_S), at(stop + ROUNDING_S)))
    }

    /// Whether the file of this name is allowed.
    pub(super) fn allow_file(&self, name: &str) -> bool {
        let allows =
            |allowed: &Allowed| (allowed.files.as_ref()).is_none_or(|files| files.contains(name));
        self.0.iter().any(allows)
    }
}

fn both(some: &[Allowed], others: &[Allowed]) -> Vec<Allowed> {
    let pairs = some
        .iter()
        .flat_map(|of| others.iter().map(|other| of.both(other)));
    few(pairs.collect())
}

/// Merges numerous alternatives.
fn few(alternatives: Vec<Allowed>) -> Vec<Allowed> {
    if alternatives.len() <= ALTERNATIVES_MAX {
        return alternatives;
    }
    let hull = alternatives.into_iter().reduce(|a, b| a.hull(&b));
    hull.into_iter().collect()
}

/// The alternatives that a condition allows.
fn alternatives(condition: &Expr) -> Vec<Allowed> {
    match condition {
        Expr::BinaryExpr(BinaryExpr { left, op, right }) => match op {
            Operator::And => both(&alternatives(left), &alternatives(right)),
            Operator::Or => {
                let either = [alternatives(left), alternatives(right)];
                few(either.into_iter().flatten().collect())
            }
            op => {
                let compared = match (&**left, &**right) {
                    (Expr::Column(column), Expr::Literal(value, _)) => Some((column, *op, value)),
                    (Expr::Literal(value, _), Expr::Column(column)) => {
                        op.swap().map(|op| (column, op, value))
                    }
                    _ => None,
                };
                let compared = compared.and_then(|(column, op, value)| compare(column, op, value));
                vec![compared.unwrap_or(Allowed::ALL)]
            }
        },
        Expr::Between(Between {
            expr,
            negated: false,
            low,
            high,
        }) => {
            let edge = |op: Operator, edge: &Expr| match (&**expr, edge) {
                (Expr::Column(column), Expr::Literal(value, _)) => compare(column, op, value),
                _ => None,
            };
            let above = edge(Operator::GtEq, low).unwrap_or(Allowed::ALL);
            let below = edge(Operator::LtEq, high).unwrap_or(Allowed::ALL);
            vec![above.both(&below)]
        }
        Expr::InList(InList {
            expr,
            list,
            negated: false,
        }) => {
            let each = list.iter().map(|item| match (&**expr, item) {
                (Expr::Column(column), Expr::Literal(value, _)) => {
                    compare(column, Operator::Eq, value)
                }
                _ => None,
            });
            few(each
                .map(|allowed| allowed.unwrap_or(Allowed::ALL))
                .collect())
        }
        _ => vec![Allowed::ALL],
    }
}

/// The bounds of `column op value`, if it implies any.
fn compare(column: &Column, op: Operator, value: &ScalarValue) -> Option<Allowed> {
    let mut allowed = Allowed::ALL;
    let name = column.name();
    if name == FILE {
        let text = value.try_as_str().flatten()?;
        allowed.files = (op == Operator::Eq).then(|| iter::once(text.to_owned()).collect());
        return Some(allowed);
    }
    let ScalarValue::Float64(Some(value)) = value
        .cast_to(&datafusion::arrow::datatypes::DataType::Float64)
        .ok()?
    else {
        return None;
    };
    let span = match op {
        Operator::Eq => Span(value, value),
        Operator::Lt | Operator::LtEq => Span(f64::NEG_INFINITY, value),
        Operator::Gt | Operator::GtEq => Span(value, f64::INFINITY),
        _ => Span::ALL,
    };
    match name {
        LONGITUDE => allowed.longitude_deg = span,
        LATITUDE => allowed.latitude_deg = span,
        name if TIMES.contains(&name) => allowed.time_s = span,
        _ => return None,
    }
    Some(allowed)
}

#[cfg(test)]
mod tests {
    use datafusion::prelude::{col, lit};

    use super::*;

    fn allowed(condition: Expr) -> Vec<Allowed> {
        Conditions::of(&[condition]).0
    }

    #[test]
    fn places_times_and_files_are_read_of_conditions() {
        let condition = col(LONGITUDE)
            .gt_eq(lit(10.0))
            .and(lit(12).gt(col(LONGITUDE)))
            .and(col(LATITUDE).between(lit(-5.0), lit(4.5)))
            .and(col("et_s").lt(lit(100.0)))
            .and(col("range_m").gt(lit(3.0)))
            .and(col(FILE).in_list(vec![lit("a.b"), lit("c.b")], false));
        let expected = |file: &str| Allowed {
            longitude_deg: Span(10.0, 12.0),
            latitude_deg: Span(-5.0, 4.5),
            time_s: Span(f64::NEG_INFINITY, 100.0),
            files: Some(iter::once(file.to_owned()).collect()),
        };
        assert_eq!(allowed(condition), [expected("a.b"), expected("c.b")]);
    }

    #[test]
    fn what_is_not_understood_allows_everything() {
        for condition in [
            col(LONGITUDE).not_eq(lit(10.0)),
            col(LONGITUDE).gt(col(LATITUDE)),
            col(LONGITUDE).not_between(lit(1.0), lit(2.0)),
            col(FILE).in_list(vec![lit("a.b")], true),
            col(FILE).not_eq(lit("a.b")),
            (col(LONGITUDE) + lit(1.0)).gt(lit(2.0)),
            col(LATITUDE).gt(lit(1.0)).or(col("range_m").gt(lit(3.0))),
            !col(LATITUDE).gt(lit(1.0)),
        ] {
            let open = Conditions::of(std::slice::from_ref(&condition));
            assert!(open.allow_file("other.b"), "{condition}");
            assert!(open.0.contains(&Allowed::ALL), "{condition}");
        }
    }

    #[test]
    fn alternatives_are_windows_of_their_own_and_many_are_one() {
        let band = |south: f64| col(LATITUDE).between(lit(south), lit(south + 0.1));
        let two = band(-80.0).or(band(80.0));
        assert_eq!(Conditions::of(&[two]).regions().len(), 2);
        let many = (0..70).map(|south| band(f64::from(south)));
        let many = Conditions::of(&[many.reduce(Expr::or).unwrap()]);
        assert!(many.regions().len() <= ALTERNATIVES_MAX);
        let all = many.0.iter().map(|allowed| allowed.latitude_deg);
        assert_eq!(all.reduce(Span::hull), Some(Span(0.0, 69.0 + 0.1)));
        let none = col(LATITUDE).gt(lit(10.0)).and(col(LATITUDE).lt(lit(9.0)));
        assert!(Conditions::of(&[none]).regions().is_empty());
    }
}
