//! Nets without a solution are refused by name.

use areograph::geom::plane::{
    Measurement, Net, Place, PlaneError, brick, find_mirrored, grow_bricks, solve,
};

use super::{TERTIARY, nine};

fn failure(net: &Net) -> PlaneError {
    solve(net).unwrap_err()
}

#[test]
fn pictures_without_two_ties_are_named() {
    let mut net = nine(0.0).simulate(1).net;
    // Picture 4, in the middle, keeps one tie.
    let shared = |net: &Net, point: usize| {
        net.measurements
            .iter()
            .filter(|of| of.point == point)
            .count()
            > 1
    };
    let given: Vec<usize> = net.controls.iter().map(|control| control.point).collect();
    let tie = net
        .measurements
        .iter()
        .find(|of| of.picture == 4 && shared(&net, of.point))
        .unwrap()
        .point;
    net.measurements
        .retain(|of| of.picture != 4 || of.point == tie);
    net.controls.retain(|control| control.point != tie);
    assert!(!given.is_empty());
    assert_eq!(
        failure(&net),
        PlaneError::UnderconnectedPicture {
            picture: 4,
            ties: 1
        }
    );
}

#[test]
fn a_part_that_hangs_on_one_point_is_named() {
    // Two columns and the third tied to them by one point alone.
    let scene = nine(0.0).simulate(1);
    let mut net = scene.net.clone();
    let east = |picture: usize| picture % 3 == 2;
    let both = |net: &Net, point: usize| {
        let of = || net.measurements.iter().filter(move |of| of.point == point);
        of().any(|of| east(of.picture)) && of().any(|of| !east(of.picture))
    };
    let hinge = (0..net.points).find(|point| both(&net, *point)).unwrap();
    let whole = net.clone();
    net.measurements
        .retain(|of| !east(of.picture) || of.point == hinge || !both(&whole, of.point));
    let eastern = |point: usize| {
        net.measurements
            .iter()
            .any(|of| of.point == point && east(of.picture))
    };
    net.controls.retain(|control| !eastern(control.point));
    let PlaneError::UnderconnectedPicture { picture, .. } = failure(&net) else {
        unreachable!("another failure");
    };
    assert!(east(picture), "{picture}");
    // Without the hinge the part has no control at all.
    net.measurements
        .retain(|of| of.point != hinge || !east(of.picture));
    let PlaneError::UnderconnectedPicture { picture, .. } = failure(&net) else {
        unreachable!("another failure");
    };
    assert!(east(picture), "{picture}");
}

#[test]
fn one_control_is_too_few_and_equal_places_are_named() {
    let scene = nine(0.0).simulate(2);
    let mut net = scene.net.clone();
    net.controls.truncate(1);
    assert_eq!(failure(&net), PlaneError::TooFewControls { found: 1 });
    let mut net = scene.net.clone();
    net.controls[3].at = net.controls[1].at;
    let (a, b) = (net.controls[1].point, net.controls[3].point);
    let (first, second) = (a.min(b), a.max(b));
    assert_eq!(failure(&net), PlaneError::EqualControls { first, second });
    let mut net = scene.net;
    let of_first: Vec<usize> = (0..net.measurements.len())
        .filter(|index| net.measurements[*index].picture == 0)
        .collect();
    let (one, two) = (of_first[2], of_first[5]);
    net.measurements[two].at = net.measurements[one].at;
    let pair = [one, two].map(|index| net.measurements[index].point);
    let (first, second) = (pair[0].min(pair[1]), pair[0].max(pair[1]));
    assert_eq!(
        failure(&net),
        PlaneError::EqualPoints {
            picture: 0,
            first,
            second
        }
    );
}

#[test]
fn a_mirrored_picture_is_told_from_its_neighbours() {
    let scene = nine(250.0).simulate(3);
    assert_eq!(find_mirrored(&scene.net), Ok(()));
    for wrong in 0..9 {
        let mut net = scene.net.clone();
        for measured in net.measurements.iter_mut().filter(|of| of.picture == wrong) {
            measured.at = measured.at.conj();
        }
        assert_eq!(
            find_mirrored(&net),
            Err(PlaneError::MirroredPicture { picture: wrong })
        );
    }
    // Two points in common do not tell the hand.
    let two = Net {
        pictures: 2,
        points: 2,
        measurements: (0..4)
            .map(|index| Measurement {
                picture: index / 2,
                point: index % 2,
                at: Place::new(index as f64, 1.0),
            })
            .collect(),
        controls: Vec::new(),
    };
    assert_eq!(find_mirrored(&two), Ok(()));
}

#[test]
fn bricks_hang_together_whatever_the_size() {
    for size in [6, 8, 10] {
        let scene = TERTIARY.simulate(1);
        let of = grow_bricks(&scene.net, size);
        let count = of.iter().max().unwrap() + 1;
        assert!((2..=6).contains(&count), "{count} bricks of {size}");
        for wanted in 0..count {
            let pictures: Vec<usize> = (0..25).filter(|picture| of[*picture] == wanted).collect();
            assert!(
                pictures.len() >= size / 2 && pictures.len() <= size + size / 2,
                "{pictures:?}"
            );
            brick(&scene.net, &pictures).unwrap();
        }
    }
}

#[test]
fn a_brick_in_two_pieces_names_the_picture_in_the_net() {
    let scene = TERTIARY.simulate(1);
    // Opposite corners, and neighbours of one of them.
    let failure = brick(&scene.net, &[0, 1, 5, 24]).unwrap_err();
    assert_eq!(
        failure,
        PlaneError::UnderconnectedPicture {
            picture: 24,
            ties: 0
        }
    );
}
