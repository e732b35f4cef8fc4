//! Embeds the web build (`cargo xtask web`), if there is one, as a table of paths and bytes, plain and compressed.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let manifest = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    let web = manifest.join("../web-viewer/web");
    let dist = web.join("dist");
    println!("cargo::rerun-if-changed=build.rs");
    // Cargo takes a path that is not there for one that changed, at every build; so watch the folder
    // that the web build will appear in.
    let watched = if dist.is_dir() { &dist } else { &web };
    println!("cargo::rerun-if-changed={}", watched.display());

    let mut files = Vec::new();
    if dist.join("index.html").is_file() {
        collect(&dist, "", &mut files)?;
    }
    files.sort();
    let mut table = String::from(
        "/// Path, plain bytes, Zstandard, gzip; the latter two empty where they gain nothing.\n\
         type Stored = (&'static str, &'static [u8], &'static [u8], &'static [u8]);\n\
         pub(super) static FILES: &[Stored] = &[\n",
    );
    for (number, (name, path)) in files.into_iter().enumerate() {
        let path = path.canonicalize()?;
        let plain = fs::read(&path)?;
        let path = path.to_str().ok_or(io::ErrorKind::InvalidFilename)?;
        let _ = write!(table, "    ({name:?}, include_bytes!({path:?})");
        for (extension, bytes) in [
            ("zst", zstd::encode_all(&*plain, 19)?),
            ("gz", gzip(&plain)?),
        ] {
            if bytes.len() < plain.len() * 95 / 100 {
                let path = out.join(format!("{number}.{extension}"));
                fs::write(&path, bytes)?;
                let path = path.to_str().ok_or(io::ErrorKind::InvalidFilename)?;
                let _ = write!(table, ", include_bytes!({path:?})");
            } else {
                table.push_str(", &[]");
            }
        }
        table.push_str("),\n");
    }
    table.push_str("];\n");
    fs::write(out.join("web_build.rs"), table)
}

fn gzip(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()
}

/// Adds all files below `folder` with their paths, `/` between the parts.
fn collect(folder: &Path, prefix: &str, files: &mut Vec<(String, PathBuf)>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') {
            continue;
        }
        if entry.file_type()?.is_dir() {
            collect(&entry.path(), &format!("{prefix}{name}/"), files)?;
        } else {
            files.push((format!("{prefix}{name}"), entry.path()));
        }
    }
    Ok(())
}
