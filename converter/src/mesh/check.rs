//! What [`ManifoldMesh`] promises, checked.

use super::adjacency::{EdgeTable, apex, end, next, previous, start};
use super::{ManifoldMesh, NONE};

impl ManifoldMesh {
    /// Checks every property that later stages rely on: array lengths, ids in range, finite positions, unit normals, twins symmetric and
    /// opposite, one fan a vertex, no two edges with the same ends, no two triangles with the same corners.
    ///
    /// # Errors
    /// A sentence about the first property that does not hold.
    pub fn check(&self) -> Result<(), String> {
        self.check_arrays()?;
        self.check_twins()?;
        self.check_fans()?;
        self.check_simplicial()
    }

    fn check_arrays(&self) -> Result<(), String> {
        let n = self.positions.len();
        if self.origin.len() != n
            || self.normals.len() != n
            || ![0, n].contains(&self.colours.len())
        {
            return Err("vertex arrays differ in length".to_owned());
        }
        if self.twins.len() != 3 * self.triangles.len() {
            return Err("there is not one twin a half-edge".to_owned());
        }
        for (v, (p, normal)) in self.positions.iter().zip(&self.normals).enumerate() {
            if !p.is_finite() || (normal.length() - 1.0).abs() > 1e-9 {
                return Err(format!("vertex {v} has position {p} and normal {normal}"));
            }
        }
        for (t, &[a, b, c]) in self.triangles.iter().enumerate() {
            if a.max(b).max(c) as usize >= n || a == b || b == c || c == a {
                return Err(format!("triangle {t} has corners {a}, {b}, {c} of {n}"));
            }
        }
        let mut first = vec![NONE; n];
        for (v, &o) in (0_u32..).zip(&self.origin) {
            let slot = first
                .get_mut(o as usize)
                .ok_or_else(|| format!("vertex {v} has origin {o}"))?;
            if *slot == NONE {
                *slot = v;
            } else if self.positions[*slot as usize] != self.positions[v as usize] {
                return Err(format!(
                    "vertices {slot} and {v} have one origin and two positions"
                ));
            }
        }
        Ok(())
    }

    fn check_twins(&self) -> Result<(), String> {
        for (h, &twin) in (0_u32..)
            .zip(&self.twins)
            .filter(|(_, twin)| **twin != NONE)
        {
            let back = self.twins.get(twin as usize);
            if back != Some(&h) {
                return Err(format!(
                    "half-edge {h} has twin {twin}, whose twin is {back:?}"
                ));
            }
            let ends = |h| (start(&self.triangles, h), end(&self.triangles, h));
            let (a, b) = ends(h);
            if ends(twin) != (b, a) {
                return Err(format!(
                    "half-edge {h} and its twin {twin} do not run opposite ways"
                ));
            }
        }
        Ok(())
    }

    fn check_fans(&self) -> Result<(), String> {
        let mut corners = vec![0_u32; self.positions.len()];
        for &v in self.triangles.iter().flatten() {
            corners[v as usize] += 1;
        }
        let mut seen = vec![false; self.positions.len()];
        for h in 0..super::adjacency::id(self.twins.len()) {
            let v = start(&self.triangles, h) as usize;
            if std::mem::replace(&mut seen[v], true) {
                continue;
            }
            let mut fan = 0;
            let mut at = h;
            while at != NONE && (at != h || fan == 0) {
                fan += 1;
                at = self.twins[previous(at) as usize];
            }
            if at == NONE {
                at = self.twins[h as usize];
                while at != NONE {
                    fan += 1;
                    at = self.twins[next(at) as usize];
                }
            }
            if fan != corners[v] {
                return Err(format!(
                    "vertex {v} has {} corners, {fan} of them in one fan",
                    corners[v]
                ));
            }
        }
        match seen.iter().position(|s| !s) {
            Some(v) => Err(format!("vertex {v} is not used")),
            None => Ok(()),
        }
    }

    fn check_simplicial(&self) -> Result<(), String> {
        for edge in EdgeTable::new(&self.triangles, self.positions.len()).edges() {
            match *edge {
                [h] if self.twins[h as usize] == NONE => {}
                [g, h] if self.twins[g as usize] == h => {
                    let others = [next(g), previous(g)].map(|i| self.twins[i as usize]);
                    if apex(&self.triangles, g) == apex(&self.triangles, h)
                        && others.iter().all(|&i| i != NONE && i / 3 == h / 3)
                    {
                        return Err(format!(
                            "triangles {} and {} have the same corners",
                            g / 3,
                            h / 3
                        ));
                    }
                }
                _ => {
                    let (a, b) = (
                        start(&self.triangles, edge[0]),
                        end(&self.triangles, edge[0]),
                    );
                    return Err(format!(
                        "{} half-edges join vertices {a} and {b}",
                        edge.len()
                    ));
                }
            }
        }
        Ok(())
    }
}
