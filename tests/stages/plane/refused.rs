//! Nets without a solution are refused by name.

use areograph::geom::plane::{
    Control, Measurement, Moved, Net, Place, PlaneError, brick, find_mirrored, grow_bricks,
    same_hand, settle_bricks, solve,
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
    let PlaneError::UnderconnectedPicture { picture, ties } = failure(&net) else {
        unreachable!("another failure");
    };
    assert!(east(picture), "{picture}");
    // The points that the pictures of a part share among themselves do not count: at most the hinge and one point
    // that leads to the rest of the column hold it.
    assert!((1..=2).contains(&ties), "{ties}");
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

/// Noise keeps the equations of a part that hangs on one point from being singular; the part is named all the same.
#[test]
fn a_part_that_hangs_on_one_point_is_named_in_spite_of_noise() {
    let scene = nine(250.0).simulate(1);
    let mut net = scene.net.clone();
    let east = |picture: usize| picture % 3 == 2;
    let views = |point: usize| {
        let of = scene.net.measurements.iter();
        of.filter(move |of| of.point == point).map(|of| of.picture)
    };
    let both = |point: usize| views(point).any(east) && views(point).any(|of| !east(of));
    let hinge = (0..net.points).find(|point| both(*point)).unwrap();
    net.measurements
        .retain(|of| !east(of.picture) || of.point == hinge || !both(of.point));
    let eastern = |point: usize| views(point).any(east);
    net.controls.retain(|control| !eastern(control.point));
    let PlaneError::UnderconnectedPicture { picture, ties } = failure(&net) else {
        unreachable!("another failure");
    };
    assert!(east(picture), "{picture}");
    assert!((1..=2).contains(&ties), "{ties}");
}

/// Four pictures of which every two share one point are rigid, though no two share more.
#[test]
fn pictures_that_hold_each_other_by_single_points_are_solved() {
    let at = |point: usize| Place::new((point * point % 11) as f64, (3 * point % 5) as f64);
    let mut net = Net {
        pictures: 4,
        points: 7,
        ..Net::default()
    };
    let mut point = 0;
    for one in 0..4 {
        for two in one + 1..4 {
            for picture in [one, two] {
                let at = at(point);
                net.measurements.push(Measurement { picture, point, at });
            }
            point += 1;
        }
    }
    // The first picture has a second control.
    net.measurements.push(Measurement {
        picture: 0,
        point: 6,
        at: at(6),
    });
    for point in [0, 6] {
        net.controls.push(Control {
            point,
            at: at(point),
            weight: 1.0,
        });
    }
    let solution = solve(&net).unwrap();
    for similarity in solution.pictures {
        // Exact data leave rounding.
        assert!(
            (similarity.turn - Place::new(1.0, 0.0)).norm() < 1e-9,
            "{similarity:?}"
        );
    }
}

/// Three points that two pictures have in common, one of them wrong, may fit a mirror image better: other pictures outvote
/// them.
#[test]
fn a_wrong_point_does_not_mirror_a_picture() {
    // Errors of a hundredth of a unit, over pictures of ten.
    let place = |picture: usize, point: usize| {
        let noise = |of: usize| 0.01 * ((of * 37 % 17) as f64 / 8.0 - 1.0);
        Place::new((7 * point % 11) as f64, (5 * point % 13) as f64)
            + Place::new(noise(3 * point + picture), noise(5 * point + 2 * picture))
    };
    let mut net = Net {
        pictures: 3,
        points: 20,
        ..Net::default()
    };
    let mut measure = |picture: usize, points: std::ops::Range<usize>| {
        for point in points {
            let at = place(picture, point);
            net.measurements.push(Measurement { picture, point, at });
        }
    };
    // Twelve points in the first two pictures, of the third picture three in the first and five in the second.
    measure(0, 0..15);
    measure(1, 0..12);
    measure(1, 15..20);
    measure(2, 12..20);
    assert_eq!(find_mirrored(&net), Ok(()));
    // Point 12 as a mirror at the line of points 13 and 14 has it.
    let (foot, along) = (place(2, 13), place(2, 14) - place(2, 13));
    for measured in &mut net.measurements {
        if (measured.picture, measured.point) == (2, 12) {
            measured.at = foot + ((measured.at - foot) / along).conj() * along;
        }
    }
    let pair: Vec<(Place, Place)> = (12..15)
        .map(|point| {
            let of = |picture: usize| {
                let of = net.measurements.iter();
                let mut of = of.filter(|of| (of.picture, of.point) == (picture, point));
                of.next().unwrap().at
            };
            (of(0), of(2))
        })
        .collect();
    assert_eq!(same_hand(&pair), Some(false));
    assert_eq!(find_mirrored(&net), Ok(()));
    // Without the second picture nothing speaks for the third.
    net.measurements.retain(|of| of.picture != 1);
    assert_eq!(
        find_mirrored(&net),
        Err(PlaneError::MirroredPicture { picture: 2 })
    );
}

/// A picture that hangs on one point in its brick is tied in the brick that holds it.
#[test]
fn a_picture_that_hangs_on_one_point_is_tied_in_another_brick() {
    let scene = TERTIARY.simulate(1);
    let mut net = scene.net.clone();
    // The column of pictures 4, 9, …, 24 is a brick; the last keeps one point of it.
    let mut bricks = vec![
        (0..25).filter(|of| of % 5 != 4).collect::<Vec<_>>(),
        (0..25).filter(|of| of % 5 == 4).collect(),
    ];
    let of_brick: Vec<usize> = net
        .measurements
        .iter()
        .filter(|of| [14, 19].contains(&of.picture))
        .map(|of| of.point)
        .collect();
    let mut first = None;
    net.measurements.retain(|of| {
        let common = of.picture == 24 && of_brick.contains(&of.point);
        !common || *first.get_or_insert(of.point) == of.point
    });
    let pictures = bricks[1].clone();
    assert!(matches!(
        brick(&net, &pictures),
        Err(PlaneError::UnderconnectedPicture { picture: 24, .. })
    ));
    let moved = settle_bricks(&net, &mut bricks);
    let (picture, from, to) = (24, 1, 0);
    assert_eq!(moved, [Moved { picture, from, to }]);
    for pictures in &bricks {
        brick(&net, pictures).unwrap();
    }
}
