//! A program of `examples`, as built.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The program `name`, the only one that its tests ask for. Plain `cargo test` has built it beside the tests; one test
/// alone would find an old one there, so cargo looks again.
pub(crate) fn program(name: &str) -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let test = std::env::current_exe().unwrap();
        let profile = test.ancestors().nth(2).unwrap();
        if let Some(cargo) = std::env::var_os("CARGO") {
            let release = if cfg!(debug_assertions) { None } else { Some("--release") };
            let build = Command::new(cargo)
                .args(["build", "--quiet", "--example", name])
                .args(release)
                .env("CARGO_TARGET_DIR", profile.parent().unwrap())
                .current_dir(env!("CARGO_MANIFEST_DIR"))
                .status();
            assert!(build.unwrap().success(), "the example builds");
        }
        let path = profile.join("examples").join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
        assert!(path.exists(), "{} is missing: cargo build --release --example {name}", path.display());
        path
    })
}
