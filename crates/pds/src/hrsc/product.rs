//! Product names, which identify orbit, image and line of the camera: `H5270_0000_IR2.IMG`.

use crate::{
    image_label::{either, known},
    label::{Entry, Label, LabelError},
};

/// Lines of the camera in product names, and in `DETECTOR_ID`.
const DETECTORS: [(&str, &str); 10] = [
    ("ND", "MEX_HRSC_NADIR"),
    ("S1", "MEX_HRSC_S1"),
    ("S2", "MEX_HRSC_S2"),
    ("P1", "MEX_HRSC_P1"),
    ("P2", "MEX_HRSC_P2"),
    ("IR", "MEX_HRSC_IR"),
    ("GR", "MEX_HRSC_GREEN"),
    ("BL", "MEX_HRSC_BLUE"),
    ("RE", "MEX_HRSC_RED"),
    ("SR", "MEX_HRSC_SRC"),
];

/// The product at the start of a name, in capitals and with underscores: `H5270_0000_IR2` of `h5270_0000_ir2.img` and
/// `h5270-0000-ir2`; `None` if the name contains no product.
#[must_use]
pub(crate) fn product_named(name: &str) -> Option<String> {
    const LENGTH: usize = 14;
    let head = name.get(..LENGTH)?.to_ascii_uppercase().replace('-', "_");
    let goes_on = name[LENGTH..].starts_with(|next: char| next.is_ascii_alphanumeric());
    let [orbit, image, line] = head.split('_').collect::<Vec<_>>()[..] else {
        return None;
    };
    let (detector, level) = line.split_at_checked(2)?;
    let is_number = |text: &str| text.len() == 4 && text.bytes().all(|byte| byte.is_ascii_digit());
    // Orbits from 10000 on have a letter in place of their first digit.
    let is_orbit = orbit.len() == 5
        && orbit.starts_with('H')
        && orbit.bytes().all(|byte| byte.is_ascii_alphanumeric())
        && orbit[2..].bytes().all(|byte| byte.is_ascii_digit());
    let is_line = DETECTORS.iter().any(|(short, _)| *short == detector)
        && level.bytes().all(|byte| byte.is_ascii_digit());
    (is_orbit && is_number(image) && is_line && !goes_on).then_some(head)
}

/// Checks that product, file name in the label, detector and the actual file name belong to one image.
///
/// # Errors
/// [`LabelError::Contradiction`] with the two that differ; two values under one keyword.
pub(super) fn of_one_product(label: &Label, file_name: &str) -> Result<(), LabelError> {
    let product = either(label, "PRODUCT_ID", "PRODUCTID")?;
    let Some((product, named)) =
        product.and_then(|entry| Some((entry, product_named(&entry.value)?)))
    else {
        return Ok(());
    };
    let contradicts = |key: &str, value: &str| {
        Err(LabelError::Contradiction {
            keys: [product.key.clone(), key.to_owned()],
            values: [product.value.clone(), value.to_owned()],
        })
    };
    let names_another = |name: &str| product_named(name).is_some_and(|other| other != named);
    let of_label = label.only("FILE_NAME")?.filter(|entry| known(entry));
    if let Some(entry) = of_label.filter(|entry| names_another(&entry.value)) {
        return contradicts(&entry.key, &entry.value);
    }
    if names_another(file_name) {
        return contradicts("the file name", file_name);
    }
    let is_other = |entry: &&Entry| {
        let detector = |(_, id): &&(&str, &str)| id.eq_ignore_ascii_case(&entry.value);
        let short = DETECTORS.iter().find(detector).map(|(short, _)| *short);
        short.is_some_and(|short| named.get(11..13) != Some(short))
    };
    match either(label, "DETECTOR_ID", "DETECTORID")?.filter(is_other) {
        Some(entry) => contradicts(&entry.key, &entry.value),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::label::parse;

    #[test]
    fn products_are_known_by_their_names() {
        for (name, product) in [
            ("H5270_0000_IR2.IMG", Some("H5270_0000_IR2")),
            ("h5270-0000-ir2_north", Some("H5270_0000_IR2")),
            ("ha123_0009_s22", Some("HA123_0009_S22")),
            ("h5270_0000_ir25", None),
            ("h5270_0000_xx2", None),
            ("h5270_0000", None),
            ("é5270_0000_ir2", None),
        ] {
            assert_eq!(product_named(name).as_deref(), product, "{name}");
        }
    }

    #[test]
    fn what_names_two_images_is_refused_with_both() {
        let refused = |text: &str, file: &str| {
            let label = parse(text.as_bytes()).unwrap();
            of_one_product(&label, file).unwrap_err().to_string()
        };
        let product = "PRODUCT_ID = H5270_0000_IR2.IMG\n";
        assert_eq!(
            refused(&format!("{product}DETECTOR_ID = MEX_HRSC_S1\n"), "a.img"),
            "PRODUCT_ID is \"H5270_0000_IR2.IMG\", but DETECTOR_ID is \"MEX_HRSC_S1\"; expected values of one image"
        );
        assert!(
            refused(&format!("{product}FILE_NAME = H5270_0000_S12.IMG\n"), "a")
                .contains("but FILE_NAME is \"H5270_0000_S12.IMG\"")
        );
        assert!(
            refused(product, "h5271_0000_ir2.img")
                .contains("the file name is \"h5271_0000_ir2.img\"")
        );
        let label = parse(format!("{product}DETECTOR_ID = MEX_HRSC_IR\n").as_bytes()).unwrap();
        for file in ["h5270_0000_ir2.img", "nadir.img"] {
            assert_eq!(of_one_product(&label, file), Ok(()));
        }
    }
}
