//! Where CSPICE is a shared library, the program looks for it beside itself and in `../lib`; tests and benchmarks, one
//! folder further down, look in their parent.

const RUN_PATHS: [&str; 3] = ["$ORIGIN", "$ORIGIN/../lib", "$ORIGIN/.."];

fn main() {
    // Set by the build script of `areograph-spice`.
    println!("cargo:rerun-if-env-changed=DEP_AREOGRAPH_CSPICE_SHARED");
    if std::env::var_os("DEP_AREOGRAPH_CSPICE_SHARED").is_some() {
        for path in RUN_PATHS {
            println!("cargo:rustc-link-arg=-Wl,-rpath,{path}");
        }
    }
}
