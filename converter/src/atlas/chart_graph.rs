//! Which charts meet at which sides, and in which order charts are numbered.

use super::patch::Patch;
use glam::DVec3;
use marquetry_format::{ChartId, Glue, Side};

/// Glue of every patch, by side. A border that two sides use glues them; one use is an open border.
pub fn glue(patches: &[Patch], borders: usize) -> Vec<[Option<Glue>; 4]> {
    let mut uses: Vec<Vec<(u32, u8, bool)>> = vec![Vec::new(); borders];
    for (chart, patch) in (0u32..).zip(patches) {
        for (side, &(border, forward)) in (0u8..).zip(&patch.borders) {
            uses[border as usize].push((chart, side, forward));
        }
    }
    let mut glue = vec![[None; 4]; patches.len()];
    for pair in uses {
        if let [a, b] = pair[..] {
            let reversed = a.2 != b.2;
            for (from, to) in [(a, b), (b, a)] {
                glue[from.0 as usize][usize::from(from.1)] = Some(Glue {
                    chart: ChartId(to.0),
                    side: Side(to.1),
                    reversed,
                });
            }
        }
    }
    glue
}

/// Sorts patches along a Hilbert curve through their centres, so that neighbours in space are neighbours in the file.
pub fn sort_along_curve(patches: &mut Vec<Patch>, min: DVec3, size: f64) {
    let mut keyed: Vec<(u64, usize, Patch)> = std::mem::take(patches)
        .into_iter()
        .enumerate()
        .map(|(i, patch)| {
            let centre =
                patch.positions.iter().sum::<DVec3>() / patch.positions.len().max(1) as f64;
            (hilbert_key((centre - min) / size), i, patch)
        })
        .collect();
    keyed.sort_by_key(|&(key, i, _)| (key, i));
    patches.extend(keyed.into_iter().map(|(_, _, patch)| patch));
}

const CURVE_BITS: u32 = 10;

/// Place along a Hilbert curve through the unit cube (Skilling, "Programming the Hilbert curve", 2004).
pub(crate) fn hilbert_key(p: DVec3) -> u64 {
    let cells = f64::from(1u32 << CURVE_BITS);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the grid"
    )]
    let mut x = p
        .to_array()
        .map(|c| (c * cells).clamp(0.0, cells - 1.0) as u32);
    let mut q = 1 << (CURVE_BITS - 1);
    while q > 1 {
        let low = q - 1;
        for i in 0..3 {
            if x[i] & q != 0 {
                x[0] ^= low;
            } else {
                let t = (x[0] ^ x[i]) & low;
                x[0] ^= t;
                x[i] ^= t;
            }
        }
        q >>= 1;
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut t = 0;
    let mut q = 1 << (CURVE_BITS - 1);
    while q > 1 {
        if x[2] & q != 0 {
            t ^= q - 1;
        }
        q >>= 1;
    }
    let x = x.map(|c| c ^ t);
    (0..CURVE_BITS).rev().fold(0, |key, bit| {
        x.iter()
            .fold(key, |key, c| key << 1 | u64::from(c >> bit & 1))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_on_the_curve_are_neighbours_in_space() {
        let n = 8;
        let mut cells: Vec<(u64, [i32; 3])> = (0..n * n * n)
            .map(|i| {
                let c = [i % n, i / n % n, i / n / n];
                let p = DVec3::from_array(c.map(|c| (f64::from(c) + 0.5) / f64::from(n)));
                (hilbert_key(p), c)
            })
            .collect();
        cells.sort_unstable();
        for w in cells.windows(2) {
            let steps: i32 = (0..3).map(|i| (w[0].1[i] - w[1].1[i]).abs()).sum();
            assert_eq!(steps, 1, "{:?} to {:?}", w[0].1, w[1].1);
        }
    }
}
