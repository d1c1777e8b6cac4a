//! `[pointing]` and `[altimeter_clock]`: the two time biases.

use serde::Deserialize;

use areograph_base::{
    altimetry::{BiasScope, MolaClock, TagSign},
    instruments::Instrument,
    time::PointingBias,
};

use super::{
    declare::{Declare as _, Keys, declare_table, key},
    forms::{from_to, text, words},
    instruments::{usual_altimeter, usual_instrument},
};

/// A bias this close to the known one with its sign turned is that one, seconds: NAIF measured 1.140 ± 0.010 s.
const TURNED_SIGN_S: f64 = 0.05;
/// A bias this close to the known one is the known one, seconds: 0.2 m on the ground.
const KNOWN_S: f64 = 0.0005;
/// Effect of a second of attitude time on the ground for a nadir-following bus, metres: it rotates by 0.0501° per
/// second.
const NADIR_TURN_M_S: f64 = 330.0;

declare_table! {
    /// Pointing bias, if different from the biases of the cameras. Every instrument file contains the bias of the
    /// camera, with a citation; a value here replaces these biases for all images of the site.
    pub struct PointingConfig: Deserialize {
        /// Time correction of attitude kernels: the attitude of an exposure at t is read at t + `ck_bias_s`. Position,
        /// Mars rotation and mounting refer to t. The default is the bias in the instrument file. For MOC, value and
        /// sign are known from ISIS, ALE (`INS-94031_CK_TIME_BIAS`) and Shan et al. 2005. The known value with reversed
        /// sign is refused; any other departure from the known value is reported in a remark. It is unknown whether the
        /// same value applies to kernels from before the mapping phase (before April 1999).
        ck_bias as "ck_bias_s": Option<PointingBias> = key(from_to(-10.0, 10.0))
            .unused("-1.15")
            .map(|bias_s| bias_s.map(PointingBias::from_seconds)),
        /// Citation in the products; change it together with `ck_bias_s`. The default is the citation in the instrument
        /// file or, for a different bias, the name of the key `ck_bias_s`.
        source: Option<String> = key(text()).unused(r#""mocAddendum004.ti; Shan et al. 2005, p. 98""#),
    }
}

/// Whether a bias is the known one but for its sign.
pub(super) fn has_turned_sign(bias_s: f64, known_s: f64) -> bool {
    known_s.abs() > TURNED_SIGN_S && (bias_s + known_s).abs() < TURNED_SIGN_S
}

/// A pointing bias as used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UsedBias<'a> {
    /// The bias.
    pub bias: PointingBias,
    /// Its source.
    pub source: &'a str,
    /// Name of the first camera that it holds for.
    pub camera: &'a str,
}

impl UsedBias<'_> {
    fn is_same(&self, other: &Self) -> bool {
        self.bias == other.bias && self.source == other.source
    }
}

impl PointingConfig {
    /// The bias that holds for `camera`: the site's, else that of its instrument file.
    #[must_use]
    pub fn bias_of(&self, camera: &Instrument) -> PointingBias {
        self.ck_bias.unwrap_or(camera.pointing_bias())
    }

    /// Source of the bias that holds for `camera`.
    #[must_use]
    pub fn source_of<'a>(&'a self, camera: &'a Instrument) -> &'a str {
        let own = &camera.pointing;
        match (&self.source, self.departure_s(camera) > KNOWN_S) {
            (Some(source), _) => source,
            (None, false) => &own.source,
            (None, true) => "pointing.ck_bias_s of the site",
        }
    }

    /// The biases that hold for `cameras`, each once; without cameras, the bias of the usual camera.
    #[must_use]
    pub fn used<'a>(
        &'a self,
        cameras: impl IntoIterator<Item = &'a Instrument>,
    ) -> Vec<UsedBias<'a>> {
        let used = |camera: &'a Instrument| UsedBias {
            bias: self.bias_of(camera),
            source: self.source_of(camera),
            camera: &camera.name,
        };
        let mut all: Vec<UsedBias<'a>> = Vec::new();
        for bias in cameras.into_iter().map(used) {
            if !all.iter().any(|known| known.is_same(&bias)) {
                all.push(bias);
            }
        }
        if all.is_empty() {
            all.push(used(usual_instrument()));
        }
        all
    }

    fn departure_s(&self, camera: &Instrument) -> f64 {
        (self.bias_of(camera).seconds() - camera.pointing.ck_bias_s).abs()
    }

    /// Distance of the bias from the known one of `camera`, in a sentence; `None` for the known one.
    #[must_use]
    pub fn departure(&self, camera: &Instrument) -> Option<String> {
        let (bias_s, known_s) = (self.bias_of(camera).seconds(), camera.pointing.ck_bias_s);
        let apart_s = self.departure_s(camera);
        (apart_s > KNOWN_S).then(|| {
            format!(
                "pointing.ck_bias_s is {bias_s} s, but the known bias of {} is {known_s} s: the difference of \
                 {apart_s:.3} s corresponds to up to {:.0} m on the ground",
                camera.name,
                apart_s * NADIR_TURN_M_S
            )
        })
    }
}

declare_table! {
    /// Clock bias of MOLA. Shan et al. 2005 (data preparation, citing NAIF 2001) corrected this bias. The sign of the
    /// bias is unknown, as are the PEDR versions (if any) whose time tags have already been corrected. The defaults are
    /// therefore a choice of areograph; the bias scan of the range check shows which choice a profile supports. The
    /// effect is 353 to 398 m along the track (about one shot spacing), 28 m of Mars rotation at the equator, and at
    /// most 3.2 m in height.
    fill MolaClock {
        /// Size of the clock bias; the default is the bias in the altimeter file.
        bias_s = key(from_to(0.0, 10.0)).or(usual_altimeter().clock_bias_s),
        /// Sign of the clock bias: time tags are later or earlier than the true time.
        sign = key(words([
            ("late", TagSign::Late, "true time = tag - bias"),
            ("early", TagSign::Early, "true time = tag + bias"),
        ])).or(TagSign::Late),
        /// Use of the corrected time. Shan et al. 2005 correct the bias in the datum conversion and look up the
        /// spacecraft at the corrected time, but give no formula. Three readings are possible. If the corrected time
        /// applies to both rotations and the look-up, footprints remain unchanged (0.3 mm), and only the look-up
        /// changes ("spk_lookup", a choice of areograph). If this time applies to the look-up and the rotation into IAU
        /// 2000, but not to the rotation from the file's datum, footprints move by 28 m ("both"). Application to the
        /// rotation alone ("rotation") contradicts the look-up of Shan et al. 2005.
        scope = key(words([
            ("spk_lookup", BiasScope::SpkLookup, "the spacecraft's position in the range check"),
            (
                "rotation",
                BiasScope::Rotation,
                "the rotation into IAU 2000 (the rotation from the file's datum remains at the time tag)",
            ),
            ("both", BiasScope::Both, "both"),
            ("none", BiasScope::None, "nothing: time tags are used unchanged"),
        ])).or(BiasScope::SpkLookup),
        /// Citation in the products; change it together with the values.
        source = key(text()).or(usual_altimeter().clock_source.clone()),
    }
    check bias_is_used
}

fn bias_is_used(clock: &MolaClock, keys: &mut Keys<'_, '_>) {
    if clock.scope == BiasScope::None {
        let why = format!("{} is \"none\"", keys.path_of("scope"));
        for key in ["bias_s", "sign"] {
            keys.unused(key, &why);
        }
    }
}
