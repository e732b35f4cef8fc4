//! `decoding FILE...`: samples of charts of each file, the median seconds that decoding all of them takes on one thread, and the same of vertices of clusters.

#![expect(clippy::print_stdout, reason = "its output")]

use marquetry_format::Error;
use marquetry_web::whole::Whole;
use std::time::{Duration, Instant};

/// How long each is decoded again and again, at least.
const FOR: Duration = Duration::from_secs(2);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for file in std::env::args().skip(1) {
        let whole = Whole::open(std::fs::read(&file)?)?;
        let (samples, charts) = timed(|| whole.decode_charts())?;
        let (vertices, clusters) = timed(|| whole.decode_clusters())?;
        println!("{samples} {charts} {vertices} {clusters}");
    }
    Ok(())
}

/// What `decode` gives, and its median seconds.
fn timed(decode: impl Fn() -> Result<usize, Error>) -> Result<(usize, f64), Error> {
    let decoded = decode()?;
    let (start, mut times) = (Instant::now(), Vec::new());
    while start.elapsed() < FOR {
        let before = Instant::now();
        assert_eq!(decode()?, decoded);
        times.push(before.elapsed().as_secs_f64());
    }
    times.sort_unstable_by(f64::total_cmp);
    Ok((decoded, times[times.len() / 2]))
}
