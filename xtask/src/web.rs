//! The browser build: wasm, its JavaScript glue, and the hand-written page, into `web-viewer/web/dist`.

use crate::setup::{self, Need};
use crate::{ensure, package, process, project::Project, wasm::Toolchain};
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use std::process::Command;
use wasm_bindgen_cli_support::Bindgen;

/// The viewer for one way to draw. A browser fetches one of them.
struct Bundle {
    /// Name of the generated module and the stem of its `.wasm`.
    module: &'static str,
    /// The feature of `marquetry-web`.
    feature: &'static str,
    /// Most bytes that a browser fetches to run the viewer, compressed with brotli.
    budget_bytes: u64,
}

const BUNDLES: [Bundle; 2] = [
    Bundle {
        module: "marquetry_web",
        feature: "webgpu",
        budget_bytes: 900 * 1024,
    },
    // The browser does not translate shaders and check calls for it: wgpu does.
    Bundle {
        module: "marquetry_webgl2",
        feature: "webgl2",
        budget_bytes: 1000 * 1024,
    },
];

/// The name that cargo gives the module.
pub(crate) const CRATE: &str = "marquetry_web";

/// Folders below `web-viewer/web` whose files are served as they are.
const STATIC: [&str; 2] = ["js", "page"];

/// Sets up, builds, and checks the size.
///
/// # Errors
/// When a tool is missing and cannot be installed, the build fails, or the result exceeds its budget.
pub(crate) fn build(project: &Project) -> Result<()> {
    setup::ensure(&[Need::Compiler, Need::Wasm])?;
    let toolchain = Toolchain::find().context("no compiler for wasm32")?;
    println!("  compiling for the browser with {}", toolchain.describe());
    let dist = project.dist();
    std::fs::create_dir_all(&dist).with_context(|| format!("cannot make {}", dist.display()))?;
    for bundle in &BUNDLES {
        let wasm = compile(project, &toolchain, bundle.feature)?;
        bind(project, bundle, &wasm, &dist)?;
    }
    copy_static(project, &dist)?;
    for bundle in &BUNDLES {
        check_size(bundle, &dist)?;
    }
    package::assemble(project)
}

/// Where cargo puts what `toolchain` builds. Two compilers never share a folder.
pub(crate) fn target(project: &Project, toolchain: &Toolchain) -> PathBuf {
    project.target.join(match toolchain {
        Toolchain::Rustup => "web",
        Toolchain::Debian { .. } => "web-debian",
    })
}

/// The module with these features, before any glue.
pub(crate) fn compile(project: &Project, toolchain: &Toolchain, features: &str) -> Result<PathBuf> {
    let target = target(project, toolchain);
    process::run(
        toolchain
            .cargo(&project.root, "build")
            .args([
                "--profile",
                "web",
                "--package",
                "marquetry-web",
                "--no-default-features",
                "--features",
                features,
                "--target-dir",
            ])
            .arg(&target),
    )?;
    Ok(target
        .join(crate::wasm::TARGET)
        .join("web")
        .join(format!("{CRATE}.wasm")))
}

fn bind(project: &Project, bundle: &Bundle, wasm: &Path, dist: &Path) -> Result<()> {
    let module = bundle.module;
    let bytes = std::fs::read(wasm).with_context(|| format!("cannot read {}", wasm.display()))?;
    let stamp_path = project.target.join(format!("{module}-bound"));
    let stamp = format!("{} {:016x}\n", bytes.len(), fnv1a(&bytes));
    let bound = dist.join(format!("{module}_bg.wasm"));
    if bound.is_file() && std::fs::read_to_string(&stamp_path).is_ok_and(|old| old == stamp) {
        return Ok(());
    }
    println!("  generating {module}.js");
    let mut bindgen = Bindgen::new();
    bindgen
        .input_bytes(module, bytes)
        .out_name(module)
        .typescript(false);
    bindgen
        .remove_name_section(true)
        .remove_producers_section(true);
    bindgen
        .web(true)
        .and_then(|bindgen| bindgen.generate(dist))
        .context("wasm-bindgen")?;
    std::fs::write(&stamp_path, stamp)
        .with_context(|| format!("cannot write {}", stamp_path.display()))
}

fn copy_static(project: &Project, dist: &Path) -> Result<()> {
    for folder in STATIC {
        let folder = project.root.join("web-viewer/web").join(folder);
        let entries = std::fs::read_dir(&folder)
            .with_context(|| format!("cannot list {}", folder.display()))?;
        for entry in entries {
            let from = entry.context("cannot list a folder")?.path();
            let Some(name) = from.file_name().filter(|name| *name != "package.json") else {
                continue;
            };
            let to = dist.join(name);
            let bytes =
                std::fs::read(&from).with_context(|| format!("cannot read {}", from.display()))?;
            // An untouched file keeps its time, so that what embeds it is not built again.
            if std::fs::read(&to).ok().as_ref() != Some(&bytes) {
                std::fs::write(&to, bytes)
                    .with_context(|| format!("cannot write {}", to.display()))?;
            }
        }
    }
    Ok(())
}

/// Prints the sizes of what a browser fetches with `bundle`; node, where it is there, says what they are on the wire.
fn check_size(bundle: &Bundle, dist: &Path) -> Result<()> {
    let is_others = |file: &PathBuf| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        (BUNDLES.iter())
            .filter(|other| other.module != bundle.module)
            .any(|other| {
                [
                    format!("{}.js", other.module),
                    format!("{}_bg.wasm", other.module),
                ]
                .contains(&name.to_string())
            })
    };
    let mut files = files_of(dist)?;
    files.retain(|file| !is_others(file));
    let mut raw = 0;
    for file in &files {
        raw += file
            .metadata()
            .with_context(|| format!("cannot read {}", file.display()))?
            .len();
    }
    if process::find("node").is_none() {
        println!(
            "  viewer, {}: {} KiB (node is not here to say how much with brotli)",
            bundle.feature,
            raw / 1024
        );
        return Ok(());
    }
    let script = "const zlib = require('node:zlib'), fs = require('node:fs');\
        let total = 0;\
        for (const file of process.argv.slice(1)) {\
          const bytes = fs.readFileSync(file);\
          const params = { [zlib.constants.BROTLI_PARAM_QUALITY]: 9 };\
          total += zlib.brotliCompressSync(bytes, { params }).length;\
        }\
        console.log(total);";
    let total = process::output(Command::new("node").args(["-e", script]).args(&files))?;
    let total: u64 = total.trim().parse().context("node printed no number")?;
    println!(
        "  viewer, {}: {} KiB, {} KiB with brotli (budget {} KiB)",
        bundle.feature,
        raw / 1024,
        total / 1024,
        bundle.budget_bytes / 1024
    );
    ensure(total <= bundle.budget_bytes, || {
        format!(
            "the viewer with {} takes {total} bytes, its budget is {}",
            bundle.feature, bundle.budget_bytes
        )
    })
}

fn files_of(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in
        std::fs::read_dir(folder).with_context(|| format!("cannot list {}", folder.display()))?
    {
        let path = entry.context("cannot list a folder")?.path();
        if path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Fowler–Noll–Vo hash, 64 bits: tells builds apart, guards against nothing.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hash_matches_the_published_values() {
        assert_eq!(fnv1a(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv1a(b"a"), 0xaf63_dc4c_8601_ec8c);
    }
}
