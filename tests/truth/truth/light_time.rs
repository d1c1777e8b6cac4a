//! What a wrong light-time convention does to the adjusted ground, against the truth.

use nalgebra::Vector3;

use super::{
    Judged,
    common::{
        case::Case,
        mission::{mission, succeed},
    },
};

/// Mean error of the pair's tie points before and after the adjustment, metres: heights before; east, north, up after.
fn errors_m(light_time: &str) -> (f64, Vector3<f64>) {
    let case = Case::pair();
    let site = String::from_utf8(case.read("site.toml")).unwrap();
    let keys = format!("[orientation]\nlight_time = \"{light_time}\"\n");
    case.write("site.toml", format!("{site}\n{keys}"));
    succeed(&mut case.run());
    let judged = Judged::of(&mission(), &case.path("out"), "isidis");
    (judged.before_m, judged.mean_m())
}

/// An adjustment cannot tell: the place moves along the flight by what MGS flies in the light time, as if the lines had
/// been exposed so much later, and heights stay. From the centre of Mars heights are off before it by a hundred metres.
#[test]
fn a_wrong_convention_moves_places_and_no_heights() {
    let (before_m, surface_m) = errors_m("surface");
    let (none_before_m, none_m) = errors_m("none");
    let (centre_before_m, centre_m) = errors_m("centre");
    println!("surface {surface_m:.2?}, none {none_m:.2?}, centre {centre_m:.2?}");
    let (by_none_m, by_centre_m) = (none_m - surface_m, centre_m - surface_m);
    // 1.27 and 1.30 ms of 3.395 km/s to the north: 4.3 and 4.4 m.
    assert!((by_none_m.xy().norm() - 4.35).abs() < 0.15, "{by_none_m}");
    assert!(by_none_m.y > 4.0 && by_none_m.z.abs() < 0.1, "{by_none_m}");
    assert!((none_before_m - before_m).abs() < 0.5);
    assert!(
        (30.0..50.0).contains(&by_centre_m.xy().norm()),
        "{by_centre_m}"
    );
    assert!(by_centre_m.z.abs() < 0.5, "{by_centre_m}");
    assert!(
        centre_before_m - before_m > 100.0,
        "{centre_before_m} {before_m}"
    );
}
