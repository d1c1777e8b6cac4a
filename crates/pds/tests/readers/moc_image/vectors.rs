//! Small images of every coding with the pixels by the mission's own decompressor.

use super::{files, read, sha256};
use areograph_pds::image_file::{Coding, Predictor};

const X_5: &str = "
    caf064676a6669656864676a6669656864678191babaabababbbba0a8c49972e5d4a979eef52e64913a54489f428254a9402c3b87021dc
    c2856be85a18186508e21d430ced18e21d07c635d3146b9ae54cb39c665a9e2ccb5ad719e02c039c7506380b8cdc0660db006c07bb0d76
    1b80c018508e12980f1c030d81cc7c603e10982755a650a9a7d453e6a9f3d44a3da59e3230bc827041b8a0ba027d813c75a941b8c02804
    ee77fbdd7e1728cbd3422004428171f81c7c0e7e6a33301c48cdc14f6de6c9f4631675fa3afd40779e525fa7af8b81914d6c426c021628
    0e348a0198d800";

const Y_1: &str = "
    caf064676a6669656864676a666965686467752f5da7aeaf53d6849a489db64e5327a953d589ea14a526a8d376b5beee3a454da44e56a7
    a9b5d5daebf495b2d469aa75aaba6b9235d19a589d5da7ae13d729eb14755f1349576b1275fa9a5027afd3d6696a6db5f61a7586b23a6d
    d7daeaebae0935913a53adb54e52a7aad3d7194a4d909a62b54e55779da1265aa7add3d4daeaaa53d609cb3591d469aaf535f19a5027af
    89d5d975ea3a559dbece50f76ad25da7ae49d4296b424db44e5ba7a9f35a7b9da8ce506a823a6d57ebebae33d459ea64b5d63a75adbd4e
    5f272c4b9da62655a7aa89d7849a484dac4e5a6bab13d7e9eb0c755f134957ebeb9435a1ce58a7adb5d6a96bed75a23a43b92653a7ad29
    d6a96b1275d7246b2275a63a4d9dd7a9eaf4758a5213a4ab75aabaeb1435d13a6dadb54e5d579db252ae89a44e5393aaaf89d7843a794d
    ac4e5a6bab53d5e9eb0c752f5da7aeaf53d6246b2275da5a6b9da4d65ea34e01";

const XY_3: &str = "
    caf064676a6669656864676a6669656864676ddac64ddcb48d9bb809b8899bb671133787a98d03dbb8899bc3d4c60d1a37dd266edac314
    3768dcf430356e828d9b430ddaf65033e83687a901373d4c83beb839d40cfa7a98e2068d03e3266e7a98067d714134dca03d4cdda68769
    d01717440bbacd611af4f55033e8164403dcc44ddb43056182a041b4a0ef3075d00d6ce3826841b7205ad0d7c334e816440bba05d1dc26
    6edac6cda1063d4c83bec334e81644030fd3a05b102de816440bfa0ed3a0ef50831e6ad0c334e80bb8691b377141b4a0ef300dfa0e35e8
    a1c0b8890ba2057d8769d01717440bba05d182bec3d46ddac64d5c102de8eb611a740ba2e1060d";

const X_7: &str = "
    caf064676a6669656864676a6669656864671d20c712a07a4408c2931e89f081480fc4ab221b3b090bd9b83d64c3a626f484c9e422d393
    c96433b92793736f66d29373a6f59ce9c939a7b773ee39e7dc7ac8e939c6dcdb31f7908fe98db33dc4e3ad1b0f";

const COSINE: &str = "
    4160ead001ffffb66db76d4b92e4b66d922425490200000000000000000000000000000000000000000000000000000000000000000000
    000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000c0ff705c085aa0358410
    444444c4b66d4992004055010010881310e7ffdfb6edb66d4992dcb64d92a4244900000000000000000000000000000000000000000000
    00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000
    0000000090feb93a50feff7f088184103111b1e9b62449004155f1ffff3fffffffff7b0000fe03";

const WALSH: &str = "
    4160ead001ffffb66db76d4b92e4b66d922425490200000000000000000000000000000000000000000000000000000000000000000000
    000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000c0ff705c085aa0358410
    444444c4b66d4992004055010010881310e7ffdfb6edb66d4992dcb64d92a4244900000000000000000000000000000000000000000000
    00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000
    00000000f0feb93a50dc10020921622262d36d49920002fc07";

/// 16 × 16 pixels with gradients, a step, and a spike.
fn picture() -> Vec<u8> {
    let pixel = |y: u32, x: u32| {
        let step = if x == 9 && y > 8 { 120 } else { 0 };
        u8::try_from(100 + (x * y % 23) + ((3 * x + 5 * y) % 7) + step).unwrap()
    };
    (0..16)
        .flat_map(|y| (0..16).map(move |x| pixel(y, x)))
        .collect()
}

#[test]
fn predicted_pixels_come_out_as_they_went_in() {
    let folder = tempfile::tempdir().unwrap();
    let picture = picture();
    assert_eq!(
        sha256(&picture),
        "b1278f91779c24455ee6cc2155c61bd18eac86d8ae5b4ccf8f2fc5c8066c29c8"
    );
    for (coding, data) in [([1, 5], X_5), ([2, 1], Y_1), ([3, 3], XY_3)] {
        let path = files::write_fragment(folder.path(), 16, coding, 0, &files::hexadecimal(data));
        let (pixels, statistics, complaints) = read(&path);
        assert_eq!(complaints, [""; 0], "{coding:?}");
        assert_eq!(
            (statistics.lines_good, pixels == picture),
            (16, true),
            "{coding:?}"
        );
    }
    let path = files::write_fragment(folder.path(), 16, [1, 7], 0, &files::hexadecimal(X_7));
    let (pixels, ..) = read(&path);
    let last = [
        100, 110, 111, 121, 120, 110, 120, 119, 109, 9, 109, 108, 118, 117, 107, 117,
    ];
    assert_eq!(pixels[15 * 16..], last);
    assert_eq!(
        sha256(&pixels),
        "a4b897d02fc0b4867f983df61241a93b670367791ebc49ea2856bb91993a2f65"
    );
}

#[test]
fn transformed_pixels_are_those_of_the_decompressor() {
    let folder = tempfile::tempdir().unwrap();
    for (coding, spacing, data, hash) in [
        (
            [0x08, 0x20],
            48,
            COSINE,
            "4fa0b536c25170594f0c49223382a2c8d83114651c26c974e17943aeb1e9ffa4",
        ),
        (
            [0x04, 0x20],
            80,
            WALSH,
            "adabd53b559def9b3bf5192e59405946ab96e1ba278699f5be47f1253a6837e7",
        ),
    ] {
        let path = files::write_fragment(
            folder.path(),
            48,
            coding,
            spacing,
            &files::hexadecimal(data),
        );
        let (pixels, statistics, complaints) = read(&path);
        assert_eq!(complaints, [""; 0]);
        assert_eq!(
            (statistics.lines_good, sha256(&pixels)),
            (16, hash.to_owned())
        );
        // The last bytes contain the group of the outer blocks; the middle one belongs to another group.
        let bytes = files::hexadecimal(data);
        let path = files::write_fragment(
            folder.path(),
            48,
            coding,
            spacing,
            &bytes[..bytes.len() - 20],
        );
        let (short, statistics, complaints) = read(&path);
        assert_eq!(
            complaints,
            ["fragment 0, byte 2048, line 0: the data end before the last block"]
        );
        assert_eq!(
            (statistics.lines_suspect, &short[16..32]),
            (16, &pixels[16..32])
        );
    }
}

#[test]
fn raw_pixels_are_taken_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = files::write_fragment(folder.path(), 16, [0, 0], 0, &picture());
    let (pixels, statistics, complaints) = read(&path);
    assert_eq!(
        (pixels, statistics.lines_good, complaints),
        (picture(), 16, Vec::new())
    );
}

#[test]
fn codings_are_told_by_two_bytes_of_the_header() {
    let folder = tempfile::tempdir().unwrap();
    let path = files::write_fragment(folder.path(), 16, [0x52, 0x01], 0, &files::hexadecimal(Y_1));
    let image =
        areograph_pds::image_file::ImageFile::open(&path, areograph_config::built_in_instruments())
            .unwrap();
    let expected = Coding::Predictive {
        predictor: Predictor::Y,
        table: 1,
    };
    assert_eq!(image.layout().coding, Some(expected));
}
