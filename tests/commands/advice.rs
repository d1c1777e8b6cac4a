//! Kind and advice of causes are derived from attributes: a sample of them against the texts that users know.

use areograph::{
    body::Body,
    config::DuplicateSite,
    error::{Cause, Kind, Stopped},
    geom::uncertainty::BudgetError,
    pds::{image_file::ImageFileError, isd::ForeignBody, label::LabelError},
    spice::SpiceError,
    store::published::PublishedError,
    time::Et,
};

fn of_spice(short: &str) -> SpiceError {
    SpiceError::Spice {
        call: "spkezr_c".to_owned(),
        short: short.to_owned(),
        long: String::new(),
    }
}

#[test]
fn kind_and_advice_are_those_of_the_attributes() {
    let text = str::to_owned;
    // A struct; an enum with one advice; variants with their own; variants like another one; fields in the text;
    // a kind that depends on a field.
    let causes: [(Box<dyn Cause>, Kind, &str); 11] = [
        (
            Box::new(Stopped),
            Kind::Interrupted,
            "run again: finished stages are kept",
        ),
        (
            Box::new(DuplicateSite {
                site: text("gusev"),
                first: text("a.toml"),
                second: text("b.toml"),
            }),
            Kind::Configuration,
            "give each site its own identifier, which is also the name of its products folder",
        ),
        (
            Box::new(BudgetError::NoSites),
            Kind::Input,
            "intersect tie points of at least one stereo pair first",
        ),
        (
            Box::new(LabelError::Instrument {
                found: text("THEMIS"),
                known: vec![],
            }),
            Kind::Input,
            "give an image of a camera known to areograph; in a site, `instrument` in the image's table can also name an \
             instrument file",
        ),
        (
            Box::new(ImageFileError::NoFragment { offset: 2_048 }),
            Kind::Input,
            "fetch the file again: it is truncated or damaged",
        ),
        (
            Box::new(PublishedError::Replaced),
            Kind::Io,
            "try again when the run has finished",
        ),
        (
            Box::new(ForeignBody::Code {
                image: text("m0704042"),
                body: Body::Mars,
                code: 301,
            }),
            Kind::Input,
            "omit the image, or set body to the body of its support data; the configuration expects Mars \
             (body = \"mars\")",
        ),
        (
            Box::new(SpiceError::MissingText {
                kernel: text("leap-second kernel"),
                variable: text("DELTET/DELTA_AT"),
                example: text("naif0012.tls"),
                set: vec![],
            }),
            Kind::Coverage,
            "add such a kernel to the set, for example naif0012.tls",
        ),
        (
            Box::new(SpiceError::NoAttitude {
                of: text("MGS"),
                kernel_time: Et::from_seconds(0.0),
                tolerance_s: 1.0,
            }),
            Kind::Coverage,
            "add kernels that fill the gap, or omit the image or profile concerned",
        ),
        (
            Box::new(of_spice("SPICE(SPKINSUFFDATA)")),
            Kind::Coverage,
            "add kernels that cover this time; `areograph kernels coverage` shows the coverage",
        ),
        (
            Box::new(of_spice("SPICE(BADTIMESTRING)")),
            Kind::Input,
            "check the value and the kernels that NAIF's message names",
        ),
    ];
    for (cause, kind, advice) in causes {
        assert_eq!((cause.kind(), &*cause.advice()), (kind, advice), "{cause}");
    }
}
