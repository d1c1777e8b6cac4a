//! Well-known features of a body, for orientation on the map of sites.

use areograph_base::body::Body;

/// A large feature or a landing site.
pub(super) struct Feature {
    pub(super) body: Body,
    pub(super) name: &'static str,
    /// East longitude, 0 to 360, and areocentric (selenocentric) latitude of its middle, degrees.
    pub(super) place_deg: (f64, f64),
    pub(super) kind: Kind,
}

pub(super) enum Kind {
    /// Degrees of longitude and of latitude across.
    Extent([f64; 2]),
    Landing,
}

const fn extent(
    body: Body,
    name: &'static str,
    place_deg: (f64, f64),
    across_deg: [f64; 2],
) -> Feature {
    Feature {
        body,
        name,
        place_deg,
        kind: Kind::Extent(across_deg),
    }
}

const fn landing(body: Body, name: &'static str, place_deg: (f64, f64)) -> Feature {
    Feature {
        body,
        name,
        place_deg,
        kind: Kind::Landing,
    }
}

/// Features in the order in which they are named if there is room, to whole degrees.
///
/// # Source
/// IAU Gazetteer of Planetary Nomenclature, centres and diameters; landing sites as the agencies that landed give them.
pub(super) const FEATURES: &[Feature] = &[
    extent(Body::Mars, "Hellas", (70.0, -42.0), [52.0, 39.0]),
    extent(Body::Mars, "Utopia", (118.0, 47.0), [88.0, 60.0]),
    extent(Body::Mars, "Acidalia", (339.0, 50.0), [61.0, 39.0]),
    extent(Body::Mars, "Amazonis", (197.0, 26.0), [53.0, 48.0]),
    extent(Body::Mars, "Argyre", (317.0, -50.0), [23.0, 15.0]),
    extent(Body::Mars, "Isidis", (88.0, 14.0), [22.0, 21.0]),
    extent(Body::Mars, "Syrtis Major", (67.0, 9.0), [23.0, 23.0]),
    extent(Body::Mars, "Olympus Mons", (226.0, 19.0), [11.0, 10.0]),
    extent(Body::Mars, "Valles Marineris", (298.0, -10.0), [56.0, 12.0]),
    extent(Body::Mars, "Elysium Mons", (147.0, 25.0), [8.0, 7.0]),
    extent(Body::Mars, "Alba Mons", (250.0, 40.0), [12.0, 9.0]),
    extent(Body::Mars, "Arsia Mons", (240.0, -8.0), [8.0, 8.0]),
    extent(Body::Mars, "Ascraeus Mons", (256.0, 12.0), [8.0, 8.0]),
    extent(Body::Mars, "Pavonis Mons", (247.0, 1.0), [6.0, 6.0]),
    landing(Body::Mars, "Viking 1", (312.0, 22.0)),
    landing(Body::Mars, "Viking 2", (134.0, 48.0)),
    landing(Body::Mars, "Pathfinder", (327.0, 19.0)),
    landing(Body::Mars, "Spirit", (175.0, -15.0)),
    landing(Body::Mars, "Opportunity", (354.0, -2.0)),
    landing(Body::Mars, "Phoenix", (234.0, 68.0)),
    landing(Body::Mars, "Curiosity", (137.0, -5.0)),
    landing(Body::Mars, "InSight", (136.0, 4.0)),
    landing(Body::Mars, "Perseverance", (77.0, 18.0)),
    landing(Body::Mars, "Zhurong", (110.0, 25.0)),
    extent(Body::Moon, "Imbrium", (345.0, 35.0), [46.0, 38.0]),
    extent(Body::Moon, "Procellarum", (303.0, 21.0), [92.0, 86.0]),
    extent(Body::Moon, "Serenitatis", (18.0, 27.0), [25.0, 22.0]),
    extent(Body::Moon, "Tranquillitatis", (31.0, 8.0), [29.0, 29.0]),
    extent(Body::Moon, "Crisium", (59.0, 16.0), [19.0, 18.0]),
    extent(Body::Moon, "Nubium", (343.0, -21.0), [26.0, 24.0]),
    extent(Body::Moon, "Orientale", (265.0, -20.0), [11.0, 10.0]),
    extent(Body::Moon, "Tycho", (349.0, -43.0), [4.0, 3.0]),
    extent(Body::Moon, "Copernicus", (340.0, 10.0), [3.0, 3.0]),
    landing(Body::Moon, "Apollo 11", (23.0, 1.0)),
    landing(Body::Moon, "Apollo 12", (337.0, -3.0)),
    landing(Body::Moon, "Apollo 14", (343.0, -4.0)),
    landing(Body::Moon, "Apollo 15", (4.0, 26.0)),
    landing(Body::Moon, "Apollo 16", (16.0, -9.0)),
    landing(Body::Moon, "Apollo 17", (31.0, 20.0)),
    landing(Body::Moon, "Chang'e 4", (178.0, -45.0)),
];
