//! Any path: what it names stays below the folder that is served, and is found again under the address that we give.

#![no_main]

#[path = "../../src/source/name.rs"]
#[allow(dead_code, unreachable_pub)]
mod name;
#[path = "../../src/target.rs"]
#[allow(dead_code, unreachable_pub)]
mod target;

use libfuzzer_sys::fuzz_target;
use name::FileName;
use std::path::{Component, Path};
use target::{MAX_PAGES, Target, page_parts, parse_pages, target as target_of};

fuzz_target!(|path: &str| {
    for path in [
        path.to_owned(),
        format!("/files/{path}"),
        format!("/pages/{path}"),
        format!("/api/files/{path}"),
    ] {
        let target = target_of(&path);
        let _ = target.route();
        match target {
            Target::File(name) | Target::Thumbnail(name) => check(&name),
            Target::Pages(path) => {
                if let Some((name, _, pages)) = page_parts(&path) {
                    check(name);
                    if let Ok(pages) = parse_pages(pages) {
                        assert!(pages.start() <= pages.end());
                        assert!(pages.end() - pages.start() < MAX_PAGES);
                    }
                }
            }
            _ => {}
        }
    }
});

fn check(text: &str) {
    let Some(name) = FileName::parse(text) else {
        return;
    };
    let relative = name.relative_path();
    assert!(!relative.contains(['\0', '\\', ':']));
    let below = Path::new(&relative)
        .components()
        .all(|part| matches!(part, Component::Normal(_)));
    assert!(below, "{relative:?}");
    let address = format!("/files/{}.marq", name.escaped());
    match target_of(&address) {
        Target::File(found) => assert_eq!(FileName::parse(&found), Some(name)),
        other => panic!("{address} names {other:?}"),
    }
}
