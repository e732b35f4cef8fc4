//! The picture of the model from `convert` to the catalogue.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on ends here")]

use marquetry_format::thumbnail;
use marquetry_tests::server::Server;
use marquetry_tests::{arguments, http, marquetry, meshes, ply};
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

/// The catalogue's only entry.
fn entry(server: &Server) -> Value {
    let answer = http::get(&server.authority, "/api/catalogue", &[]).unwrap();
    let catalogue: Value = serde_json::from_slice(&answer.body).unwrap();
    assert_eq!(catalogue["files"].as_array().unwrap().len(), 1);
    catalogue["files"][0].clone()
}

fn picture_bytes(file: &Path) -> u64 {
    let info = marquetry(&arguments!["info", file, "--json", "-"]).unwrap();
    info.json().unwrap()["bytes"]["thumbnail"].as_u64().unwrap()
}

#[test]
fn what_convert_draws_is_verified_and_served() {
    let folder = TempDir::new().unwrap();
    let input = folder.path().join("torus.ply");
    ply::write(&input, &meshes::torus(120, 60)).unwrap();
    let out = folder.path().join("torus.marq");
    let convert = arguments!["convert", &input, "-o", &out];
    marquetry(&convert).unwrap().succeeded().unwrap();
    let verify = |file: &Path| marquetry(&arguments!["verify", file, "--json", "-"]).unwrap();
    verify(&out).succeeded().unwrap();

    let bytes = std::fs::read(&out).unwrap();
    let length = usize::try_from(picture_bytes(&out)).unwrap();
    assert!((500..6000).contains(&length), "{length}");
    let picture = &bytes[bytes.len() - length..];
    let server = Server::start(&[&out]).unwrap();
    let url = entry(&server)["thumbnail_url"].as_str().unwrap().to_owned();
    let answer = http::get(&server.authority, &url, &[]).unwrap();
    assert_eq!(answer.status, 200);
    assert_eq!(answer.header("content-type"), Some("image/webp"));
    assert!(answer.body == picture);
    let decoded = thumbnail::decode(picture).unwrap();
    assert_eq!((decoded.width, decoded.height), (256, 192));
    let page = http::get(&server.authority, "/catalogue", &[]).unwrap();
    assert!(String::from_utf8(page.body).unwrap().contains(&url));

    let damaged = folder.path().join("damaged.marq");
    let mut wrong = bytes.clone();
    wrong[bytes.len() - length / 2] ^= 4;
    std::fs::write(&damaged, wrong).unwrap();
    let found = verify(&damaged);
    assert_eq!(found.code, Some(1), "{}", found.stdout);
    let report: Value = serde_json::from_str(&found.stdout).unwrap();
    let failed = |check: &&Value| check["ok"] == Value::Bool(false);
    let failed: Vec<&Value> = report["checks"]
        .as_array()
        .unwrap()
        .iter()
        .filter(failed)
        .collect();
    assert!(
        failed
            .iter()
            .any(|check| check["name"] == "section checksums"),
        "{report}"
    );
}

#[test]
fn a_file_may_go_without_a_picture() {
    let folder = TempDir::new().unwrap();
    let input = folder.path().join("torus.ply");
    ply::write(&input, &meshes::torus(120, 60)).unwrap();
    let out = folder.path().join("torus.marq");
    let convert = arguments!["convert", &input, "-o", &out, "--no-thumbnail"];
    marquetry(&convert).unwrap().succeeded().unwrap();
    marquetry(&arguments!["verify", &out])
        .unwrap()
        .succeeded()
        .unwrap();
    assert_eq!(picture_bytes(&out), 0);
    let server = Server::start(&[&out]).unwrap();
    assert!(entry(&server)["thumbnail_url"].is_null());
}
