//! The meshes.

use super::soup::{Soup, signed};
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{PI, TAU};

pub(crate) fn triangle() -> Soup {
    Soup {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        triangles: vec![[0, 1, 2]],
    }
}

pub(crate) fn tetrahedron() -> Soup {
    Soup {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    }
}

/// Two triangles with the same corners, back to back.
pub(crate) fn pillow() -> Soup {
    let mut soup = triangle();
    soup.triangles.push([0, 2, 1]);
    soup
}

/// A bumpy sheet of `cells`² cells without those that are `open`.
pub(crate) fn sheet(cells: u32, open: impl Fn(u32, u32) -> bool) -> Soup {
    let side = cells + 1;
    let mut soup = Soup::default();
    for k in 0..side * side {
        let (x, y) = (
            f64::from(k % side) / f64::from(cells),
            f64::from(k / side) / f64::from(cells),
        );
        soup.vertex(DVec3::new(x, y, 0.05 * (7.0 * x).sin() * (5.0 * y).cos()));
    }
    for (i, j) in (0..cells).flat_map(|j| (0..cells).map(move |i| (i, j))) {
        let a = j * side + i;
        if !open(i, j) {
            soup.quad([a, a + 1, a + side + 1, a + side]);
        }
    }
    soup
}

/// A sheet with a triangle on every edge of one side, each hanging by that edge.
pub(crate) fn ears(cells: u32) -> Soup {
    let mut soup = sheet(cells, |_, _| false);
    for i in 0..cells {
        let (a, b) = (soup.positions[i as usize], soup.positions[i as usize + 1]);
        let tip = soup.vertex(a.midpoint(b) - DVec3::Y / f64::from(cells));
        soup.triangles.push([i + 1, i, tip]);
    }
    soup
}

/// One row of triangles, wound round a cylinder with a gap: every inner edge joins two border vertices.
pub(crate) fn strip(count: u32) -> Soup {
    let mut soup = Soup::default();
    for n in 0..count + 2 {
        let angle = 1.8 * PI * f64::from(n) / f64::from(count);
        soup.vertex(DVec3::new(
            angle.cos(),
            angle.sin(),
            0.02 * f64::from(n % 2),
        ));
    }
    for n in 0..count {
        let flip = n % 2;
        soup.triangles.push([n, n + 1 + flip, n + 2 - flip]);
    }
    soup
}

/// A closed plate with `n`² square holes through it.
pub(crate) fn perforated(n: u32) -> Soup {
    let cells = 4 * n + 1;
    let solid = |i: i64, j: i64| {
        let inside = |c: i64| (0..i64::from(cells)).contains(&c);
        let hole = |c: i64| c % 4 == 1 || c % 4 == 2;
        inside(i) && inside(j) && !(hole(i) && hole(j))
    };
    voxels(i64::from(cells), 2, |i, j, _| solid(i, j))
}

/// A ball of cubes, `radius` cubes from the middle.
pub(crate) fn voxel_ball(radius: i64) -> Soup {
    let size = 2 * radius;
    voxels(size, size, |i, j, k| {
        let d = |c: i64| (c - radius) as f64 + 0.5;
        d(i).powi(2) + d(j).powi(2) + d(k).powi(2) < (radius * radius) as f64
    })
}

/// Outer faces of the unit cubes that are `solid`; vertices at one place are one.
fn voxels(size: i64, height: i64, solid: impl Fn(i64, i64, i64) -> bool) -> Soup {
    let filled = |p: [i64; 3]| (0..height).contains(&p[2]) && solid(p[0], p[1], p[2]);
    let mut numbers: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let mut soup = Soup::default();
    for k in 0..height {
        for (i, j) in (0..size).flat_map(|j| (0..size).map(move |i| (i, j))) {
            if !filled([i, j, k]) {
                continue;
            }
            for axis in 0..3 {
                for side in 0..2i64 {
                    let mut beyond = [i, j, k];
                    beyond[axis] += 2 * side - 1;
                    if filled(beyond) {
                        continue;
                    }
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    let mut corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[a, b]| {
                        let mut corner = [i, j, k];
                        corner[axis] += side;
                        corner[u] += a;
                        corner[v] += b;
                        *numbers.entry(corner).or_insert_with(|| {
                            soup.vertex(DVec3::from_array(corner.map(|c| c as f64)))
                        })
                    });
                    if side == 0 {
                        corners.reverse();
                    }
                    soup.quad(corners);
                }
            }
        }
    }
    soup
}

/// A grid of `columns` × `rows` quads; `wrap` says which vertex stands at a place beyond the last.
fn lattice(
    [columns, rows]: [u32; 2],
    size: [u32; 2],
    place: impl Fn(u32, u32) -> DVec3,
    wrap: impl Fn(u32, u32) -> [u32; 2],
) -> Soup {
    let mut soup = Soup::default();
    for (i, j) in (0..size[1]).flat_map(|j| (0..size[0]).map(move |i| (i, j))) {
        soup.vertex(place(i, j));
    }
    let at = |i: u32, j: u32| {
        let [i, j] = wrap(i, j);
        j * size[0] + i
    };
    for (i, j) in (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))) {
        soup.quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
    }
    soup
}

pub(crate) fn moebius(around: u32, across: u32) -> Soup {
    let place = |i: u32, j: u32| {
        let a = TAU * f64::from(i) / f64::from(around);
        let w = 0.4 * (f64::from(j) / f64::from(across) - 0.5);
        let r = 1.0 + w * (a / 2.0).cos();
        DVec3::new(r * a.cos(), r * a.sin(), w * (a / 2.0).sin())
    };
    lattice([around, across], [around, across + 1], place, |i, j| {
        if i == around { [0, across - j] } else { [i, j] }
    })
}

/// The bottle as a figure of eight, which meets itself along a circle.
pub(crate) fn klein(around: u32, across: u32) -> Soup {
    let place = |i: u32, j: u32| {
        let (u, v) = (
            TAU * f64::from(i) / f64::from(around),
            TAU * (f64::from(j) + 0.5) / f64::from(across),
        );
        let (c, s) = ((u / 2.0).cos(), (u / 2.0).sin());
        let r = 2.0 + c * v.sin() - s * (2.0 * v).sin();
        DVec3::new(r * u.cos(), r * u.sin(), s * v.sin() + c * (2.0 * v).sin())
    };
    // Once around, v becomes −v: from (j + ½) to −(j + ½).
    lattice([around, across], [around, across], place, |i, j| {
        let j = j % across;
        if i == around {
            [0, across - 1 - j]
        } else {
            [i, j]
        }
    })
}

/// The unit sphere between two poles of valence `around`.
pub(crate) fn sphere(around: u32, rings: u32) -> Soup {
    let mut soup = Soup::default();
    let north = soup.vertex(DVec3::Z);
    for ring in 1..rings {
        let polar = PI * f64::from(ring) / f64::from(rings);
        for i in 0..around {
            let a = TAU * f64::from(i) / f64::from(around);
            soup.vertex(DVec3::new(
                polar.sin() * a.cos(),
                polar.sin() * a.sin(),
                polar.cos(),
            ));
        }
    }
    let south = soup.vertex(-DVec3::Z);
    let at = |ring: u32, i: u32| 1 + (ring - 1) * around + i % around;
    for i in 0..around {
        soup.triangles.push([north, at(1, i), at(1, i + 1)]);
        soup.triangles
            .push([south, at(rings - 1, i + 1), at(rings - 1, i)]);
        for ring in 1..rings - 1 {
            soup.quad([
                at(ring, i),
                at(ring + 1, i),
                at(ring + 1, i + 1),
                at(ring, i + 1),
            ]);
        }
    }
    soup
}

pub(crate) fn torus(around: u32, across: u32) -> Soup {
    let place = |i: u32, j: u32| {
        let (u, v) = (
            TAU * f64::from(i) / f64::from(around),
            TAU * f64::from(j) / f64::from(across),
        );
        let r = 1.0 + 0.3 * v.cos();
        DVec3::new(r * u.cos(), r * u.sin(), 0.3 * v.sin())
    };
    lattice([around, across], [around, across], place, |i, j| {
        [i % around, j % across]
    })
}

/// Sheets in a row, each hanging by one vertex on the last.
pub(crate) fn bow_ties(count: u32) -> Soup {
    let mut soup = Soup::default();
    for n in 0..count {
        let mut next = sheet(16, |_, _| false);
        for p in &mut next.positions {
            p.z = 0.125 * p.x * p.y;
            *p += f64::from(n) * DVec3::new(1.0, 1.0, 0.125);
        }
        soup = soup.with(&next);
    }
    soup
}

/// `pages` sheets on one edge.
pub(crate) fn book(pages: u32, cells: u32) -> Soup {
    let mut soup = Soup::default();
    for n in 0..pages {
        let angle = TAU * f64::from(n) / f64::from(pages);
        let mut page = sheet(cells, |_, _| false);
        for p in &mut page.positions {
            let DVec2 { x, y } = p.truncate();
            *p = DVec3::new(x * angle.cos(), x * angle.sin(), y);
        }
        soup = soup.with(&page);
    }
    soup
}

/// A sphere within a sphere.
pub(crate) fn double_shell(around: u32, rings: u32, gap: f64) -> Soup {
    let outer = sphere(around, rings);
    let mut inner = outer.clone();
    for p in &mut inner.positions {
        *p *= 1.0 - gap;
    }
    for t in &mut inner.triangles {
        t.swap(1, 2);
    }
    outer.with(&inner)
}

/// A closed box of `cells`² cells and little height.
pub(crate) fn plate(cells: u32, height: f64) -> Soup {
    let mut soup = cube(cells);
    for p in &mut soup.positions {
        p.z *= height;
    }
    soup
}

/// The unit cube, every face of `cells`² cells.
pub(crate) fn cube(cells: u32) -> Soup {
    let n = i64::from(cells);
    let mut soup = Soup::default();
    let mut numbers: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, n)]) {
        for (a, b) in (0..n).flat_map(|b| (0..n).map(move |a| (a, b))) {
            let mut corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[da, db]| {
                let mut corner = [0; 3];
                corner[axis] = side;
                corner[(axis + 1) % 3] = a + da;
                corner[(axis + 2) % 3] = b + db;
                *numbers.entry(corner).or_insert_with(|| {
                    soup.vertex(DVec3::from_array(corner.map(|c| c as f64 / n as f64)))
                })
            });
            if side == 0 {
                corners.reverse();
            }
            soup.quad(corners);
        }
    }
    soup
}

/// Cubes of different sizes in a room of a hundred.
pub(crate) fn cubes(count: u64) -> Soup {
    let mut soup = Soup::default();
    for n in 0..count {
        let mut next = cube(1);
        let place = DVec3::from_array([0, 1, 2].map(|axis| signed(7, 4 * n + axis)));
        let size = 0.004 + 0.002 * signed(7, 4 * n + 3);
        for p in &mut next.positions {
            *p = 0.5 * place + size * *p + DVec3::splat(0.5);
        }
        soup = soup.with(&next);
    }
    soup
}

/// Upright squares of two triangles.
pub(crate) fn cards(count: u64) -> Soup {
    let mut soup = Soup::default();
    for n in 0..count {
        let foot = DVec3::new(signed(8, 3 * n), signed(8, 3 * n + 1), 0.0);
        let angle = PI * signed(8, 3 * n + 2);
        let side = 0.005 * DVec3::new(angle.cos(), angle.sin(), 0.0);
        let corners = [-side, side, side + 0.03 * DVec3::Z, 0.03 * DVec3::Z - side];
        let corners = corners.map(|corner| soup.vertex(foot + corner));
        soup.quad(corners);
    }
    soup
}

/// A ball with `count` long round fingers, made of a bent sphere.
pub(crate) fn fingers(count: u32) -> Soup {
    let mut soup = sphere(120, 120);
    let axes: Vec<DVec3> = (0..count)
        .map(|n| {
            let z = 1.0 - 2.0 * (f64::from(n) + 0.5) / f64::from(count);
            let a = 2.399_963 * f64::from(n);
            DVec3::new(
                (1.0 - z * z).sqrt() * a.cos(),
                (1.0 - z * z).sqrt() * a.sin(),
                z,
            )
        })
        .collect();
    for p in &mut soup.positions {
        let reach: f64 = axes
            .iter()
            .map(|axis| 2.0 * (-40.0 * (1.0 - p.dot(*axis))).exp())
            .sum();
        *p *= 1.0 + reach;
    }
    soup
}

/// A closed tube along x.
pub(crate) fn tube(radii: f64, around: u32, rings: u32) -> Soup {
    let mut soup = sphere(around, rings);
    for p in &mut soup.positions {
        let along = (1.0 - 2.0 * p.z.clamp(-1.0, 1.0).acos() / PI) * radii / 2.0;
        let cap = (radii / 2.0 - along.abs()).clamp(0.0, 1.0);
        let radius = (1.0 - (1.0 - cap).powi(2)).sqrt();
        let across = p.truncate().normalize_or_zero() * radius;
        *p = DVec3::new(along, across.x, across.y);
    }
    soup
}

/// An L with a round hole through one arm, extruded: flat faces, sharp edges, long thin triangles.
pub(crate) fn bracket(around: u32) -> Soup {
    // A plate of cells in the plane, those of the hole pushed out to a circle.
    let size = 12i64;
    let in_l =
        |i: i64, j: i64| (0..size).contains(&i) && (0..size).contains(&j) && (i < 6 || j < 6);
    let in_hole = |i: i64, j: i64| (2..4).contains(&i) && (8..10).contains(&j);
    let mut soup = voxels(size, 3, |i, j, _| in_l(i, j) && !in_hole(i, j));
    let centre = DVec2::new(3.0, 9.0);
    let rim: BTreeSet<usize> = (0..soup.positions.len())
        .filter(|&v| {
            let d = (soup.positions[v].truncate() - centre).abs();
            (d.max_element() - 1.0).abs() < 1e-9
        })
        .collect();
    for v in rim {
        let p = soup.positions[v];
        let on_circle = centre + (p.truncate() - centre).normalize();
        soup.positions[v] = on_circle.extend(p.z);
    }
    // A round boss beside it, finer than the rest.
    let mut boss = tube(8.0, around, 40);
    for p in &mut boss.positions {
        *p = DVec3::new(8.0 + p.y, 8.0 + p.z, p.x);
    }
    soup.with(&boss)
}

/// Sheets side by side, of so many cells each: their borders lie on each other, and few of their vertices meet.
pub(crate) fn t_junctions(cells: &[u32]) -> Soup {
    let mut soup = Soup::default();
    for (n, &cells) in (0u32..).zip(cells) {
        let height = |p: DVec3| DVec3::new(p.x + f64::from(n), p.y, 0.05 * (PI * p.x).sin());
        soup = soup.with(&sheet(cells, |_, _| false).map(height));
    }
    soup
}

/// A flat sheet of `cells`² cells.
pub(crate) fn flat(cells: u32) -> Soup {
    sheet(cells, |_, _| false).map(|p| p.with_z(0.0))
}
