//! `decoding FILE...`: samples of charts and vertices of clusters of each file, and the median seconds that decoding all of them takes on one thread.

#![expect(clippy::print_stdout, reason = "its output")]

use marquetry_web::whole::Whole;
use std::time::{Duration, Instant};

/// How long each file is decoded again and again, at least.
const FOR: Duration = Duration::from_secs(2);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for file in std::env::args().skip(1) {
        let whole = Whole::open(std::fs::read(&file)?)?;
        let decoded = whole.decode()?;
        let (start, mut times) = (Instant::now(), Vec::new());
        while start.elapsed() < FOR {
            let before = Instant::now();
            assert_eq!(whole.decode()?, decoded);
            times.push(before.elapsed().as_secs_f64());
        }
        times.sort_unstable_by(f64::total_cmp);
        let median = times[times.len() / 2];
        println!("{} {} {median}", decoded.samples, decoded.vertices);
    }
    Ok(())
}
