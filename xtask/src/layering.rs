//! Checks that the crates know only whom `ARCHITECTURE.md` lets them.

use crate::{process, project::Project};
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// How far a rule looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reach {
    /// What the crate's manifest names.
    Direct,
    /// That, and what those depend on in turn.
    Whole,
}

#[derive(Debug)]
struct Rule {
    package: &'static str,
    reach: Reach,
    /// Package names; one that ends with `*` stands for all that begin so.
    forbidden: &'static [&'static str],
    why: &'static str,
}

const RULES: [Rule; 6] = [
    Rule {
        package: "marquetry-format",
        reach: Reach::Whole,
        forbidden: &[
            "tokio",
            "async-std",
            "smol",
            "futures*",
            "axum",
            "hyper",
            "reqwest",
            "wgpu*",
            "naga",
            "winit",
            "ash",
            "meshopt",
            "gltf",
            "tobj",
            "stl_io",
            "ply-rs*",
            "marquetry-*",
        ],
        why: "format knows no async, GPU or mesh crate, and none of ours",
    },
    Rule {
        package: "marquetry-converter",
        reach: Reach::Whole,
        forbidden: &[
            "marquetry-server",
            "marquetry-engine",
            "marquetry-web",
            "marquetry-native",
            "wgpu*",
            "axum",
        ],
        why: "converter, server and engine never see each other",
    },
    Rule {
        package: "marquetry-server",
        reach: Reach::Whole,
        forbidden: &[
            "marquetry-converter",
            "marquetry-engine",
            "marquetry-web",
            "marquetry-native",
            "marquetry-evaluation",
            "wgpu*",
        ],
        why: "converter, server and engine never see each other",
    },
    Rule {
        package: "marquetry-engine",
        reach: Reach::Whole,
        forbidden: &[
            "marquetry-converter",
            "marquetry-server",
            "marquetry-web",
            "marquetry-native",
            "marquetry-evaluation",
            "winit",
            "axum",
            "reqwest",
            "ureq",
        ],
        why: "converter, server and engine never see each other; the engine knows no window",
    },
    Rule {
        package: "marquetry-engine",
        reach: Reach::Direct,
        forbidden: &["web-sys", "js-sys", "wasm-bindgen*", "tokio", "futures*"],
        why: "the engine knows no browser API and no async runtime",
    },
    Rule {
        package: "marquetry-evaluation",
        reach: Reach::Whole,
        forbidden: &["marquetry-*", "wgpu*", "axum", "tokio"],
        why: "evaluation knows arrays, not files",
    },
];

/// Package name → names it depends on, development dependencies left out.
type Graph = BTreeMap<String, BTreeSet<String>>;

/// Checks every rule.
///
/// # Errors
/// When a crate depends on what it may not, with the way to it.
pub(crate) fn check(project: &Project) -> Result<()> {
    let text =
        process::output(process::cargo(&project.root).args(["metadata", "--format-version=1"]))?;
    let metadata: Value = serde_json::from_str(&text).context("cargo metadata is no JSON")?;
    let faults = faults(&graph(&metadata)?, &RULES);
    if !faults.is_empty() {
        bail!("{}", faults.join("\n"));
    }
    println!("  {} rules hold", RULES.len());
    Ok(())
}

fn graph(metadata: &Value) -> Result<Graph> {
    let list = |value: &'_ Value| {
        value
            .as_array()
            .cloned()
            .context("cargo metadata lacks a list")
    };
    let text = |value: &Value| {
        value
            .as_str()
            .map(str::to_owned)
            .context("cargo metadata lacks a name")
    };
    let mut names = BTreeMap::new();
    for package in list(&metadata["packages"])? {
        names.insert(text(&package["id"])?, text(&package["name"])?);
    }
    let name = |id: &Value| -> Result<String> {
        names
            .get(&text(id)?)
            .cloned()
            .context("cargo metadata names an unknown package")
    };
    let mut graph = Graph::new();
    for node in list(&metadata["resolve"]["nodes"])? {
        let known = graph.entry(name(&node["id"])?).or_default();
        for dependency in list(&node["deps"])? {
            let kinds = list(&dependency["dep_kinds"])?;
            if kinds.iter().any(|kind| kind["kind"] != "dev") {
                known.insert(name(&dependency["pkg"])?);
            }
        }
    }
    Ok(graph)
}

fn faults(graph: &Graph, rules: &[Rule]) -> Vec<String> {
    let mut faults = Vec::new();
    for rule in rules {
        if !graph.contains_key(rule.package) {
            faults.push(format!(
                "{}: no such package, but a rule names it",
                rule.package
            ));
        }
        for (name, way) in reachable(graph, rule) {
            if rule.forbidden.iter().any(|pattern| matches(pattern, &name)) {
                faults.push(format!("{}: {}", way.join(" → "), rule.why));
            }
        }
    }
    faults
}

/// Every package that the rule's can reach, with a shortest way there.
fn reachable(graph: &Graph, rule: &Rule) -> BTreeMap<String, Vec<String>> {
    let mut found: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut front = vec![vec![rule.package.to_owned()]];
    while !front.is_empty() {
        let mut next = Vec::new();
        for way in front {
            let Some(known) = way.last().and_then(|name| graph.get(name)) else {
                continue;
            };
            for name in known {
                if name != rule.package && !found.contains_key(name) {
                    let longer: Vec<String> = way.iter().chain([name]).cloned().collect();
                    found.insert(name.clone(), longer.clone());
                    next.push(longer);
                }
            }
        }
        front = if rule.reach == Reach::Whole {
            next
        } else {
            Vec::new()
        };
    }
    found
}

fn matches(pattern: &str, name: &str) -> bool {
    match pattern.strip_suffix('*') {
        Some(start) => name.starts_with(start),
        None => name == pattern,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Graph {
        let entry = |name: &str, known: &[&str]| {
            (
                name.to_owned(),
                known
                    .iter()
                    .map(|name| (*name).to_owned())
                    .collect::<BTreeSet<_>>(),
            )
        };
        Graph::from([
            entry("a", &["b"]),
            entry("b", &["c-gpu"]),
            entry("c-gpu", &["a"]),
        ])
    }

    fn rule(reach: Reach, forbidden: &'static [&'static str]) -> Rule {
        Rule {
            package: "a",
            reach,
            forbidden,
            why: "a test",
        }
    }

    #[test]
    fn a_forbidden_crate_is_found_through_others() {
        let faults = faults(&example(), &[rule(Reach::Whole, &["c*"])]);
        assert_eq!(faults, ["a → b → c-gpu: a test"]);
    }

    #[test]
    fn a_direct_rule_looks_no_further() {
        assert!(faults(&example(), &[rule(Reach::Direct, &["c-gpu"])]).is_empty());
        assert_eq!(faults(&example(), &[rule(Reach::Direct, &["b"])]).len(), 1);
    }

    #[test]
    fn a_rule_for_a_package_that_is_not_there_fails() {
        assert_eq!(
            faults(&Graph::new(), &[rule(Reach::Whole, &["b"])]).len(),
            1
        );
    }

    #[test]
    fn development_dependencies_do_not_count() {
        let metadata = serde_json::json!({
            "packages": [{ "id": "1", "name": "a" }, { "id": "2", "name": "b" }, { "id": "3", "name": "c" }],
            "resolve": { "nodes": [
                { "id": "1", "deps": [
                    { "pkg": "2", "dep_kinds": [{ "kind": "dev" }] },
                    { "pkg": "3", "dep_kinds": [{ "kind": "dev" }, { "kind": null }] },
                ] },
                { "id": "2", "deps": [] },
                { "id": "3", "deps": [] },
            ] },
        });
        let graph = graph(&metadata).unwrap();
        assert_eq!(graph["a"], BTreeSet::from(["c".to_owned()]));
    }
}
