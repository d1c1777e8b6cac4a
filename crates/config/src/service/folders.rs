//! Folders of inputs and outputs, which are apart from each other.

use std::path::{Path, PathBuf};

use areograph_store::files::{overlap, real_path};

use super::{Keys, ServiceConfig};

/// Whether a folder of inputs and one of outputs meet.
type Meet = fn(&Path, &Path) -> bool;

/// Outputs of the service must not become inputs: a run would cause the next one.
pub(super) fn outputs_apart(service: &ServiceConfig, keys: &mut Keys<'_, '_>) {
    let (inputs, outputs) = (&service.inputs, &service.outputs);
    // Folders of site files are read without their subfolders.
    let is_below = |input: &Path, output: &Path| real_path(input).starts_with(real_path(output));
    let folders: [(&str, &Vec<PathBuf>, Meet); 3] = [
        ("sites", &inputs.sites, is_below),
        ("kernels", &inputs.kernels, overlap),
        ("data", &inputs.data, overlap),
    ];
    for (name, output) in [("products", &outputs.products), ("state", &outputs.state)] {
        for (input_name, inputs, meet) in &folders {
            let Some(input) = inputs.iter().find(|input| meet(input, output)) else {
                continue;
            };
            let (output, input) = (output.display(), input.display());
            let expected = format!(
                "separate folders for inputs and outputs: {input} (inputs.{input_name}) and {output} \
                 (outputs.{name}) overlap"
            );
            // A default is not in the file.
            if keys.writes("outputs", name) {
                keys.refuse_below("outputs", name, expected);
            } else {
                keys.refuse_below("inputs", input_name, expected);
            }
        }
    }
}
