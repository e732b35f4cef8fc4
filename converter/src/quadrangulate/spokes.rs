//! Cutting a flattened region along the spokes from its centre to the middles of its sides.
//!
//! Which sector a vertex lies in is decided once, by an exact predicate (Shewchuk, "Adaptive Precision Floating-Point
//! Arithmetic and Fast Robust Geometric Predicates", 1997); everything after that is combinatorial, so rounding moves
//! points but never tears the pieces.

use super::QuadrangulateError;
use super::arcs::{border, mean, mix};
use super::region::Region;
use crate::atlas::patch::{Border, Patch};
use crate::mesh::NONE;
use crate::parameterize::{Edges, Flat, Weights};
use glam::{DVec2, DVec3};
use std::collections::HashMap;
use std::sync::Arc;

/// A region's patches, and the spokes between them. Patch k holds corner k + 1; its borders 0 and 3 are spoke numbers
/// in `spokes`, its borders 1 and 2 are final.
#[derive(Debug)]
pub(super) struct CutRegion {
    pub(super) patches: Vec<Patch>,
    pub(super) spokes: Vec<Border>,
    /// See [`Region::speck`].
    pub(super) speck: Option<u32>,
    /// [`Region::key`], and the flattening that was tried first.
    pub(super) key: u128,
    pub(super) flat: Arc<Flat>,
}

/// Reweighted where something is shrunk, for as long as it takes; few regions need more than two rounds.
const WEIGHTS: Weights = Weights::Stretch(0, 8);

/// A flattening that has shrunk a place by more than this (a length) gets its centre there.
const TIP: f64 = 4.0;

/// Other centres are tried where the smallest patch of a region has less than this part of their mean area.
const EVEN: f64 = 0.3;

/// Vertices at which the centre is tried where nothing else makes patches alike.
const SPREAD: usize = 48;

/// The first centres that are tried: a tip of a protrusion, if there is one, else the origin.
///
/// From a tip the spokes run along the protrusion, and it is no longer inside of any quad.
fn first_centres(flat: &Flat) -> impl Iterator<Item = DVec2> {
    let tip = flat.tip.filter(|&(_, shrunk)| shrunk > TIP);
    tip.map(|(v, _)| flat.uv[v as usize])
        .into_iter()
        .chain([DVec2::ZERO])
}

/// Centres for patches that are more alike: at the vertex nearest to the middle of the surface, and on the way to it.
///
/// A region that ends at the neck of a handle has most of its sides there, and the flattening's middle, too.
fn even_centres(region: &Region, flat: &Flat) -> impl Iterator<Item = DVec2> + use<> {
    let (mut sum, mut total) = (DVec3::ZERO, 0.0);
    for t in &region.triangles {
        let [a, b, c] = t.map(|v| region.positions[v as usize]);
        let area = (b - a).cross(c - a).length();
        sum += (a + b + c) * (area / 3.0);
        total += area;
    }
    let middle = sum / f64::max(total, f64::MIN_POSITIVE);
    let distance = |v: &usize| region.positions[*v].distance_squared(middle);
    let nearest = (0..flat.uv.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let nearest = nearest.map_or(DVec2::ZERO, |v| flat.uv[v]);
    [1.0, 0.97, 0.9, 0.75, 0.5]
        .into_iter()
        .map(move |part| nearest * part)
}

/// Centres all over a region, of which the flattening is `flat`.
fn spread_centres(flat: &Flat) -> impl Iterator<Item = DVec2> {
    let count = flat.uv.len();
    // Beside a vertex, since those of sides are not inside.
    (0..SPREAD).map(move |i| flat.uv[i * count / SPREAD] * 0.999)
}

/// Centres for where rounding has folded triangles over each other, as where a protrusion shrinks to a speck of the polygon.
/// That does no harm unless a spoke runs through the speck, and another centre sends the spokes elsewhere.
fn other_centres() -> impl Iterator<Item = DVec2> {
    // Golden-angle spiral: no two directions alike.
    (1..16).map(|i| DVec2::from_angle(2.399_963 * f64::from(i)) * 0.02 * f64::from(i))
}

/// Parts of its distance from the smallest patch's corner by which a centre is moved away from it, in this order.
const STEPS: [f64; 4] = [0.5, 0.25, 0.1, 0.05];

/// Moves of a centre, at most.
const MOVES: usize = 8;

/// A region cut from one centre.
struct Cut {
    centre: DVec2,
    patches: Vec<Patch>,
    spokes: Vec<Border>,
    /// The smallest patch, and the part of their mean area that it has.
    smallest: usize,
    evenness: f64,
}

/// A region that can be cut again and again.
struct Retry {
    region: Region,
    vertices: usize,
    triangles: Vec<[u32; 3]>,
}

impl Retry {
    fn new(region: Region) -> Self {
        Self {
            vertices: region.positions.len(),
            triangles: region.triangles.clone(),
            region,
        }
    }

    fn cut(&mut self, flat: &Flat, centre: DVec2) -> Option<Cut> {
        let uv = flat.uv.iter().map(|&p| p - centre).collect();
        let cut = Sectors::new(&mut self.region, uv).and_then(|mut sectors| sectors.cut());
        self.region.positions.truncate(self.vertices);
        self.region.attributes.truncate(self.vertices);
        self.region.triangles.clone_from(&self.triangles);
        let (patches, spokes) = cut?;
        let areas = patches.iter().map(Patch::area);
        let mean = areas.clone().sum::<f64>() / patches.len() as f64;
        let (smallest, least) = areas.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Cut {
            centre,
            patches,
            spokes,
            smallest,
            evenness: least / mean.max(f64::MIN_POSITIVE),
        })
    }

    /// Moves the centre of `best` away from the corner of its smallest patch for as long as that patch grows.
    fn move_centre(&mut self, flat: &Flat, best: &mut Cut) {
        for _ in 0..MOVES {
            if best.evenness >= EVEN {
                return;
            }
            let sides = &self.region.sides;
            let corner = sides[(best.smallest + 1) % sides.len()].vertices[0];
            let away = best.centre - flat.uv[corner as usize];
            let larger = STEPS.into_iter().find_map(|step| {
                let cut = self.cut(flat, best.centre + away * step)?;
                (cut.evenness > best.evenness).then_some(cut)
            });
            let Some(larger) = larger else {
                return;
            };
            *best = larger;
        }
    }

    /// The first cut that there is, or one with a larger smallest patch.
    fn best(&mut self, flat: &Flat) -> Option<Cut> {
        let is_even = |cut: &Option<Cut>| cut.as_ref().is_some_and(|cut| cut.evenness >= EVEN);
        let mut best = first_centres(flat).find_map(|centre| self.cut(flat, centre));
        // From the middle the first that will do, all over the best.
        for centre in even_centres(&self.region, flat) {
            if is_even(&best) {
                return best;
            }
            self.replace(&mut best, flat, centre);
        }
        if !is_even(&best) {
            for centre in spread_centres(flat) {
                self.replace(&mut best, flat, centre);
            }
        }
        if let Some(best) = &mut best {
            self.move_centre(flat, best);
        }
        best.or_else(|| other_centres().find_map(|centre| self.cut(flat, centre)))
    }

    /// Takes the cut from `centre` if its smallest patch is larger.
    fn replace(&mut self, best: &mut Option<Cut>, flat: &Flat, centre: DVec2) {
        let Some(cut) = self.cut(flat, centre) else {
            return;
        };
        if best
            .as_ref()
            .is_none_or(|best| best.evenness < cut.evenness)
        {
            *best = Some(cut);
        }
    }
}

/// Cuts a region; `known` are flattenings by [`Region::key`].
pub(super) fn cut(
    region: Region,
    known: &HashMap<u128, Arc<Flat>>,
) -> Result<CutRegion, QuadrangulateError> {
    let key = region.key();
    let known = known.get(&key).cloned();
    let flat = known.unwrap_or_else(|| Arc::new(region.flattened(WEIGHTS)));
    let speck = region.speck(&flat);
    let mut retry = Retry::new(region);
    let cut = retry.best(&flat).or_else(|| {
        let uniform = retry.region.flattened(Weights::Uniform);
        retry.best(&uniform)
    });
    let Some(Cut {
        patches, spokes, ..
    }) = cut
    else {
        return Err(QuadrangulateError::Folded {
            region: retry.region.id,
            triangles: retry.triangles.len(),
        });
    };
    Ok(CutRegion {
        patches,
        spokes,
        speck,
        key,
        flat,
    })
}

fn orient(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let p = |v: DVec2| robust::Coord { x: v.x, y: v.y };
    robust::orient2d(p(a), p(b), p(c))
}

/// Where a vertex lies among n spokes: `2k` on spoke k, `2k + 1` between spokes k and k + 1.
type Class = u32;
const CENTRE: Class = NONE;

struct Sectors<'a> {
    region: &'a mut Region,
    uv: Vec<DVec2>,
    /// Middles of the sides: spoke k runs from the origin to `middles[k]`.
    middles: Vec<DVec2>,
    centre: u32,
    class: Vec<Class>,
    /// Points where edges (a < b) cross spokes, from a to b.
    crossings: HashMap<(u32, u32), Vec<u32>>,
}

impl<'a> Sectors<'a> {
    /// Places the centre and classifies every vertex; `None` when the flattening folds around the origin.
    fn new(region: &'a mut Region, mut uv: Vec<DVec2>) -> Option<Self> {
        let centre = insert_origin(region, &mut uv)?;
        let middles: Vec<DVec2> = region
            .sides
            .iter()
            .map(|s| uv[s.vertices[s.middle] as usize])
            .collect();
        let n = u32::try_from(middles.len()).ok()?;
        let mut class = vec![CENTRE; uv.len()];
        for (k, side) in (0u32..).zip(&region.sides) {
            for (i, &v) in side.vertices.iter().enumerate() {
                class[v as usize] = match i.cmp(&side.middle) {
                    std::cmp::Ordering::Less => (2 * k + 2 * n - 1) % (2 * n),
                    std::cmp::Ordering::Equal => 2 * k,
                    std::cmp::Ordering::Greater => 2 * k + 1,
                };
            }
        }
        for v in 0..uv.len() {
            if class[v] == CENTRE && v != centre as usize {
                class[v] = classify(uv[v], &middles)?;
            }
        }
        Some(Self {
            region,
            uv,
            middles,
            centre,
            class,
            crossings: HashMap::new(),
        })
    }

    fn spokes(&self) -> u32 {
        u32::try_from(self.middles.len()).unwrap_or(NONE)
    }

    /// Spokes strictly between the ends of edge a → b, in the order they are crossed.
    fn crossed(&self, a: u32, b: u32) -> Vec<u32> {
        let (ca, cb) = (self.class[a as usize], self.class[b as usize]);
        if ca == CENTRE || cb == CENTRE || ca == cb {
            return Vec::new();
        }
        let turns = 2 * self.spokes();
        let forward = orient(DVec2::ZERO, self.uv[a as usize], self.uv[b as usize]) >= 0.0;
        let (mut at, mut spokes) = (ca, Vec::new());
        loop {
            at = if forward {
                (at + 1) % turns
            } else {
                (at + turns - 1) % turns
            };
            if at == cb {
                return spokes;
            }
            if at % 2 == 0 {
                spokes.push(at / 2);
            }
        }
    }

    /// Adds the points where edge a → b crosses spokes, made on first use; from a to b.
    fn push_edge(&mut self, a: u32, b: u32, outline: &mut Vec<u32>) {
        let (low, high) = (a.min(b), a.max(b));
        let spokes = self.crossed(low, high);
        if spokes.is_empty() {
            return;
        }
        let first = outline.len();
        if let Some(made) = self.crossings.get(&(low, high)) {
            outline.extend(made);
        } else {
            let made: Vec<u32> = spokes
                .into_iter()
                .map(|k| self.cross(low, high, k))
                .collect();
            outline.extend(&made);
            self.crossings.insert((low, high), made);
        }
        if a > b {
            outline[first..].reverse();
        }
    }

    fn cross(&mut self, a: u32, b: u32, spoke: u32) -> u32 {
        let direction = self.middles[spoke as usize];
        let (ua, ub) = (self.uv[a as usize], self.uv[b as usize]);
        let (da, db) = (direction.perp_dot(ua).abs(), direction.perp_dot(ub).abs());
        let f = (da / (da + db).max(f64::MIN_POSITIVE)).clamp(1e-4, 1.0 - 1e-4);
        let region = &mut *self.region;
        let id = u32::try_from(region.positions.len()).unwrap_or(NONE);
        let (pa, pb) = (region.positions[a as usize], region.positions[b as usize]);
        region.positions.push(pa.lerp(pb, f));
        region.attributes.push(mix(
            &region.attributes[a as usize],
            &region.attributes[b as usize],
            f,
        ));
        self.uv.push(ua.lerp(ub, f));
        self.class.push(2 * spoke);
        id
    }

    /// Whether a point of this class belongs to the closed sector k.
    fn in_sector(&self, class: Class, k: u32) -> bool {
        class == CENTRE
            || class == 2 * k
            || class == 2 * k + 1
            || class == (2 * k + 2) % (2 * self.spokes())
    }

    /// The patches and the spokes; `None` when a sector is no disk with the expected outline.
    fn cut(&mut self) -> Option<(Vec<Patch>, Vec<Border>)> {
        let n = self.spokes();
        let mut pieces: Vec<Vec<[u32; 3]>> = vec![Vec::new(); n as usize];
        let triangles = std::mem::take(&mut self.region.triangles);
        let mut outline = Vec::new();
        let mut polygon = Vec::new();
        let mut seen: Vec<u32> = Vec::new();
        for t in &triangles {
            let [a, b, c] = t.map(|v| self.class[v as usize]);
            if a == b && b == c && a % 2 == 1 && a != CENTRE {
                pieces[a as usize / 2].push(*t);
                continue;
            }
            outline.clear();
            for k in 0..3 {
                outline.push(t[k]);
                self.push_edge(t[k], t[(k + 1) % 3], &mut outline);
            }
            seen.clear();
            for i in 0..outline.len() {
                let class = self.class[outline[i] as usize];
                if class == CENTRE {
                    continue;
                }
                // The sectors that this point borders on.
                let candidates = if class % 2 == 1 {
                    [class / 2; 2]
                } else {
                    [class / 2, (class / 2 + n - 1) % n]
                };
                for sector in candidates {
                    if seen.contains(&sector) {
                        continue;
                    }
                    seen.push(sector);
                    polygon.clear();
                    polygon.extend(
                        outline
                            .iter()
                            .filter(|&&p| self.in_sector(self.class[p as usize], sector)),
                    );
                    let out = &mut pieces[sector as usize];
                    // Fewer than three points: the triangle only touches this sector.
                    out.extend(
                        (2..polygon.len()).map(|i| [polygon[0], polygon[i - 1], polygon[i]]),
                    );
                }
            }
        }
        let mut patches = Vec::with_capacity(n as usize);
        let mut spokes: Vec<Option<Border>> = vec![None; n as usize];
        for k in 0..n {
            let patch = self.patch(k, &pieces[k as usize], &mut spokes)?;
            patches.push(patch);
        }
        Some((patches, spokes.into_iter().collect::<Option<_>>()?))
    }

    fn patch(
        &self,
        k: u32,
        triangles: &[[u32; 3]],
        spokes: &mut [Option<Border>],
    ) -> Option<Patch> {
        let n = self.middles.len();
        let (side, following) = (
            &self.region.sides[k as usize],
            &self.region.sides[(k as usize + 1) % n],
        );
        let corners = [
            self.centre,
            side.vertices[side.middle],
            following.vertices[0],
            following.vertices[following.middle],
        ];
        // Numbers of the region's vertices in the patch, in the same order.
        let mut number = vec![NONE; self.region.positions.len()];
        for &v in triangles.as_flattened() {
            number[v as usize] = 0;
        }
        let mut used: Vec<u32> = Vec::with_capacity(triangles.len());
        for (v, number) in (0u32..).zip(&mut number).filter(|(_, n)| **n == 0) {
            *number = u32::try_from(used.len()).ok()?;
            used.push(v);
        }
        let local = |v: u32| number[v as usize];
        let own_triangles: Vec<_> = triangles.iter().map(|t| t.map(local)).collect();
        let own_sides = sides_of_disk(&own_triangles, used.len(), corners.map(local))?;
        let sides = own_sides
            .each_ref()
            .map(|side| -> Vec<u32> { side.iter().map(|&v| used[v as usize]).collect() });
        // The outer sides must be the arcs, point by point: their borders are shared with other regions.
        if sides[1] != side.vertices[side.middle..]
            || sides[2] != following.vertices[..=following.middle]
        {
            return None;
        }
        let spoke = |vertices: &[u32]| {
            border(
                vertices
                    .iter()
                    .map(|&v| self.region.positions[v as usize])
                    .collect(),
                vertices
                    .iter()
                    .map(|&v| self.region.attributes[v as usize])
                    .collect(),
            )
        };
        let inwards: Vec<u32> = sides[3].iter().rev().copied().collect();
        for (k, vertices) in [(k as usize, &sides[0]), ((k as usize + 1) % n, &inwards)] {
            let border = spoke(vertices);
            match &spokes[k] {
                None => spokes[k] = Some(border),
                Some(other) if other.points == border.points => {}
                Some(_) => return None,
            }
        }
        Some(Patch {
            positions: used
                .iter()
                .map(|&v| self.region.positions[v as usize])
                .collect(),
            attributes: used
                .iter()
                .map(|&v| self.region.attributes[v as usize])
                .collect(),
            triangles: own_triangles,
            sides: own_sides,
            borders: [
                (k, true),
                side.halves[1],
                following.halves[0],
                ((k + 1) % u32::try_from(n).ok()?, false),
            ],
        })
    }
}

/// Class of an interior point, by exact predicates; `None` at the origin itself.
fn classify(p: DVec2, middles: &[DVec2]) -> Option<Class> {
    let n = middles.len();
    for k in 0..n {
        let from = orient(DVec2::ZERO, middles[k], p);
        let to = orient(DVec2::ZERO, middles[(k + 1) % n], p);
        let ahead = middles[k].dot(p) > 0.0;
        if from == 0.0 && ahead {
            return u32::try_from(2 * k).ok();
        }
        // Sectors are narrower than half a turn.
        if from > 0.0 && to < 0.0 {
            return u32::try_from(2 * k + 1).ok();
        }
    }
    None
}

/// Makes the origin a vertex; `None` when no triangle holds it or the flattening is folded there.
fn insert_origin(region: &mut Region, uv: &mut Vec<DVec2>) -> Option<u32> {
    let corners: Vec<u32> = region
        .sides
        .iter()
        .flat_map(|s| s.vertices.iter().copied())
        .collect();
    if let Some(v) = uv.iter().position(|p| *p == DVec2::ZERO) {
        let v = u32::try_from(v).ok()?;
        return (!corners.contains(&v)).then_some(v);
    }
    let signs = |t: &[u32; 3]| {
        [0, 1, 2].map(|k| orient(uv[t[k] as usize], uv[t[(k + 1) % 3] as usize], DVec2::ZERO))
    };
    // A triangle that rounding has flattened to a point seems to hold everything.
    let upright =
        |t: &[u32; 3]| orient(uv[t[0] as usize], uv[t[1] as usize], uv[t[2] as usize]) > 0.0;
    let holding: Vec<usize> = (0..region.triangles.len())
        .filter(|&t| {
            upright(&region.triangles[t]) && signs(&region.triangles[t]).iter().all(|&s| s >= 0.0)
        })
        .collect();
    let first = region.triangles[*holding.first()?];
    let s = signs(&first);
    let on_edge = s.iter().filter(|&&s| s == 0.0).count();
    if holding.len() != 1 + on_edge || on_edge > 1 {
        return None;
    }
    let centre = u32::try_from(region.positions.len()).ok()?;
    let total: f64 = s.iter().sum();
    // signs()[k] belongs to edge k, so it weighs the corner opposite.
    let weight = |corner: usize| s[(corner + 1) % 3] / total;
    let position = (0..3)
        .map(|c| weight(c) * region.positions[first[c] as usize])
        .sum();
    region.positions.push(position);
    let attributes = mean(first.iter().map(|&v| &region.attributes[v as usize]));
    region.attributes.push(attributes);
    uv.push(DVec2::ZERO);
    let mut made = Vec::new();
    for &t in &holding {
        let triangle = region.triangles[t];
        let s = [0, 1, 2].map(|k| {
            orient(
                uv[triangle[k] as usize],
                uv[triangle[(k + 1) % 3] as usize],
                DVec2::ZERO,
            )
        });
        made.extend(
            (0..3)
                .filter(|&k| s[k] != 0.0)
                .map(|k| [centre, triangle[k], triangle[(k + 1) % 3]]),
        );
    }
    let mut index = 0;
    region.triangles.retain(|_| {
        index += 1;
        !holding.contains(&(index - 1))
    });
    region.triangles.extend(made);
    Some(centre)
}

/// The outline of `triangles` between `corners`, when it is one loop through all four in order and they are a disk.
///
/// `vertices` is how many they have, all numbers below it.
fn sides_of_disk(
    triangles: &[[u32; 3]],
    vertices: usize,
    corners: [u32; 4],
) -> Option<[Vec<u32>; 4]> {
    let edges = Edges::of(triangles);
    // How much more often an edge runs up than down.
    let mut up = vec![0i32; edges.ends.len()];
    for (t, ids) in triangles.iter().zip(&edges.of_triangle) {
        for k in 0..3 {
            up[ids[k] as usize] += if t[k] < t[(k + 1) % 3] { 1 } else { -1 };
        }
    }
    let mut following = vec![NONE; vertices];
    let mut outline_edges = 0;
    for ((&[low, high], &uses), &up) in edges.ends.iter().zip(&edges.uses).zip(&up) {
        let (from, to) = match (uses, up) {
            (1, 1) => (low, high),
            (1, -1) => (high, low),
            (2, 0) => continue,
            _ => return None,
        };
        if std::mem::replace(&mut following[from as usize], to) != NONE {
            return None;
        }
        outline_edges += 1;
    }
    let mut sides: [Vec<u32>; 4] = Default::default();
    let mut at = corners[0];
    let mut walked = 0;
    for s in 0..4 {
        sides[s].push(at);
        while at != corners[(s + 1) % 4] {
            at = following.get(at as usize).copied()?;
            walked += 1;
            if walked > outline_edges {
                return None;
            }
            sides[s].push(at);
        }
    }
    // Vertices, edges and triangles of a disk.
    let euler = vertices + triangles.len() == edges.ends.len() + 1;
    (walked == outline_edges && euler).then_some(sides)
}
