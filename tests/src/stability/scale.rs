//! Large meshes within `--memory`.

use super::{Case, Found, Outcome, Part, errors, number};
use crate::{arguments, marquetry, meshes, ply};
use anyhow::{Result, ensure};

/// What the conversion may take.
const MEMORY: u64 = 2 << 30;

pub(super) fn cases() -> Vec<Case> {
    vec![Case {
        part: Part::Scale,
        set: None,
        name: "20 million triangles".to_owned(),
        required: "converts within `--memory 2G`".to_owned(),
        run: Box::new(|_| large().map(Outcome::Met)),
    }]
}

fn large() -> Result<Found> {
    let folder = tempfile::tempdir()?;
    let input = folder.path().join("torus.ply");
    ply::write(&input, &meshes::torus(4500, 2250))?;
    let output = folder.path().join("out.marq");
    let run = arguments![
        "convert",
        &input,
        "-o",
        &output,
        "--memory",
        MEMORY.to_string(),
        "--json",
        "-"
    ];
    let report = marquetry(&run)?.json()?;
    let [rms, largest, bound] = errors(&report)?;
    let resident = number(&report, "/peak_rss_bytes")?;
    ensure!(resident <= MEMORY as f64, "{resident} bytes are resident");
    marquetry(&arguments!["verify", &output])?.succeeded()?;
    Ok(Found {
        words: format!(
            "{} triangles, {:.0} MiB, {:.0} s",
            report["input"]["triangles"],
            resident / f64::from(1 << 20),
            number(&report, "/seconds")?
        ),
        rms_rel: Some(rms),
        largest_rel: Some([largest, bound]),
    })
}
