//! How fast files decode, here and in wasm.

use crate::setup::{self, Need};
use crate::{ensure, process, project::Project, wasm::Toolchain, web};
use anyhow::{Context, Result};
use std::path::Path;
use std::process::Command;
use wasm_bindgen_cli_support::Bindgen;

/// Prints a table of millions of samples of charts and vertices of clusters decoded in a second on one thread, natively and in node's wasm.
///
/// # Errors
/// When something is missing, a build fails, or a file does not decode.
pub(crate) fn run(project: &Project, files: &[&str]) -> Result<()> {
    ensure(!files.is_empty(), || "bench-decode takes files".to_owned())?;
    setup::ensure(&[Need::Compiler, Need::Wasm, Need::Node])?;
    let native = process::output(
        process::cargo(&project.root)
            .args(["run", "--release", "--package", "marquetry-web"])
            .args(["--features", "bench", "--example", "decoding", "--"])
            .args(files),
    )?;
    let toolchain = Toolchain::find().context("no compiler for wasm32")?;
    let wasm = web::compile(project, &toolchain, "webgpu,bench")?;
    let folder = project.target.join("bench-decode");
    Bindgen::new()
        .input_path(&wasm)
        .typescript(false)
        .nodejs(true)
        .and_then(|bindgen| bindgen.generate(&folder))
        .context("wasm-bindgen")?;
    let in_wasm = process::output(
        Command::new("node")
            .arg(project.root.join("web-viewer/web/bench/decoding.cjs"))
            .arg(folder.join(format!("{}.js", web::CRATE)))
            .args(files),
    )?;
    println!("| file | decoded | native, millions a second | wasm |");
    println!("|---|---|---|---|");
    for ((file, native), wasm) in files.iter().zip(native.lines()).zip(in_wasm.lines()) {
        let name = Path::new(file).file_name().unwrap_or_default().display();
        let both = [read(native)?, read(wasm)?];
        for (what, native, wasm) in [
            ("samples", both[0][0], both[1][0]),
            ("vertices", both[0][1], both[1][1]),
        ] {
            ensure(native.count == wasm.count, || {
                format!("{file}: {native:?} natively, {wasm:?} in wasm")
            })?;
            if native.count > 0 {
                let [native_rate, wasm_rate] = [native, wasm].map(Decoded::millions_a_second);
                let count = native.count;
                println!("| {name} | {count} {what} | {native_rate:.1} | {wasm_rate:.1} |");
            }
        }
    }
    Ok(())
}

/// What was decoded, and how long that took.
#[derive(Debug, Clone, Copy)]
struct Decoded {
    count: u64,
    seconds: f64,
}

impl Decoded {
    fn millions_a_second(self) -> f64 {
        // Less than 2^53.
        self.count as f64 / self.seconds / 1e6
    }
}

/// Samples and vertices, a line of the programs that are run.
fn read(line: &str) -> Result<[Decoded; 2]> {
    let mut words = line.split(' ');
    let mut next = || {
        let count = words.next()?.parse().ok()?;
        let seconds = words.next()?.parse().ok()?;
        Some(Decoded { count, seconds })
    };
    next()
        .zip(next())
        .map(<[Decoded; 2]>::from)
        .with_context(|| format!("{line:?} is not two counts with their seconds"))
}
