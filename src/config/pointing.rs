//! `[pointing]` and `[mola_clock]`: the two time biases.

use crate::{
    altimetry::{BiasScope, MolaClock, TagSign},
    time::PointingBias,
};

use super::{
    declare::{Declare as _, Keys, declare_table, key},
    forms::{from_to, text, words},
    instruments::{built_in_altimeter, usual_instrument},
};

/// A bias this close to the known one with its sign turned is that one, seconds: NAIF measured 1.140 ± 0.010 s.
const TURNED_SIGN_S: f64 = 0.05;
/// A bias this close to the known one is the known one, seconds: 0.2 m on the ground.
const KNOWN_S: f64 = 0.0005;
/// What a second of attitude time is on the ground when the bus keeps nadir, metres: it turns by 0.0501° meanwhile.
const NADIR_TURN_M_S: f64 = 330.0;

declare_table! {
    /// Pointing bias and where its value comes from.
    pub struct PointingConfig {
        /// Time correction of attitude kernels: the attitude of an exposure at t is read at t + `ck_bias_s`.
        /// Position, Mars rotation and mounting stay at t.
        /// Known: value and sign for MOC, from ISIS and ALE (`INS-94031_CK_TIME_BIAS`) and Shan et al. 2005.
        /// The known value with its sign turned is refused; any other one is remarked on.
        /// Unknown: whether the same value holds for kernels before the mapping phase (before April 1999).
        ck_bias as "ck_bias_s": PointingBias = key(from_to(-10.0, 10.0))
            .or(usual_instrument().pointing.ck_bias_s)
            .map(PointingBias::from_seconds),
        /// Citation that products repeat; change it together with the value.
        source: String = key(text())
            .or(usual_instrument().pointing.source.clone()),
    }
    check sign_is_known
}

fn sign_is_known(pointing: &PointingConfig, keys: &mut Keys<'_, '_>) {
    let camera = usual_instrument();
    if has_turned_sign(pointing.ck_bias.seconds(), camera.pointing.ck_bias_s) {
        keys.refuse(
            "ck_bias_s",
            format!(
                "{}, the known bias of {} with its sign: the attitude of an exposure at t is read at t + ck_bias_s",
                camera.pointing.ck_bias_s, camera.name
            ),
        );
    }
}

/// Whether a bias is the known one but for its sign.
pub(super) fn has_turned_sign(bias_s: f64, known_s: f64) -> bool {
    known_s.abs() > TURNED_SIGN_S && (bias_s + known_s).abs() < TURNED_SIGN_S
}

impl PointingConfig {
    /// How far the bias is from the known one, in a sentence; `None` for the known one.
    #[must_use]
    pub fn departure(&self) -> Option<String> {
        let (camera, bias_s) = (usual_instrument(), self.ck_bias.seconds());
        let known_s = camera.pointing.ck_bias_s;
        let apart_s = (bias_s - known_s).abs();
        (apart_s > KNOWN_S).then(|| {
            format!(
                "pointing.ck_bias_s is {bias_s} s, the known bias of {} {known_s} s: {apart_s:.3} s more or less are up \
                 to {:.0} m on the ground",
                camera.name,
                apart_s * NADIR_TURN_M_S
            )
        })
    }
}

declare_table! {
    /// Clock bias of MOLA.
    /// Known: Shan et al. 2005 (data preparation, citing NAIF 2001) corrected it. Unknown: its sign, and whether PEDR
    /// time tags, of which versions, already include it. The defaults below are therefore a choice; the
    /// bias scan of the range check tells which one a profile supports. Size: about one shot spacing
    /// (353 to 398 m) along the track, 28 m of Mars rotation at the equator, at most 3.2 m of height.
    fill MolaClock {
        /// Size of the bias.
        bias_s = key(from_to(0.0, 10.0)).or(built_in_altimeter().clock_bias_s),
        /// On which side of the true time a tag lies.
        sign = key(words([
            ("late", TagSign::Late, "true time = tag - bias"),
            ("early", TagSign::Early, "true time = tag + bias"),
        ])).or(TagSign::Late),
        /// What the corrected time is used for. Shan et al. 2005 correct the bias in the datum conversion, and look the
        /// spacecraft up at the corrected time; they give no formula. Three readings: one corrected time serves both
        /// rotations and the look-up, then footprints stay (0.3 mm) and only the look-up counts ("spk_lookup", our
        /// choice); the rotation into IAU 2000 has it and the one out of the file's datum has not ("both", 28 m);
        /// that rotation alone ("rotation") contradicts their look-up.
        scope = key(words([
            ("spk_lookup", BiasScope::SpkLookup, "the spacecraft's position in the range check"),
            (
                "rotation",
                BiasScope::Rotation,
                "the rotation into IAU 2000 (the one out of the file's datum stays at the tag)",
            ),
            ("both", BiasScope::Both, "both"),
            ("none", BiasScope::None, "nothing: tags are taken as they are"),
        ])).or(BiasScope::SpkLookup),
        /// Citation that products repeat; change it together with the values.
        source = key(text()).or(built_in_altimeter().clock_source.clone()),
    }
    check bias_is_used
}

fn bias_is_used(clock: &MolaClock, keys: &mut Keys<'_, '_>) {
    if clock.scope == BiasScope::None {
        for key in ["bias_s", "sign"] {
            keys.unused(key, "mola_clock.scope is \"none\"");
        }
    }
}
