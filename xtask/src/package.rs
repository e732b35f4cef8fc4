//! The npm package of the viewer: `target/npm/marquetry-viewer`, ready for `npm pack` or `npm publish`.
//!
//! The element and what it imports, from `web-viewer/web/dist`; what describes the package, from `web-viewer/web/package`.

use crate::{ensure, project::Project};
use anyhow::{Context, Result};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// What a page imports.
const ENTRY: &str = "marquetry.js";
/// What the code fetches.
const WASM: [&str; 2] = ["marquetry_web_bg.wasm", "marquetry_webgl2_bg.wasm"];

/// Puts the package together.
///
/// # Errors
/// When a file is missing, or the package's version is not the workspace's.
pub(crate) fn assemble(project: &Project) -> Result<()> {
    let described = project.root.join("web-viewer/web/package");
    let folder = project.target.join("npm/marquetry-viewer");
    match std::fs::remove_dir_all(&folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            return Err(error).with_context(|| format!("cannot empty {}", folder.display()));
        }
        _ => {}
    }
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot make {}", folder.display()))?;
    let mut files: Vec<PathBuf> = modules(&project.dist())?;
    files.extend(WASM.map(|name| project.dist().join(name)));
    for entry in std::fs::read_dir(&described)
        .with_context(|| format!("cannot list {}", described.display()))?
    {
        files.push(entry.context("cannot list a folder")?.path());
    }
    for licence in ["LICENSE-MIT", "LICENSE-APACHE"] {
        files.push(project.root.join(licence));
    }
    for file in &files {
        let name = file.file_name().context("a file without a name")?;
        std::fs::copy(file, folder.join(name))
            .with_context(|| format!("cannot copy {}", file.display()))?;
    }
    let text = read(&folder.join("package.json"))?;
    let package: serde_json::Value =
        serde_json::from_str(&text).context("package.json of the viewer")?;
    let version = package["version"].as_str().unwrap_or_default();
    ensure(version == env!("CARGO_PKG_VERSION"), || {
        format!(
            "web-viewer/web/package/package.json has version {version}, the workspace {}",
            env!("CARGO_PKG_VERSION")
        )
    })?;
    println!("  npm package: {}", folder.display());
    Ok(())
}

/// The entry and every module that it imports, directly or not.
fn modules(dist: &Path) -> Result<Vec<PathBuf>> {
    let mut found = BTreeSet::new();
    let mut open = vec![ENTRY.to_owned()];
    while let Some(name) = open.pop() {
        let path = dist.join(&name);
        if found.insert(path.clone()) {
            open.extend(imports(&read(&path)?));
        }
    }
    Ok(found.into_iter().collect())
}

/// Modules beside it that `source` names in quotes: `from "./x.js"`, `import('./x.js')`, `new URL("./x.js"`.
fn imports(source: &str) -> Vec<String> {
    let begin = |quote: char| {
        let opening = format!("{quote}./");
        source
            .match_indices(&opening)
            .filter_map(|(at, found)| {
                let before = source.get(..at)?.trim_end();
                let is_import = ["from", "import", "import(", "new URL("]
                    .iter()
                    .any(|word| before.ends_with(word));
                let name = source.get(at + found.len()..)?.split(quote).next()?;
                is_import.then(|| name.to_owned())
            })
            .collect::<Vec<_>>()
    };
    [begin('"'), begin('\'')].concat()
}

fn read(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn imports_are_found_in_every_form() {
        let source = "// It isn't in words.\nimport { a } from \"./a.js\";\nawait import(\"./c.js\");\n\
            import './b.js';\nnew Worker(new URL(\"./e.js\", import.meta.url));\nconst no = [\"./d.js\", \"./e.wasm\"];";
        assert_eq!(imports(source), ["a.js", "c.js", "e.js", "b.js"]);
    }
}
