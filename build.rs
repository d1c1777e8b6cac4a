//! Links the shared CSPICE library where `scripts/bootstrap` installed one.
//!
//! `cspice-sys` itself asks for a static `libcspice.a`. When `$CSPICE_DIR/lib` holds a shared
//! library beside it, that archive is an empty placeholder and the symbols come from here.

use std::{env, path::PathBuf};

fn main() {
    println!("cargo:rerun-if-env-changed=CSPICE_DIR");
    let Some(directory) = env::var_os("CSPICE_DIR").map(PathBuf::from) else {
        return;
    };
    let library = directory.join("lib");
    println!(
        "cargo:rerun-if-changed={}",
        library.join("libcspice.so").display()
    );
    if library.join("libcspice.so").is_file() {
        println!("cargo:rustc-link-search=native={}", library.display());
        println!("cargo:rustc-link-lib=dylib=cspice");
        println!("cargo:rustc-link-arg=-Wl,-rpath,{}", library.display());
    }
}
