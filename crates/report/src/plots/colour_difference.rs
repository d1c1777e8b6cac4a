//! Visible difference of two colours.

/// The CIEDE2000 difference of two colours in CIELAB.
///
/// # Source
/// Sharma, Wu and Dalal 2005, Color Res. Appl. 30, eq. 2 to 22.
pub(super) fn ciede2000(one: [f64; 3], other: [f64; 3]) -> f64 {
    let chroma = |[_, a, b]: [f64; 3]| f64::hypot(a, b);
    // Weight of chromas that are large against 25.
    let large = |chroma: f64| (chroma.powi(7) / (chroma.powi(7) + 25.0_f64.powi(7))).sqrt();
    let stretch = 1.5 - 0.5 * large(f64::midpoint(chroma(one), chroma(other)));
    let polar = |[lightness, a, b]: [f64; 3]| {
        let a = stretch * a;
        let hue = b.atan2(a).to_degrees().rem_euclid(360.0);
        (lightness, a.hypot(b), hue)
    };
    let ((light_1, chroma_1, hue_1), (light_2, chroma_2, hue_2)) = (polar(one), polar(other));
    let is_grey = chroma_1 * chroma_2 == 0.0;
    // The shorter way round, and the middle of it.
    let turn = match hue_2 - hue_1 {
        _ if is_grey => 0.0,
        turn if turn > 180.0 => turn - 360.0,
        turn if turn < -180.0 => turn + 360.0,
        turn => turn,
    };
    let hue = match hue_1 + hue_2 {
        sum if is_grey => sum,
        sum if (hue_1 - hue_2).abs() <= 180.0 => 0.5 * sum,
        sum if sum < 360.0 => 0.5 * (sum + 360.0),
        sum => 0.5 * (sum - 360.0),
    };
    let (light, chroma) = (
        f64::midpoint(light_1, light_2),
        f64::midpoint(chroma_1, chroma_2),
    );
    let wave = |times: f64, phase: f64| (times * hue + phase).to_radians().cos();
    let weight = 1.0 - 0.17 * wave(1.0, -30.0) + 0.24 * wave(2.0, 0.0) + 0.32 * wave(3.0, 6.0)
        - 0.20 * wave(4.0, -63.0);
    let off_middle = (light - 50.0).powi(2);
    let by_light = (light_2 - light_1) / (1.0 + 0.015 * off_middle / (20.0 + off_middle).sqrt());
    let by_chroma = (chroma_2 - chroma_1) / (1.0 + 0.045 * chroma);
    let way = 2.0 * (chroma_1 * chroma_2).sqrt() * (0.5 * turn).to_radians().sin();
    let by_hue = way / (1.0 + 0.015 * chroma * weight);
    let rotation = 60.0 * (-((hue - 275.0) / 25.0).powi(2)).exp();
    let crossed = -2.0 * large(chroma) * rotation.to_radians().sin() * by_chroma * by_hue;
    (by_light.powi(2) + by_chroma.powi(2) + by_hue.powi(2) + crossed).sqrt()
}

/// Two colours in CIELAB, and their difference.
///
/// # Source
/// Sharma, Wu and Dalal 2005, table 1.
const PUBLISHED: [[f64; 7]; 34] = [
    [50.0, 2.677_2, -79.775_1, 50.0, 0.0, -82.748_5, 2.042_5],
    [50.0, 3.157_1, -77.280_3, 50.0, 0.0, -82.748_5, 2.861_5],
    [50.0, 2.836_1, -74.02, 50.0, 0.0, -82.748_5, 3.441_2],
    [50.0, -1.380_2, -84.281_4, 50.0, 0.0, -82.748_5, 1.0],
    [50.0, -1.184_8, -84.800_6, 50.0, 0.0, -82.748_5, 1.0],
    [50.0, -0.900_9, -85.521_1, 50.0, 0.0, -82.748_5, 1.0],
    [50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.366_9],
    [50.0, -1.0, 2.0, 50.0, 0.0, 0.0, 2.366_9],
    [50.0, 2.49, -0.001, 50.0, -2.49, 0.000_9, 7.179_2],
    [50.0, 2.49, -0.001, 50.0, -2.49, 0.001, 7.179_2],
    [50.0, 2.49, -0.001, 50.0, -2.49, 0.001_1, 7.219_5],
    [50.0, 2.49, -0.001, 50.0, -2.49, 0.001_2, 7.219_5],
    [50.0, -0.001, 2.49, 50.0, 0.000_9, -2.49, 4.804_5],
    [50.0, -0.001, 2.49, 50.0, 0.001, -2.49, 4.804_5],
    [50.0, -0.001, 2.49, 50.0, 0.001_1, -2.49, 4.746_1],
    [50.0, 2.5, 0.0, 50.0, 0.0, -2.5, 4.306_5],
    [50.0, 2.5, 0.0, 73.0, 25.0, -18.0, 27.149_2],
    [50.0, 2.5, 0.0, 61.0, -5.0, 29.0, 22.897_7],
    [50.0, 2.5, 0.0, 56.0, -27.0, -3.0, 31.903],
    [50.0, 2.5, 0.0, 58.0, 24.0, 15.0, 19.453_5],
    [50.0, 2.5, 0.0, 50.0, 3.173_6, 0.585_4, 1.0],
    [50.0, 2.5, 0.0, 50.0, 3.297_2, 0.0, 1.0],
    [50.0, 2.5, 0.0, 50.0, 1.863_4, 0.575_7, 1.0],
    [50.0, 2.5, 0.0, 50.0, 3.259_2, 0.335, 1.0],
    [
        60.257_4, -34.009_9, 36.267_7, 60.462_6, -34.175_1, 39.438_7, 1.264_4,
    ],
    [
        63.010_9, -31.096_1, -5.866_3, 62.818_7, -29.794_6, -4.086_4, 1.263,
    ],
    [
        61.290_1, 3.719_6, -5.390_1, 61.429_2, 2.248, -4.962, 1.873_1,
    ],
    [
        35.083_1, -44.116_4, 3.793_3, 35.023_2, -40.071_6, 1.590_1, 1.864_5,
    ],
    [
        22.723_3, 20.090_4, -46.694, 23.033_1, 14.973, -42.561_9, 2.037_3,
    ],
    [
        36.461_2, 47.858, 18.385_2, 36.271_5, 50.506_5, 21.223_1, 1.414_6,
    ],
    [
        90.802_7, -2.083_1, 1.441, 91.152_8, -1.643_5, 0.044_7, 1.444_1,
    ],
    [
        90.925_7, -0.540_6, -0.920_8, 88.638_1, -0.898_5, -0.723_9, 1.538_1,
    ],
    [
        6.774_7, -0.290_8, -2.424_7, 5.871_4, -0.098_5, -2.228_6, 0.637_7,
    ],
    [
        2.077_6, 0.079_5, -1.135, 0.903_3, -0.063_6, -0.551_4, 0.908_2,
    ],
];

#[test]
fn published_pairs_have_their_published_differences() {
    for [l1, a1, b1, l2, a2, b2, published] in PUBLISHED {
        let (one, other) = ([l1, a1, b1], [l2, a2, b2]);
        for found in [ciede2000(one, other), ciede2000(other, one)] {
            // Half a unit of the last published digit, and rounding.
            assert!(
                (found - published).abs() < 0.51e-4,
                "{one:?} {other:?}: {found}"
            );
        }
    }
}
