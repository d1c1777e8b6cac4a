//! Decisions as text: changes, affected images, stages to run.

use std::path::Path;

use crate::{
    database::CauseRow,
    words::sentence,
    worker::protocol::{PlanAnswer, PlannedStage},
};
use areograph_store::files::file_name;

/// Number of stages, and images, named individually.
const NAMED_MAX: usize = 4;

/// The decision of a comparison, in one sentence.
#[must_use]
pub fn decision(causes: &[CauseRow], answer: &PlanAnswer) -> String {
    if let [cause] = causes
        && answer.stages.iter().any(|stage| stage.runs)
    {
        return change_text(cause, answer);
    }
    let changed: Vec<&str> = causes.iter().map(|cause| &*cause.detail).collect();
    let runs = stages(&answer.stages);
    match (changed.is_empty(), runs.is_empty()) {
        (true, true) => "checked, nothing changed".to_owned(),
        (false, true) => format!("{}; no stage reads the changed inputs", several(&changed)),
        (true, false) => format!("{} run", listed("stage", &runs)),
        (false, false) => format!("{}; {} run", several(&changed), listed("stage", &runs)),
    }
}

/// The effect of one change: the images whose stages name it, and the stages that run.
#[must_use]
pub fn change_text(cause: &CauseRow, answer: &PlanAnswer) -> String {
    let runs = stages(&answer.stages);
    let stages = if runs.is_empty() {
        String::new()
    } else {
        format!("; {} run", listed("stage", &runs))
    };
    let images = cause
        .path
        .as_ref()
        .map(|path| images(&file_name(Path::new(path)), &answer.stages))
        .unwrap_or_default();
    if images.is_empty() {
        return format!("{}{stages}", cause.detail);
    }
    let meets = if cause.kind == "kernel_changed" {
        "its coverage overlaps"
    } else {
        "it belongs to"
    };
    format!(
        "{}; {meets} {}{stages}",
        cause.detail,
        listed("image", &images)
    )
}

/// Images whose stages run because of a file.
fn images<'a>(file: &str, stages: &'a [PlannedStage]) -> Vec<&'a str> {
    let mut images = Vec::new();
    for stage in stages.iter().filter(|stage| stage.runs) {
        let names_it = stage.because.split([' ', ',']).any(|word| word == file);
        if let Some((_, image)) = stage.stage.split_once('/').filter(|_| names_it)
            && !images.contains(&image)
        {
            images.push(image);
        }
    }
    images
}

/// Names of the stages that run, each once, without their images.
fn stages(stages: &[PlannedStage]) -> Vec<&str> {
    let mut names = Vec::new();
    for stage in stages.iter().filter(|stage| stage.runs) {
        let name = stage.stage.split('/').next().unwrap_or(&stage.stage);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

fn listed(what: &str, names: &[&str]) -> String {
    match names {
        [name] => format!("{what} {name}"),
        names => format!("{what}s {}", several(names)),
    }
}

fn several(names: &[&str]) -> String {
    let shown = &names[..names.len().min(NAMED_MAX)];
    let more = names.len() - shown.len();
    if more == 0 {
        return sentence(shown);
    }
    format!("{} and {more} more", shown.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::CauseKind;
    use areograph_base::body::Body;

    fn answer(stages: &[(&str, bool, &str)]) -> PlanAnswer {
        let stage = |(stage, runs, because): &(&str, bool, &str)| PlannedStage {
            stage: (*stage).to_owned(),
            runs: *runs,
            because: (*because).to_owned(),
        };
        PlanAnswer {
            config_blake3: String::new(),
            stages: stages.iter().map(stage).collect(),
            files: Vec::new(),
            bounds_deg: None,
            body: Body::Mars,
        }
    }

    #[test]
    fn a_decision_names_file_image_and_stages() {
        let changed = "kernel mgs_sc_ext1.bc changed";
        let answer = answer(&[
            ("tag_times/E02-01453", false, "unchanged"),
            ("sample_orientation/E02-01453", true, changed),
            ("sample_orientation/E02-00665", false, "unchanged"),
            ("publish", true, "output of sample_orientation may change"),
        ]);
        let mut cause = CauseRow::plain(CauseKind::KernelChanged, "`mgs_sc_ext1.bc` changed", 0);
        cause.path = Some("/mirror/ck/mgs_sc_ext1.bc".to_owned());
        assert_eq!(
            change_text(&cause, &answer),
            "`mgs_sc_ext1.bc` changed; its coverage overlaps image E02-01453; stages sample_orientation and publish run"
        );
        let also = CauseRow::plain(CauseKind::KernelChanged, "`mgs_clock.tsc` changed", 0);
        assert_eq!(
            decision(&[cause, also], &answer),
            "`mgs_sc_ext1.bc` changed and `mgs_clock.tsc` changed; stages sample_orientation and publish run"
        );
        assert_eq!(
            decision(&[], &self::answer(&[])),
            "checked, nothing changed"
        );
    }
}
