//! Work of simulated workers.

use std::{
    fs,
    io::Write as _,
    path::Path,
    sync::{Arc, atomic::Ordering},
    time::Duration,
};

use areograph_base::body::Body;
use areograph_service::{
    engine::workers::Workers,
    worker::{
        parent::{Ended, Heard, How, WorkerLimits},
        protocol::{
            Answer, CancelWhy, Failure, Hashed, Line, Listed, PlanAnswer, PlannedFile,
            PlannedStage, Probed, RunAnswer, Task, What,
        },
        run_folder::{RUN_RECORD, RunRecord, newest},
        srun::Srun,
    },
};
use areograph_store::manifest::{
    Complaints, ConfigurationEntry, Manifest, ProductEntry, StageEntry, Verdict,
};
use serde_json::json;
use tokio::{sync::watch, time::sleep};

use super::{Fate, World};

/// Simulated workers.
#[derive(Debug, Clone)]
pub(crate) struct Played(pub(crate) Arc<World>);

fn hash(text: &str) -> String {
    blake3::hash(text.as_bytes()).to_hex().to_string()
}

fn answered(answer: Answer) -> Ended {
    Ended {
        how: How::Exited(0),
        answer: Some(Ok(answer)),
        rss_peak_kib: 1000,
    }
}

fn died() -> Ended {
    Ended {
        how: How::Signalled(9),
        answer: None,
        rss_peak_kib: 1000,
    }
}

fn failed(code: u8, text: &str) -> Ended {
    let failure = Failure {
        code,
        busy: false,
        site: None,
        stage: None,
        file: None,
        text: text.to_owned(),
    };
    Ended {
        how: How::Exited(i32::from(code)),
        answer: Some(Err(failure)),
        rss_peak_kib: 1000,
    }
}

impl Workers for Played {
    async fn work(
        &self,
        _srun: Option<&Srun>,
        task: Task,
        _limits: WorkerLimits,
        _log: &Path,
        mut cancel: watch::Receiver<Option<CancelWhy>>,
        heard: impl FnMut(Heard<'_>) + Send,
    ) -> Ended {
        let subject = match &task.what {
            What::Run { site_file, .. } => format!("run {}", site_name(site_file)),
            What::Plan { site_file, .. } => format!("plan {}", site_name(site_file)),
            What::List { roots, .. } => format!("list {}", site_name(&roots[0])),
            What::Hash { files, .. } => format!("hash {}", files.len()),
            What::Probe { files } => format!("probe {}", site_name(&files[0])),
            _ => "diff".to_owned(),
        };
        self.0.started.lock().unwrap().push(subject);
        tokio::select! {
            ended = self.play(&task, heard) => ended,
            Ok(_) = cancel.wait_for(Option::is_some) => failed(130, "interrupted"),
        }
    }
}

fn site_name(path: &Path) -> String {
    path.file_stem().unwrap().to_string_lossy().into_owned()
}

impl Played {
    async fn play(&self, task: &Task, heard: impl FnMut(Heard<'_>) + Send) -> Ended {
        sleep(Duration::from_micros(200)).await;
        match &task.what {
            What::Run { .. } => self.run(task, heard).await,
            What::Plan { site_file, out } => self.plan(site_file, out),
            What::List { roots, into } => self.list(&roots[0], into),
            What::Hash { files, .. } => {
                let read = files.iter().map(|path| {
                    let text = self.0.at(path);
                    Hashed {
                        path: path.clone(),
                        problem: text.is_none().then(|| "it is gone".to_owned()),
                        blake3: text.map(|text| hash(&text)),
                    }
                });
                answered(Answer::Hash {
                    files: read.collect(),
                })
            }
            What::Probe { .. }
                if self
                    .0
                    .lost
                    .fetch_update(Ordering::SeqCst, Ordering::SeqCst, |left| {
                        left.checked_sub(1)
                    })
                    .is_ok() =>
            {
                failed(130, "interrupted")
            }
            What::Probe { files } => {
                let texts: Vec<String> = files
                    .iter()
                    .map(|path| self.0.at(path).unwrap_or_default())
                    .collect();
                if texts.iter().any(|text| text == "crashes CSPICE") {
                    return died();
                }
                let probed = files.iter().zip(&texts).map(|(path, text)| Probed {
                    path: path.clone(),
                    blake3: hash(text),
                    problem: (text == "half").then(|| "it is not whole".to_owned()),
                    coverage: json!(null),
                });
                answered(Answer::Probe {
                    kernels: probed.collect(),
                })
            }
            What::Diff { .. } => answered(Answer::Diff {
                headline: "nothing moved".to_owned(),
                sentences: Vec::new(),
                beyond_limit: false,
            }),
            What::Shots { .. } => failed(1, "not played"),
        }
    }

    fn list(&self, root: &Path, into: &Path) -> Ended {
        // Released at once: `World::at` holds the files when it takes this lock.
        let gone = {
            let away = self.0.away.lock().unwrap();
            away.iter().any(|path| root == Path::new(path))
        };
        let mut lines = Vec::new();
        let files = self.0.files.lock().unwrap();
        let found = files
            .iter()
            .filter(|(path, _)| Path::new(path).starts_with(root) && !gone);
        for (path, (_, identity)) in found {
            lines.push(Listed::File {
                path: path.into(),
                identity: *identity,
            });
        }
        lines.push(Listed::Root {
            path: root.to_owned(),
            device: Some(1),
            files: lines.len() as u64,
            problem: gone.then(|| "there is nothing mounted".to_owned()),
        });
        let mut bytes = Vec::new();
        for line in &lines {
            serde_json::to_writer(&mut bytes, line).unwrap();
            bytes.push(b'\n');
        }
        fs::write(into, bytes).unwrap();
        answered(Answer::List {
            files: lines.len() as u64 - 1,
        })
    }

    fn plan(&self, site_file: &Path, out: &Path) -> Ended {
        let product = match product(&self.0, site_file) {
            Ok(product) => product,
            Err(missing) => return failed(4, &missing),
        };
        let working = out.join(site_name(site_file));
        let runs =
            manifest(&working).is_none_or(|stands| stands.stages[0].fingerprint != hash(&product));
        let files = inputs(&self.0, site_file)
            .into_iter()
            .chain([site_file.to_owned()]);
        let files = files.map(|path| PlannedFile {
            blake3: hash(&self.0.at(&path).unwrap_or_default()),
            path,
        });
        answered(Answer::Plan(PlanAnswer {
            config_blake3: hash(&fs::read_to_string(site_file).unwrap_or_default()),
            stages: vec![PlannedStage {
                stage: "publish".to_owned(),
                runs,
                because: "something changed".to_owned(),
            }],
            files: files.collect(),
            bounds_deg: None,
            body: Body::Mars,
        }))
    }

    async fn run(&self, task: &Task, mut heard: impl FnMut(Heard<'_>) + Send) -> Ended {
        let What::Run {
            site_file,
            out,
            runs,
            run,
            ..
        } = &task.what
        else {
            return died();
        };
        let site = site_name(site_file);
        let always = self.0.fate_of.lock().unwrap().get(&site).copied();
        let next = || self.0.fates.lock().unwrap().pop();
        let fate = always.or_else(next).unwrap_or(Fate::Works);
        heard(Heard::Line(&Line::Hello {
            v: 1,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            pid: 1,
        }));
        sleep(Duration::from_micros(300)).await;
        heard(Heard::Line(&Line::Stage {
            stage: "publish".to_owned(),
            state: "running".to_owned(),
            because: String::new(),
            seconds: 0.0,
        }));
        match fate {
            Fate::DiesEarly => return died(),
            Fate::Io => return failed(6, "cannot read: input/output error"),
            Fate::Lasts => std::future::pending().await,
            _ => {}
        }
        let product = match product(&self.0, site_file) {
            Ok(product) => product,
            Err(missing) => return failed(4, &missing),
        };
        sleep(Duration::from_micros(300)).await;
        let working = out.join(&site);
        publish(&working, &site, &product, self.0.clock.now_ms());
        sleep(Duration::from_micros(300)).await;
        if fate == Fate::DiesPublished {
            return died();
        }
        let kept = self.keep(task, &working, runs, run);
        sleep(Duration::from_micros(300)).await;
        if fate == Fate::DiesUnheard {
            return died();
        }
        let bytes = fs::read(working.join("manifest.json")).unwrap();
        answered(Answer::Run(RunAnswer {
            run: kept.then(|| run.clone()),
            manifest_blake3: blake3::hash(&bytes).to_hex().to_string(),
            valid: true,
            verdict: "valid".to_owned(),
            reasons: Vec::new(),
            ran: Vec::new(),
        }))
    }

    /// Keeps the content of the working folder as a run, unless the newest run equals it.
    fn keep(&self, task: &Task, working: &Path, runs: &Path, run: &str) -> bool {
        let bytes = fs::read(working.join("manifest.json")).unwrap();
        let stands = newest(runs).and_then(|newest| fs::read(newest.join("manifest.json")).ok());
        if stands.as_ref() == Some(&bytes) {
            return false;
        }
        let partial = runs.join(format!("{run}.partial"));
        let _ = fs::remove_dir_all(&partial);
        fs::create_dir_all(&partial).unwrap();
        fs::copy(working.join("product.txt"), partial.join("product.txt")).unwrap();
        let record = RunRecord {
            run: run.to_owned(),
            job: task.job,
            attempt: task.attempt,
            manifest_blake3: blake3::hash(&bytes).to_hex().to_string(),
        };
        let record = serde_json::to_vec(&record).unwrap();
        fs::write(partial.join(RUN_RECORD), record).unwrap();
        fs::write(partial.join("manifest.json"), &bytes).unwrap();
        fs::rename(&partial, runs.join(run)).unwrap();
        self.0.kept.lock().unwrap().push((task.job, task.attempt));
        true
    }
}

/// Kernels that a site file names.
fn inputs(world: &World, site_file: &Path) -> Vec<std::path::PathBuf> {
    let text = fs::read_to_string(site_file).unwrap_or_default();
    let table: toml::Table = text.parse().unwrap();
    let files = table["kernels"]["files"].as_array().unwrap();
    let name = |file: &toml::Value| file.as_str().unwrap().trim_start_matches("../").to_owned();
    files.iter().map(|file| world.path(&name(file))).collect()
}

/// The product of a site, which lists its inputs; otherwise the missing kernel.
pub(crate) fn product(world: &World, site_file: &Path) -> Result<String, String> {
    let mut product = format!("{}\n", site_name(site_file));
    for path in inputs(world, site_file) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let text = world.at(&path).ok_or(format!("there is no {name}"))?;
        product = format!("{product}{name} {text}\n");
    }
    Ok(product)
}

fn manifest(folder: &Path) -> Option<Manifest> {
    serde_json::from_slice(&fs::read(folder.join("manifest.json")).ok()?).ok()
}

/// Publishes a product if it differs.
fn publish(working: &Path, site: &str, product: &str, now_ms: i64) {
    fs::create_dir_all(working).unwrap();
    if manifest(working).is_some_and(|stands| stands.stages[0].fingerprint == hash(product)) {
        return;
    }
    // Under a new name: links of earlier runs keep their bytes.
    let write = |name: &str, bytes: &[u8]| {
        let fresh = working.join(format!(".{name}"));
        let mut file = fs::File::create(&fresh).unwrap();
        file.write_all(bytes).unwrap();
        fs::rename(fresh, working.join(name)).unwrap();
    };
    write("product.txt", product.as_bytes());
    let manifest = Manifest {
        tool: "areograph".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        site: site.to_owned(),
        verdict: Verdict {
            valid: true,
            reasons: Vec::new(),
            remarks: Vec::new(),
            untested: Vec::new(),
            checks: Vec::new(),
        },
        configuration: ConfigurationEntry {
            file_name: format!("{site}.toml"),
            blake3: hash(""),
            keys: [].into(),
        },
        biases: Vec::new(),
        kernels: Vec::new(),
        kernel_choice: Vec::new(),
        stages: vec![StageEntry {
            name: "publish".to_owned(),
            fingerprint: hash(product),
        }],
        products: vec![ProductEntry {
            path: "product.txt".to_owned(),
            bytes: product.len() as u64,
            blake3: hash(product),
            rows: 1,
        }],
        counts: [].into(),
        figures: [].into(),
        rejected: [].into(),
        complaints: Complaints {
            count: 0,
            texts: Vec::new(),
        },
        notes: Vec::new(),
        finished_utc: areograph_service::clock::utc_text(now_ms),
    };
    write("manifest.json", &serde_json::to_vec(&manifest).unwrap());
}
