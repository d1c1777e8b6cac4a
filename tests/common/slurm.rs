//! A cluster of Slurm on virtual nodes, and stand-ins for its programs, which run tasks as processes of this machine.

use std::{
    env, fs,
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
    process::Command,
};

use super::{checkout, mission::succeed};

/// Starts or stops Slurm on four virtual nodes.
pub(crate) fn virtual_cluster(action: &str, folder: &Path) {
    let mut slurm = Command::new(checkout().join("scripts/slurm"));
    succeed(slurm.arg(action).arg(folder));
}

/// Writes programs for a shell, and gives them `$state`, their folder.
pub(crate) fn write_programs(folder: &Path, programs: &[(&str, &str)]) {
    fs::create_dir_all(folder).unwrap();
    for (name, text) in programs {
        let path = folder.join(name);
        let state = folder.display();
        fs::write(&path, format!("#!/bin/sh\nstate='{state}'\n{text}\n")).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }
}

/// Programs with the names of Slurm's in a new folder, which has their state: `jobs`, the number of arrays; `memory`, the memory of
/// each; `cancelled`. The first task of the first job is lost.
pub(crate) fn cluster(folder: &Path) -> PathBuf {
    let programs = [
        (
            "sbatch",
            r#"job=$(($(cat "$state/jobs" 2>/dev/null || echo 0) + 1)); echo "$job" >"$state/jobs"
for option; do
  case $option in
    --array=*) last=${option#--array=0-} ;;
    --mem=*) echo "${option#--mem=}" >>"$state/memory" ;;
    --wrap=*) wrap=${option#--wrap=} ;;
  esac
done
for task in $(seq 0 "$last"); do
  [ "$job-$task" = 1-0 ] && continue
  (SLURM_ARRAY_TASK_ID=$task sh -c "$wrap" </dev/null >/dev/null 2>&1 & echo "$task $!" >>"$state/tasks-$job")
done
echo "$job;cluster""#,
        ),
        (
            "squeue",
            r#"for option; do case $option in --jobs=*) job=${option#--jobs=} ;; esac; done
[ -e "$state/tasks-$job" ] || exit 0
while read -r task process; do kill -0 "$process" 2>/dev/null && echo "$task"; done <"$state/tasks-$job"
exit 0"#,
        ),
        (
            "scancel",
            r#"echo "$*" >>"$state/cancelled"
for job; do :; done
while read -r task process; do kill "$process" 2>/dev/null; done <"$state/tasks-$job"
exit 0"#,
        ),
    ];
    write_programs(folder, &programs);
    folder.to_owned()
}

/// The command with these programs before all others.
pub(crate) fn with_programs(mut command: Command, folder: &Path) -> Command {
    let others = env::var_os("PATH").unwrap();
    let paths = [folder.to_owned()].into_iter();
    let all = env::join_paths(paths.chain(env::split_paths(&others))).unwrap();
    command.env("PATH", all);
    command
}
