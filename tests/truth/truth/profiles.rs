//! Horizontal position from the relief under many profiles: stated standard deviations against truth by the number of passes.
//!
//! The long run writes the page with `SNAPSHOTS=overwrite`.

use std::fmt::Write as _;

use areograph::scene::Roughness;

use super::{
    by_chance,
    common::{kept, long},
    flown::{Plan, Site, Stated, flown},
};

const PAGE: &str = "docs/guide/src/position_by_profiles.md";
const INTRODUCTION: &str = include_str!("profiles/introduction.md");
/// Further passes over a window 0.5° wide.
const PASSES: [u32; 3] = [0, 24, 60];
const GROUNDS: [(&str, Roughness); 3] = [
    ("5 m", Roughness::Plains),
    ("10 m", Roughness::Medium),
    ("25 m", Roughness::Rough),
];
const NOISES_PX: [f64; 4] = [0.2, 0.5, 1.0, 0.3];
/// Missions for each number of passes and each ground: three sites each.
const MISSIONS: u32 = 3;
const FIRST_SEED: u32 = 110_001;

/// Errors of the mean of a site's tie points with their stated standard deviations, on one axis.
pub(super) struct Axis {
    errors_m: Vec<f64>,
    sigmas_m: Vec<f64>,
}

impl Axis {
    pub(super) fn of(sites: &[&Stated], axis: usize) -> Self {
        let means = sites.iter().map(|site| site.ties.shared);
        Self {
            errors_m: means.clone().map(|[error_m, _]| error_m[axis]).collect(),
            sigmas_m: means.map(|[_, sigma_m]| sigma_m[axis]).collect(),
        }
    }

    pub(super) fn z(&self) -> impl Iterator<Item = f64> + '_ {
        let pairs = self.errors_m.iter().zip(&self.sigmas_m);
        pairs.map(|(error_m, sigma_m)| error_m / sigma_m)
    }

    pub(super) fn ratio(&self) -> f64 {
        (self.z().map(|z| z * z).sum::<f64>() / self.errors_m.len() as f64).sqrt()
    }

    pub(super) fn rms_m(&self) -> f64 {
        let squares = self.errors_m.iter().map(|error_m| error_m * error_m);
        (squares.sum::<f64>() / self.errors_m.len() as f64).sqrt()
    }

    pub(super) fn median_sigma_m(&self) -> f64 {
        let mut sigmas_m = self.sigmas_m.clone();
        sigmas_m.sort_by(f64::total_cmp);
        sigmas_m[sigmas_m.len() / 2]
    }

    pub(super) fn beyond(&self) -> usize {
        self.z().filter(|z| z.abs() > 3.0).count()
    }
}

/// Missions with one number of passes over one ground.
struct Row {
    passes: u32,
    ground: &'static str,
    sites: Vec<Site>,
}

impl Row {
    fn flown(passes: u32, index: usize, missions: u32) -> Self {
        let (ground, roughness) = GROUNDS[index];
        let plans: Vec<Plan<'_>> = (0..missions)
            .zip(NOISES_PX.into_iter().cycle())
            .map(|(mission, noise_px)| {
                let number = mission + MISSIONS * u32::try_from(index).unwrap();
                Plan {
                    passes,
                    ties_at_shots: true,
                    ..Plan::drawn(FIRST_SEED + 100 * passes + number, roughness, noise_px)
                }
            })
            .collect();
        Self {
            passes,
            ground,
            sites: flown(&plans),
        }
    }

    fn valid(&self) -> Vec<&Stated> {
        let valid = self.sites.iter().filter(|site| site.is_valid());
        valid.filter_map(|site| site.stated.as_ref()).collect()
    }

    fn axes(&self) -> [Axis; 3] {
        let valid = self.valid();
        [0, 1, 2].map(|axis| Axis::of(&valid, axis))
    }

    fn line(&self) -> String {
        let valid = self.valid().len();
        let mut line = format!(
            "| {} | {} | {valid} of {} |",
            self.passes,
            self.ground,
            self.sites.len()
        );
        for (axis, digits) in self.axes().iter().zip([0, 0, 1]) {
            let _infallible = write!(
                line,
                " {:.digits$} m, {:.digits$} m, {:.2} |",
                axis.rms_m(),
                axis.median_sigma_m(),
                axis.ratio()
            );
        }
        let beyond: usize = self.axes().iter().map(Axis::beyond).sum();
        line + &format!(" {beyond} |")
    }
}

/// Sum of counts over sites.
fn counts(rows: &[Row], kind: usize) -> [usize; 2] {
    let sites = rows.iter().flat_map(|row| &row.sites);
    sites.fold([0; 2], |[all, rejected], site| {
        let [more, of_them] = site.further[kind];
        [all + more, rejected + of_them]
    })
}

/// Prints the sites with an error beyond three standard deviations, and the invalid ones.
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn print_remarkable(rows: &[Row]) {
    for site in rows.iter().flat_map(|row| &row.sites) {
        let mean = site.stated.as_ref().map(|of| of.ties.shared);
        let is_beyond = mean
            .is_some_and(|[error_m, sigma_m]| error_m.component_div(&sigma_m).abs().max() > 3.0);
        if is_beyond || !site.is_valid() {
            println!(
                "{}: {mean:.1?}, misplaced {}, further {:?}, {}",
                site.name,
                site.has_misplaced_profile,
                site.further,
                site.list("reasons")
            );
        }
    }
}

#[test]
#[allow(clippy::print_stdout, reason = "what was measured is worth reading")]
fn the_position_by_the_relief_under_many_profiles_holds() {
    let rows: Vec<Row> = if long() {
        let grounds = 0..GROUNDS.len();
        let of_passes = |passes: &u32| {
            let passes = *passes;
            grounds.clone().map(move |ground| (passes, ground))
        };
        let rows = PASSES.iter().flat_map(of_passes);
        rows.map(|(passes, ground)| Row::flown(passes, ground, MISSIONS))
            .collect()
    } else {
        vec![Row::flown(24, 1, 1)]
    };
    let mut page = INTRODUCTION.to_owned();
    for row in &rows {
        page += &row.line();
        page += "\n";
    }
    let [misplaced, found] = counts(&rows, 0);
    let [placed, refused] = counts(&rows, 1);
    let all = || rows.iter().flat_map(|row| &row.sites);
    let invalid = |is_misplaced: bool| {
        let of_kind = all().filter(|site| site.has_misplaced_profile == is_misplaced);
        of_kind.filter(|site| !site.is_valid()).count()
    };
    let (sites, with_misplaced) = (
        all().count(),
        all().filter(|site| site.has_misplaced_profile).count(),
    );
    let (invalid, others) = (invalid(true), invalid(false));
    let _infallible = writeln!(
        page,
        "\nOf {with_misplaced} sites in which a profile simultaneous with an image is misplaced, {invalid} were invalid; of the other {} sites, \
         {others} were.\nOf {misplaced} further passes misplaced by 0.5 to 2 km, {found} were identified at crossovers; of {placed} others, \
         {refused} were rejected.",
        sites - with_misplaced
    );
    println!("{page}");
    print_remarkable(&rows);
    let (mut beyond, mut valid) = ([0; 2], 0);
    for (axis, name) in ["east", "north", "up"].into_iter().enumerate() {
        let z: Vec<f64> = rows
            .iter()
            .flat_map(|row| row.axes()[axis].z().collect::<Vec<_>>())
            .collect();
        let pooled = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
        // Sizes are drawn for a mission: of few missions all may be small.
        let [_, most] = by_chance(z.len());
        let least = if long() { 0.7 } else { 0.0 };
        assert!(
            pooled > least && pooled < most.max(1.25),
            "{name}: {pooled}"
        );
        beyond[usize::from(axis == 2)] += z.iter().filter(|z| z.abs() > 3.0).count();
        valid = z.len();
    }
    // Of both axes in plan, one in a hundred, and one more: a misplaced profile that crossovers do not show displaces a site. Heights
    // of the sites of a mission share the errors of its camera.
    let [in_plan, in_height] = beyond;
    assert!(
        100 * in_plan.saturating_sub(1) <= 2 * valid,
        "{in_plan} in plan beyond 3 sigma"
    );
    assert!(
        25 * in_height <= valid.max(25),
        "{in_height} heights beyond 3 sigma"
    );
    for (axis, name) in ["east", "north", "height"].into_iter().enumerate() {
        let shifts = rows.iter().flat_map(|row| &row.sites);
        let z: Vec<f64> = shifts
            .flat_map(|site| site.shifts.iter().map(|z| z[axis]))
            .collect();
        let pooled = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
        println!("shifts by crossovers, {name}: {pooled:.2} of {}", z.len());
        // A mission draws a scatter of 50 to 100 m; 70 m are assumed.
        assert!(
            (0.6..1.5).contains(&pooled) && z.len() > 30,
            "{name}: {pooled}"
        );
    }
    // A shift of 250 m, 3.5 assumed standard deviations, looks like another place.
    assert!(100 * refused <= placed.max(100), "{refused} of {placed}");
    if long() {
        // Profiles near the edge of the window cross few others.
        assert!(10 * found >= 7 * misplaced, "{found} of {misplaced}");
        assert!(20 * others <= sites, "{others} of {sites}");
        let of_many: Vec<&Row> = rows.iter().filter(|row| row.passes == 60).collect();
        for row in of_many.iter().filter(|row| row.ground != "5 m") {
            let (axes, name) = (row.axes(), row.ground);
            for axis in &axes[..2] {
                let sigma_m = axis.median_sigma_m();
                assert!(sigma_m < 55.0, "{name}: {sigma_m} m");
            }
        }
        kept::is_up_to_date(PAGE, &page);
    }
}
