//! Labels of real MOC images.

use areograph_testing as common;

use areograph_base::image::ImageFields;
use areograph_config::built_in_instruments;
use areograph_pds::read_label;
use common::real_data;

/// All three images were exposed for 0.4821 ms a line.
fn assert_exposure(fields: &ImageFields) {
    assert!(
        fields
            .exposure_s
            .is_some_and(|exposure_s| (exposure_s - 0.482_1e-3).abs() < 1e-15)
    ); // rounding
}

#[test]
fn attached_pds_label() {
    let Some(path) = real_data("asp_moc/M0100115.imq", "attached_pds_label") else {
        return;
    };
    let label = read_label(&path, built_in_instruments()).unwrap();
    assert_exposure(&label.fields);
    assert_eq!(label.product_id.as_deref(), Some("M01/00115"));
    let expected = ImageFields {
        sclk_start: Some("610472061:131".to_owned()),
        utc_start: Some("1999-05-06T15:33:58.13".to_owned()),
        exposure_s: label.fields.exposure_s,
        line_period_s: None,
        downtrack_summing: Some(3),
        crosstrack_summing: Some(3),
        lines_header: Some(4864),
        lines_delivered: None,
        samples: Some(672),
        first_detector: Some(0),
    };
    assert_eq!(label.fields, expected);
}

#[test]
fn isis_labels() {
    let cases = [
        (
            "ale_mgs/m0402852/m0402852_isis.lbl",
            "M04/02852",
            "619971158:28",
            "1999-08-24T14:12:13.64",
            8,
            1536,
            256,
        ),
        (
            "isis_moc/m1301260_isis.lbl",
            "M13/01260",
            "637908733:72",
            "2000-03-19T04:51:46.63",
            1,
            2688,
            1536,
        ),
    ];
    for (file, product, sclk, utc, summing, lines, samples) in cases {
        let Some(path) = real_data(file, "isis_labels") else {
            return;
        };
        let label = read_label(&path, built_in_instruments()).unwrap();
        assert_exposure(&label.fields);
        assert_eq!(label.product_id.as_deref(), Some(product));
        let expected = ImageFields {
            sclk_start: Some(sclk.to_owned()),
            utc_start: Some(utc.to_owned()),
            exposure_s: label.fields.exposure_s,
            line_period_s: None,
            downtrack_summing: Some(summing),
            crosstrack_summing: Some(summing),
            lines_header: Some(lines),
            lines_delivered: None,
            samples: Some(samples),
            first_detector: Some(0),
        };
        assert_eq!(label.fields, expected);
    }
}

#[test]
fn a_label_of_another_instrument_is_refused() {
    let file = "isis_lidar/lidarObservationPair/lidarObservationImage1OriginalLabel.pvl";
    let Some(path) = real_data(file, "a_label_of_another_instrument_is_refused") else {
        return;
    };
    let message = read_label(&path, built_in_instruments())
        .unwrap_err()
        .to_string();
    assert!(message.contains("expected MOC-NA"), "{message}");
}
