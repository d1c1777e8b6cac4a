//! The map of sites against known ground.

use base64::{Engine as _, engine::general_purpose::STANDARD};

use super::*;

/// The numbers of an attribute of every such element of an SVG.
fn numbers(svg: &str, element: &str, attribute: &str) -> Vec<f64> {
    let start = format!("<{element} ");
    let elements = svg.split(&start).skip(1);
    let value = |of: &str| {
        let text = of.split(&format!("{attribute}=\"")).nth(1)?;
        text.split('"').next()?.parse().ok()
    };
    elements.filter_map(value).collect()
}

/// The brightness of the drawn ground under the mark of a site there, as a share of the cells that are darker.
fn share_darker(longitude_deg: f64, latitude_deg: f64) -> f64 {
    let site = Place {
        name: "site",
        tone: Tone::Good,
        place_deg: (longitude_deg, latitude_deg),
    };
    let svg = figure(Body::Mars, &[site], "").unwrap().0;
    let picture = svg.split("base64,").nth(1).unwrap();
    let picture = STANDARD.decode(picture.split('"').next().unwrap()).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(picture))
        .read_info()
        .unwrap();
    let mut greys = vec![0; reader.output_buffer_size().unwrap()];
    let size = reader.next_frame(&mut greys).unwrap();
    let [x, y, width, height] =
        ["x", "y", "width", "height"].map(|name| numbers(&svg, "image", name)[0]);
    // The last circle is the mark of the site, above its edge and the rings of landing sites.
    let [right, down] = ["cx", "cy"].map(|name| *numbers(&svg, "circle", name).last().unwrap());
    let cell = |share: f64, count: u32| (share * f64::from(count)) as usize;
    let (column, row) = (
        cell((right - x) / width, size.width),
        cell((down - y) / height, size.height),
    );
    let grey = greys[row * size.width as usize + column];
    let darker = greys.iter().filter(|of| **of < grey).count();
    darker as f64 / greys.len() as f64
}

/// Summits and plains by the IAU gazetteer. Where the map were mirrored or turned by half, other ground would lie there.
#[test]
fn sites_on_summits_lie_on_light_ground_and_sites_on_plains_on_dark_ground() {
    for (name, longitude_deg, latitude_deg) in [
        ("Olympus Mons", 226.2, 18.65),
        ("Ascraeus Mons", 255.9, 11.9),
        ("Arsia Mons", 239.1, -8.3),
    ] {
        let share = share_darker(longitude_deg, latitude_deg);
        assert!(share > 0.98, "{name}: {share}");
        for other_deg in [360.0 - longitude_deg, longitude_deg - 180.0] {
            let other = share_darker(other_deg, latitude_deg);
            assert!(other < 0.95, "{name}, {other_deg}: {other}");
        }
    }
    for (name, longitude_deg, latitude_deg) in [
        ("Hellas Planitia", 70.5, -42.4),
        ("Utopia Planitia", 117.5, 46.7),
    ] {
        let share = share_darker(longitude_deg, latitude_deg);
        assert!(share < 0.15, "{name}: {share}");
        for other_deg in [360.0 - longitude_deg, longitude_deg + 180.0] {
            let other = share_darker(other_deg, latitude_deg);
            assert!(other > 0.3, "{name}, {other_deg}: {other}");
        }
    }
}

#[test]
fn the_moon_has_no_ground_of_mars() {
    let site = || Place {
        name: "site",
        tone: Tone::Good,
        place_deg: (10.0, 10.0),
    };
    assert!(
        figure(Body::Mars, &[site()], "")
            .unwrap()
            .0
            .contains("MEGDR")
    );
    let moon = figure(Body::Moon, &[site()], "").unwrap().0;
    assert!(!moon.contains("<image") && !moon.contains("MEGDR"));
    assert!(moon.contains("with their extent"));
}

#[test]
fn features_end_at_the_edge_and_go_on_at_the_other() {
    let feature = Feature {
        body: Body::Mars,
        name: "",
        place_deg: (350.0, 0.0),
        kind: Kind::Landing,
    };
    let rings = outline(&feature, [40.0, 20.0]);
    assert_eq!(rings.len(), 2);
    let across = |ring: &[(i32, i32)]| {
        let columns = || ring.iter().map(|(x, _)| *x);
        (columns().min().unwrap(), columns().max().unwrap())
    };
    let [west, east] = [&rings[0], &rings[1]].map(|ring| across(ring));
    // From 330° to the right edge, and from the left edge to 10°.
    assert_eq!(west.0, LEFT);
    assert_eq!(west.1, pixel((10.0, 0.0)).0);
    assert_eq!(east, (pixel((330.0, 0.0)).0, LEFT + MAP_WIDTH));
}

#[test]
fn sites_in_one_place_are_all_named_and_features_give_way() {
    let site = |place_deg: (f64, f64)| Place {
        name: "gusev_crater",
        tone: Tone::Good,
        place_deg,
    };
    // Ten around where Spirit landed, and two at the edges.
    let mut places: Vec<Place> = (0..10)
        .map(|k| site((175.0 + 0.1 * f64::from(k), -14.6)))
        .collect();
    places.extend([site((0.0, 89.0)), site((359.9, -89.0))]);
    let features: Vec<&Feature> = FEATURES.iter().filter(|of| of.body == Body::Mars).collect();
    let (names, unnamed) = names(&places, &features);
    assert_eq!(unnamed, Vec::<&str>::new());
    let named = names.placed.len() - places.len();
    assert!(named >= features.len() / 4, "{named}");
}
