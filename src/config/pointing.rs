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

declare_table! {
    /// Pointing bias and where its value comes from.
    pub struct PointingConfig {
        /// Time correction of attitude kernels: the attitude of an exposure at t is read at t + `ck_bias_s`.
        /// Position, Mars rotation and mounting stay at t.
        /// Known: value and sign for MOC, from ISIS and ALE (`INS-94031_CK_TIME_BIAS`) and Shan et al. 2005.
        /// Unknown: whether the same value holds for kernels before the mapping phase (before April 1999).
        ck_bias as "ck_bias_s": PointingBias = key(from_to(-10.0, 10.0))
            .or(usual_instrument().pointing.ck_bias_s)
            .map(PointingBias::from_seconds),
        /// Citation that products repeat; change it together with the value.
        source: String = key(text())
            .or(usual_instrument().pointing.source.clone()),
    }
}

declare_table! {
    /// Clock bias of MOLA.
    /// Known: Shan et al. 2005 (p. 98, citing NAIF 2001) corrected it. Unknown: its sign, and whether PEDR
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
