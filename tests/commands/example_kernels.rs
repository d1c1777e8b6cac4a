//! The text kernels that areograph ships load in CSPICE and say what their sources say.

use std::path::{Path, PathBuf};

use areograph::{
    body::Body,
    body::Datum,
    config::usual_instrument,
    geom::body_rotation::body_matrix,
    spice::{KernelSet, Session},
    time::Et,
};

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("kernels.example")
        .join(name)
}

#[test]
fn the_metakernel_loads_clock_leap_seconds_and_camera() {
    let session =
        Session::open(&KernelSet::from_metakernel(&example("example.tm")).unwrap()).unwrap();
    // Clock readings and their ET from the mission's own clock kernel; 1 µs is what the digits hold.
    for (clock, et_s) in [
        ("561812335:32", -69_382_819.360_519_02),
        ("610472061:131", -20_723_097.688_171_078),
        ("619971158:28", -11_224_002.182_053_322),
        ("653298871:2", 22_103_706.521_436_583),
    ] {
        let off_s = session.sclk_to_et(clock).unwrap().seconds() - et_s;
        assert!(off_s.abs() < 1e-6, "{clock}: {off_s} s");
    }
    // ET of the same UTC from NAIF's naif0012.tls: before, in and after leap seconds.
    for (utc, et_s) in [
        ("1998-12-31T23:59:60.5", -31_579_136.316_079_672),
        ("1999-01-01T00:00:00", -31_579_135.816_079_672),
        ("2001-03-31T18:17:09.41", 39_334_693.595_655),
        ("2006-01-01T00:00:00", 189_345_665.183_925_6),
    ] {
        let off_s = session.utc_to_et(utc).unwrap().seconds() - et_s;
        assert!(off_s.abs() < 1e-7, "{utc}: {off_s} s");
    }
    let mounting = session
        .mounting(usual_instrument(), Et::from_seconds(0.0))
        .unwrap();
    // Boresight in the bus as MOC's instrument kernel 2.0 has it; ten printed digits.
    let boresight = mounting.matrix().row(2);
    for (found, published) in
        boresight
            .iter()
            .zip([-0.001_250_004_5, -0.002_000_668_0, 0.999_997_217_4])
    {
        assert!((found - published).abs() < 1e-10, "{boresight}");
    }
}

#[test]
fn each_mars_model_is_the_one_its_name_says() {
    for (name, datum) in [
        ("mars_iau1991.tpc", Datum::Iau1991),
        ("mars_iau1994.tpc", Datum::Iau1994),
        ("mars_iau2000.tpc", Datum::Iau2000),
    ] {
        let session = Session::open(&KernelSet::from_files(&[example(name)]).unwrap()).unwrap();
        for seconds in [-7.0e7, 0.0, 3.9e7] {
            let et = Et::from_seconds(seconds);
            let off = session.body_matrix(Body::Mars, et).unwrap() - body_matrix(datum.model(), et);
            assert!(off.abs().max() < 1e-12, "{name}"); // rounding of the meridian angle
        }
    }
}
