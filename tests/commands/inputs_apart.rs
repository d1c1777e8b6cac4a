//! Inputs that are too large, damaged or of another kind, and inputs and outputs in one folder.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use std::{
    fs::{self, File},
    path::Path,
    process::Command,
};

use crate::common::{case::Case, mission::mission};

fn run(case: &Case, arguments: &[&str]) -> String {
    let mut command: Command = case.areograph();
    command.arg("--quiet").args(arguments);
    case.outcome(command)
}

const RUN: [&str; 4] = ["run", "site.toml", "--out", "out"];

#[test]
fn inputs_and_outputs_in_one_folder_are_refused() {
    let case = Case::new();
    let refused = |out: &str, products: &str, input: &str| {
        for command in ["run", "plan", "check"] {
            let outcome = run(&case, &[command, "site.toml", "--out", out]);
            let message = format!(
                "the output folder {products} overlaps the input folder {input}; expected separate folders"
            );
            assert!(outcome.starts_with("exit 2\n"), "{command}: {outcome}");
            assert!(outcome.contains(&message), "{command}: {outcome}");
        }
    };
    // Folders of single inputs; that of the site file holds everything.
    refused("kernels", "kernels", "kernels");
    refused("pedr/out", "pedr/out", "pedr");
    let ready = run(&case, &["check", "site.toml", "--out", "."]);
    assert!(ready.starts_with("exit 0\n"), "{ready}");
    // Inputs among the products of the site.
    fs::rename(case.path("pedr"), case.path("case")).unwrap();
    case.replace("site.toml", "pedr/*.b", "case/*.b");
    refused(".", "./case", "case");
    fs::rename(case.path("case"), case.path("pedr")).unwrap();
    case.replace("site.toml", "case/*.b", "pedr/*.b");
    // A folder that is searched for kernels.
    case.replace(
        "site.toml",
        "metakernel = \"kernels/nav.tm\"",
        "root = \"kernels\"",
    );
    std::os::unix::fs::symlink("kernels", case.path("linked")).unwrap();
    refused("kernels/p", "kernels/p/case", "kernels");
    refused("linked/p", "linked/p/case", "kernels");
    assert!(!case.path("kernels/p").exists());
}

#[test]
fn a_service_refuses_outputs_among_its_inputs() {
    let case = Case::new();
    fs::create_dir(case.path("sites")).unwrap();
    let configuration = |outputs: &str| {
        format!(
            "[inputs]\nsites = [\"sites\"]\nkernels = [\"kernels\"]\ndata = [\"pedr\"]\n[outputs]\n{outputs}\n"
        )
    };
    let overlaps = [
        ("products = \"kernels/p\"", "kernels", "products"),
        ("state = \"pedr/state\"", "pedr", "state"),
        ("products = \".\"", "sites", "products"),
    ];
    for (outputs, input, output) in overlaps {
        case.write("service.toml", configuration(outputs));
        let outcome = run(&case, &["serve", "service.toml", "--listen", "127.0.0.1:0"]);
        assert!(outcome.starts_with("exit 2\n"), "{outcome}");
        assert!(
            outcome.contains(&format!("outputs.{output} is")),
            "{outcome}"
        );
        assert!(outcome.contains(&format!("{input} (inputs.")), "{outcome}");
        assert!(
            outcome.contains(&format!("(outputs.{output}) overlap")),
            "{outcome}"
        );
    }
}

#[test]
fn files_that_are_too_large_are_refused_before_they_are_read() {
    let case = Case::pair();
    for file in ["labels/E02-01301.lbl", "pedr/ap19019k.b", "ties/isidis.csv"] {
        let whole = case.read(file);
        File::options()
            .write(true)
            .open(case.path(file))
            .unwrap()
            .set_len(10 << 30)
            .unwrap();
        let outcome = run(&case, &RUN);
        let expected = format!("{file}: has 10737418240 bytes; expected at most");
        assert!(outcome.starts_with("exit 3\n"), "{outcome}");
        assert!(outcome.contains(&expected), "{outcome}");
        let outcome = run(&case, &["check", "site.toml"]);
        assert!(outcome.contains(&expected), "{outcome}");
        case.write(file, whole);
    }
}

#[test]
fn pedr_files_are_those_of_mola() {
    let case = Case::new();
    let site = String::from_utf8(case.read("site.toml")).unwrap();
    case.write("site.toml", format!("altimeter = \"lola\"\n{site}"));
    let outcome = run(&case, &RUN);
    let expected = "exit 2\nerror: site.toml:1:13: altimeter is \"lola\"; expected mola, because PEDR files contain its shots";
    assert!(outcome.starts_with(expected), "{outcome}");
    // A file that describes MOLA with another number.
    let mola = include_str!("../../config/altimeters/mola.toml");
    case.write(
        "laser.toml",
        mola.replace("id = \"mola\"", "id = \"mola_2\""),
    );
    case.write("site.toml", format!("altimeter = \"laser.toml\"\n{site}"));
    let outcome = run(&case, &["check", "site.toml"]);
    assert!(outcome.starts_with("exit 0\n"), "{outcome}");
}

#[test]
fn a_pedr_file_of_another_site_is_a_remark() {
    let case = Case::new();
    // The orbits over the window are those of the pair.
    let own = ["ap19019k.b", "ap19117l.b"];
    let other = |name: &str| {
        Path::new(name).extension().is_some_and(|of| of == "b") && !own.contains(&name)
    };
    let folder = fs::read_dir(mission().join("pedr")).unwrap();
    let names = folder.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|name| other(name)).collect();
    names.sort();
    let remark = "no shot in the windows comes from";
    assert!(!run(&case, &RUN).contains(remark));
    let add = |name: &str| {
        fs::copy(
            mission().join("pedr").join(name),
            case.path("pedr").join(name),
        )
        .unwrap()
    };
    // Of a pattern with half its files elsewhere, and of a file by its name.
    add(&names[0]);
    let outcome = run(&case, &RUN);
    assert!(
        outcome.contains(&format!("{remark} {}: check", names[0])),
        "{outcome}"
    );
    // A pattern of which most files lie elsewhere searches an archive; a file that is named does not.
    add(&names[1]);
    assert!(!run(&case, &RUN).contains(remark));
    let named = format!("[\"pedr/*.b\", \"pedr/{}\"]", names[1]);
    case.replace("site.toml", "[\"pedr/*.b\"]", &named);
    let outcome = run(&case, &RUN);
    let empty = format!("{}, {}", names[1], names[0]);
    assert!(
        outcome.contains(&format!("{remark} {empty}: check")),
        "{outcome}"
    );
}

#[test]
fn a_damaged_line_of_a_label_is_reported() {
    let case = Case::new();
    let label = String::from_utf8(case.read("image.lbl")).unwrap();
    let key = "SPACECRAFT_CLOCK_START_COUNT";
    let at = label.find(key).unwrap();
    let line = 1 + label[..at].matches('\n').count();
    let equals = at + label[at..].find('=').unwrap();
    let mut no_assignment = label.clone();
    no_assignment.replace_range(equals..=equals, "?");
    let lost = format!("the damaged label states no {key}");
    let cases = [
        (
            no_assignment,
            format!("line {line} of the label does not have the form KEY = value: \"{key}"),
        ),
        (
            label.replace(key, "SPACECRAFT_CLOCJ_START_COUNT"),
            "but SPACECRAFT_CLOCJ_START_COUNT: without".to_owned(),
        ),
    ];
    for (damaged, expected) in cases {
        case.write("image.lbl", damaged);
        for command in [&RUN[..], &["check", "site.toml"]] {
            let outcome = run(&case, command);
            assert!(outcome.starts_with("exit 0\n"), "{outcome}");
            assert!(outcome.contains(&expected), "{outcome}");
            assert!(outcome.contains(&lost), "{outcome}");
        }
    }
    case.write("image.lbl", label);
    let outcome = run(&case, &RUN);
    let has_remark =
        outcome.contains("of the label does not have the form") || outcome.contains(&lost);
    assert!(!has_remark, "{outcome}");
}

#[test]
fn control_characters_of_paths_do_not_reach_the_terminal() {
    let case = Case::new();
    let name = "\u{1b}[31mred\u{7}";
    let file = format!("kernels/{name}.tm");
    case.write(&file, "no metakernel");
    let text = String::from_utf8(case.read("site.toml")).unwrap();
    let site = text.replace("kernels/nav.tm", r"kernels/\u001b[31mred\u0007.tm");
    case.write(&format!("{name}.toml"), &site);
    let missing = site.replace("red", "gone");
    case.write("missing.toml", missing);
    for site in [
        &*format!("{name}.toml"),
        "missing.toml",
        "\u{1b}[2Jnone.toml",
    ] {
        for command in ["run", "check", "plan"] {
            let outcome = run(&case, &[command, site]);
            let shown = outcome.escape_debug().to_string();
            assert!(
                !outcome.contains(|letter: char| letter.is_control() && letter != '\n'),
                "{shown}"
            );
            assert!(outcome.contains(r"\u{1b}["), "{shown}");
        }
    }
}

/// Runs a command as a user who owns nothing; root may write read-only files.
fn unprivileged(case: &Case, arguments: &str) -> Option<String> {
    let script = format!("exec setpriv --reuid 65534 --clear-groups \"$0\" --quiet {arguments}");
    let mut command = Command::new("sh");
    command.current_dir(case.path(""));
    command
        .args(["-c", &script])
        .arg(env!("CARGO_BIN_EXE_areograph"));
    let possible = Command::new("setpriv")
        .args(["--reuid", "65534", "--clear-groups", "true"])
        .output();
    possible
        .is_ok_and(|output| output.status.success())
        .then(|| case.outcome(command))
}

/// Takes the permission to write from everybody.
fn make_read_only(folder: &Path) {
    let changed = Command::new("chmod")
        .args(["-R", "a+rX,a-w"])
        .arg(folder)
        .status();
    assert!(changed.unwrap().success());
}

#[test]
fn a_run_without_work_needs_no_permission_to_write() {
    let case = Case::new();
    assert!(run(&case, &RUN).starts_with("exit 0\n"));
    make_read_only(&case.path(""));
    let outcome = unprivileged(&case, &RUN.join(" ")).unwrap_or_else(|| run(&case, &RUN));
    let again = Command::new("chmod")
        .args(["-R", "u+w"])
        .arg(case.path(""))
        .status();
    assert!(again.unwrap().success());
    assert!(
        outcome.starts_with("exit 0\ncase: valid; nothing changed"),
        "{outcome}"
    );
    // With work to do the reason is named.
    case.replace("site.toml", "[87.5, 88.5]", "[87.5, 88.4]");
    make_read_only(&case.path(""));
    let outcome = unprivileged(&case, &RUN.join(" "));
    let again = Command::new("chmod")
        .args(["-R", "u+w"])
        .arg(case.path(""))
        .status();
    assert!(again.unwrap().success());
    if let Some(outcome) = outcome {
        assert!(outcome.starts_with("exit 6\n"), "{outcome}");
        assert!(outcome.contains("Permission denied"), "{outcome}");
    }
}
