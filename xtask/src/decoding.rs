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
    println!("| file | samples | vertices | native, millions a second | wasm |");
    println!("|---|---|---|---|---|");
    for ((file, native), wasm) in files.iter().zip(native.lines()).zip(in_wasm.lines()) {
        let [native, wasm] = [Decoded::read(native)?, Decoded::read(wasm)?];
        ensure(native.counts == wasm.counts, || {
            format!(
                "{file}: {:?} natively, {:?} in wasm",
                native.counts, wasm.counts
            )
        })?;
        let name = Path::new(file).file_name().unwrap_or_default();
        let [samples, vertices] = native.counts;
        println!(
            "| {} | {samples} | {vertices} | {:.1} | {:.1} |",
            name.display(),
            native.millions_a_second(),
            wasm.millions_a_second()
        );
    }
    Ok(())
}

/// A line of the programs that are run.
#[derive(Debug)]
struct Decoded {
    counts: [u64; 2],
    seconds: f64,
}

impl Decoded {
    fn read(line: &str) -> Result<Self> {
        let read = || {
            let mut words = line.split(' ');
            let counts = [words.next()?.parse().ok()?, words.next()?.parse().ok()?];
            let seconds = words.next()?.parse().ok()?;
            Some(Self { counts, seconds })
        };
        read().with_context(|| format!("{line:?} is not two counts and seconds"))
    }

    fn millions_a_second(&self) -> f64 {
        // Less than 2^53.
        self.counts.iter().sum::<u64>() as f64 / self.seconds / 1e6
    }
}
