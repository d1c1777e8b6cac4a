//! The ledger: what it holds, and what it lets pass.

use std::fmt::Write as _;

/// Of one stage in one scene, what it was given and what it made of that.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Row {
    /// Name of the stage.
    pub(crate) stage: String,
    /// Type of the stage, or the file of a step that is none.
    pub(crate) declared: String,
    /// The scene.
    pub(crate) scene: String,
    /// Number of the method.
    pub(crate) method: u32,
    /// BLAKE3 of the inputs, but for that number.
    pub(crate) inputs: String,
    /// BLAKE3 of the outputs.
    pub(crate) output: String,
}

/// What a row is against that of the ledger.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Standing {
    /// The same.
    Same,
    /// The ledger is to be written anew: what differs is explained.
    Anew(String),
    /// Another output of the same inputs under the same number, or a lower number.
    Forgotten(String),
}

/// The committed file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Ledger {
    /// Arithmetic of the machine that wrote it.
    pub(crate) arithmetic: String,
    /// Rows, sorted.
    pub(crate) rows: Vec<Row>,
}

const HEAD: &str = "# What every stage computes of fixed scenes, under which METHOD; tests/products/methods.rs writes and explains it.\n";
const ARITHMETIC: &str = "# arithmetic: ";
const COLUMNS: &str = "stage,declared,scene,method,inputs,output\n";

impl Row {
    fn is_of(&self, other: &Self) -> bool {
        (&self.declared, &self.scene) == (&other.declared, &other.scene)
    }

    /// How this row, made just now, stands against an earlier one.
    pub(crate) fn against(&self, earlier: Option<&Self>) -> Standing {
        let Self {
            stage,
            declared,
            scene,
            method,
            ..
        } = self;
        let name = format!("stage {stage} ({declared}) in the scene `{scene}`");
        let Some(earlier) = earlier else {
            return Standing::Anew(format!("{name} has no row"));
        };
        if *method < earlier.method {
            return Standing::Forgotten(format!(
                "{name}: METHOD is {method}, lower than {} of the ledger: numbers only rise",
                earlier.method
            ));
        }
        let (inputs, output) = (self.inputs == earlier.inputs, self.output == earlier.output);
        if inputs && !output && *method == earlier.method {
            return Standing::Forgotten(format!(
                "{name} computes something else from the same inputs under the same METHOD {method}: stored outputs would be \
                 taken as unchanged; raise METHOD of {declared} to {}, or of the stage it calls that changed",
                method + 1
            ));
        }
        match (*method == earlier.method, inputs, output) {
            (true, true, true) => Standing::Same,
            (false, ..) => Standing::Anew(format!(
                "{name}: METHOD is {method}, {} in the ledger",
                earlier.method
            )),
            (true, false, _) => Standing::Anew(format!("{name} is given other inputs")),
            (true, true, false) => Standing::Anew(format!("{name} makes another output")),
        }
    }
}

impl Ledger {
    /// Reads the file.
    pub(crate) fn read(text: &str) -> Self {
        let arithmetic = text.lines().find_map(|line| line.strip_prefix(ARITHMETIC));
        let rows = text.lines().filter(|line| !line.starts_with('#')).skip(1);
        let row = |line: &str| {
            let cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            let [stage, declared, scene, method, inputs, output] = cells.try_into().unwrap();
            Row {
                stage,
                declared,
                scene,
                method: method.parse().unwrap(),
                inputs,
                output,
            }
        };
        Self {
            arithmetic: arithmetic.unwrap_or_default().to_owned(),
            rows: rows.map(row).collect(),
        }
    }

    /// The text of the file.
    pub(crate) fn written(&self) -> String {
        let mut text = format!("{HEAD}{ARITHMETIC}{}\n{COLUMNS}", self.arithmetic);
        for row in &self.rows {
            writeln!(
                text,
                "{},{},{},{},{},{}",
                row.stage, row.declared, row.scene, row.method, row.inputs, row.output
            )
            .unwrap();
        }
        text
    }

    /// How rows of some scenes, made just now, stand against this ledger; rows of these scenes that nothing makes any more.
    pub(crate) fn compare(&self, rows: &[Row], scenes: &[&str]) -> Vec<Standing> {
        let standing = rows.iter().map(|row| {
            let earlier = self.rows.iter().find(|earlier| earlier.is_of(row));
            row.against(earlier)
        });
        let gone = self.rows.iter().filter(|earlier| {
            scenes.contains(&&*earlier.scene) && rows.iter().all(|row| !row.is_of(earlier))
        });
        let gone = gone.map(|row| {
            let (stage, scene) = (&row.stage, &row.scene);
            Standing::Anew(format!(
                "stage {stage} is not in the scene `{scene}` any more"
            ))
        });
        standing.chain(gone).collect()
    }

    /// The ledger with the rows of these scenes in place of the earlier ones.
    ///
    /// # Errors
    /// What must not be written: what [`Standing::Forgotten`] says.
    pub(crate) fn with(&self, rows: &[Row], scenes: &[&str]) -> Result<Self, Vec<String>> {
        let forgotten = self.compare(rows, scenes).into_iter();
        let forgotten: Vec<String> = forgotten
            .filter_map(|standing| match standing {
                Standing::Forgotten(why) => Some(why),
                Standing::Same | Standing::Anew(_) => None,
            })
            .collect();
        if !forgotten.is_empty() {
            return Err(forgotten);
        }
        let kept = self.rows.iter();
        let kept = kept.filter(|row| !scenes.contains(&&*row.scene)).cloned();
        let mut rows: Vec<Row> = kept.chain(rows.iter().cloned()).collect();
        rows.sort();
        Ok(Self {
            arithmetic: self.arithmetic.clone(),
            rows,
        })
    }
}
