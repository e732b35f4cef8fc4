//! Data laid out for the shaders; `tests/layout_match.rs` compares it with what naga makes of the WGSL.

use crate::camera::View;
use crate::colour::map::{MapPlace, NO_TILES};
use crate::lod::edge_morph::SideMode;
use crate::lod::{Cut, Leaf};
use crate::numbers::NumberSet;
use crate::options::Shade;
use crate::residency::upload::Slot;
use crate::section::HalfSpace;
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// Side mode that stands for [`SideMode::Snap`]; every morph is at least 0.
pub const SNAP: f32 = -1.0;

/// What is the same for a whole frame. `Frame` in `shaders/shared/frame.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Frame {
    /// Clip coordinates of an offset from the eye, lattice units; column by column.
    pub clip_from_offset: [[f32; 4]; 4],
    /// Whole part of the eye on the lattice.
    pub eye_whole: [i32; 3],
    /// What is shown: 0 lit, 1 normal, 2 lod, 3 wire, 4 unlit.
    pub shade: u32,
    /// Rest of the eye on the lattice, 0..1.
    pub eye_fraction: [f32; 3],
    /// Whether the file has colours: 0 or 1.
    pub has_colours: u32,
    /// Right of the picture, world.
    pub right: [f32; 4],
    /// Up of the picture, world.
    pub up: [f32; 4],
    /// From the target to the eye, world.
    pub back: [f32; 4],
    /// Half-space that stays: what of an offset from the eye, lattice units, lies along xyz is at most w.
    pub section: [f32; 4],
    /// Noise from which and below which pixels are drawn; the other two are not used.
    pub mask: [f32; 4],
}

/// Noise is at least 0 and below 1: everything is drawn.
pub const WHOLE: [f32; 4] = [-1.0, 2.0, 0.0, 0.0];

impl Frame {
    /// The frame of a view in which nothing is cut away.
    pub fn new(view: &View, shade: Shade, has_colours: bool) -> Self {
        let [right, up, back] = view.frame.map(|axis| axis.as_vec3().extend(0.0).to_array());
        Self {
            clip_from_offset: view.clip_from_offset.as_mat4().to_cols_array_2d(),
            eye_whole: view.eye.whole,
            shade: match shade {
                Shade::Lit => 0,
                Shade::Normal => 1,
                Shade::Lod => 2,
                Shade::Wire => 3,
                Shade::Unlit => 4,
            },
            eye_fraction: glam::DVec3::from_array(view.eye.fraction)
                .as_vec3()
                .to_array(),
            has_colours: u32::from(has_colours),
            right,
            up,
            back,
            section: [0.0, 0.0, 0.0, 1.0],
            mask: WHOLE,
        }
    }

    /// The same, of the half-space `section` (lattice coordinates).
    #[must_use]
    pub fn cut_open(self, view: &View, section: HalfSpace) -> Self {
        let eye = glam::DVec3::from_array(view.eye.whole.map(f64::from))
            + glam::DVec3::from_array(view.eye.fraction);
        let left = section.offset - section.normal.dot(eye);
        Self {
            section: section.normal.extend(left).as_vec4().to_array(),
            ..self
        }
    }

    /// The same, drawn where the noise is in `low..high`.
    #[must_use]
    pub fn masked(self, low: f32, high: f32) -> Self {
        Self {
            mask: [low, high, 0.0, 0.0],
            ..self
        }
    }
}

/// One leaf to draw. The instance attributes of `shaders/grid.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Instance {
    /// First texel (x, y), layer, and in the fourth word: log2 of the drawn cells a side (bits 0..8), log2 of the stride
    /// between drawn samples (8..16), level (16..24), resolution of the chart (24..32).
    pub place: [u32; 4],
    /// Side modes: a morph, or [`SNAP`].
    pub sides: [f32; 4],
    /// Morph of everything that is on no side.
    pub morph: f32,
    /// The node's part of the colour map; see [`MapPlace`].
    pub tiles: MapPlace,
}

impl Instance {
    /// Vertex attributes: locations 0..=3.
    pub const ATTRIBUTES: [wgpu::VertexAttribute; 4] =
        wgpu::vertex_attr_array![0 => Uint32x4, 1 => Float32x4, 2 => Float32, 3 => Uint32x2];

    /// `leaf`, whose samples are in `slot`.
    pub fn new(leaf: Leaf, slot: Slot, morph: f32, sides: [SideMode; 4]) -> Self {
        let grid = leaf.grid_resolution();
        let stride = slot.resolution.saturating_sub(grid);
        Self {
            place: [
                slot.x,
                slot.y,
                slot.layer,
                u32::from_le_bytes([grid, stride, leaf.node.level, leaf.resolution]),
            ],
            sides: sides.map(|mode| match mode {
                SideMode::Morph(morph) => morph,
                SideMode::Snap => SNAP,
            }),
            morph,
            tiles: [0, NO_TILES],
        }
    }
}

/// Everything to draw, instances of one grid size together.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DrawList {
    /// The instances.
    pub instances: Vec<Instance>,
    /// By log2 of the grid's cells a side: where its instances end. They start where those of the size before end.
    pub ends: [u32; 6],
}

impl DrawList {
    /// Collects the leaves of `cut` for which `instance` has something.
    pub fn new(cut: &Cut, mut instance: impl FnMut(Leaf) -> Option<Instance>) -> Self {
        let mut by_size: [Vec<Instance>; 6] = Default::default();
        for leaf in cut.leaves() {
            if let Some(instance) = instance(leaf)
                && let Some(size) = by_size.get_mut(usize::from(leaf.grid_resolution()))
            {
                size.push(instance);
            }
        }
        let mut list = Self::default();
        for (end, size) in list.ends.iter_mut().zip(by_size) {
            list.instances.extend(size);
            *end = u32::try_from(list.instances.len()).unwrap_or(u32::MAX);
        }
        list
    }

    /// The instances that `keep` keeps, in the same order.
    #[must_use]
    pub fn filtered(&self, mut keep: impl FnMut(&Instance) -> bool) -> Self {
        let mut list = Self::default();
        let starts = std::iter::once(0).chain(self.ends);
        for (end, (start, stop)) in list.ends.iter_mut().zip(starts.zip(self.ends)) {
            let range = usize::try_from(start).ok().zip(usize::try_from(stop).ok());
            let own = range.and_then(|(start, stop)| self.instances.get(start..stop));
            list.instances
                .extend(own.unwrap_or_default().iter().filter(|i| keep(i)));
            *end = u32::try_from(list.instances.len()).unwrap_or(u32::MAX);
        }
        list
    }

    /// Grid sizes that have instances, with the range of these.
    pub fn draws(&self) -> impl Iterator<Item = (u8, Range<u32>)> {
        let starts = std::iter::once(0).chain(self.ends);
        (0u8..)
            .zip(starts.zip(self.ends))
            .filter(|(_, (start, end))| start < end)
            .map(|(n, (start, end))| (n, start..end))
    }

    /// Triangles drawn.
    pub fn triangles(&self) -> u64 {
        self.draws()
            .map(|(grid, range)| {
                (2u64 << (2 * u32::from(grid))) * u64::from(range.end - range.start)
            })
            .sum()
    }
}

/// The clusters to draw: runs of slots that lie side by side.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ClusterList {
    /// Slots, one draw call a run.
    pub runs: Vec<Range<u32>>,
    /// Clusters drawn.
    pub nodes: u64,
    /// Their triangles.
    pub triangles: u64,
    /// Slots of those that move, with their morphs.
    pub morphs: Vec<(u32, f32)>,
}

/// One cluster to draw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnCluster {
    /// Its slot.
    pub slot: u32,
    /// How many triangles it has.
    pub triangles: u16,
    /// How far its vertices are on the way to their targets, 0..=1.
    pub morph: f32,
}

impl ClusterList {
    /// Collects clusters, each once.
    pub fn new(clusters: impl Iterator<Item = DrawnCluster>) -> Self {
        let mut list = Self::default();
        let mut slots = NumberSet::default();
        for cluster in clusters {
            list.nodes += 1;
            list.triangles += u64::from(cluster.triangles);
            slots.insert(cluster.slot);
            if cluster.morph > 0.0 {
                list.morphs.push((cluster.slot, cluster.morph));
            }
        }
        for slot in slots.iter() {
            match list.runs.last_mut() {
                Some(run) if run.end == slot => run.end += 1,
                _ => list.runs.push(slot..slot + 1),
            }
        }
        list
    }
}

/// Vertex attributes of a cluster: what the vertex is, location 0, and what it moves to, location 2. See `shaders/cluster.wgsl`.
pub const CLUSTER_ATTRIBUTES: [wgpu::VertexAttribute; 2] =
    wgpu::vertex_attr_array![0 => Uint32x4, 2 => Uint32x4];
/// The code of its texture's part, location 1.
pub const CLUSTER_TEXTURE_ATTRIBUTES: [wgpu::VertexAttribute; 1] =
    wgpu::vertex_attr_array![1 => Uint32];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, cube_charts, random_cut};

    #[test]
    fn draw_list_holds_every_leaf_once_by_grid_size() {
        let cut = random_cut(&mut Random::new(14), &cube_charts(5), 2);
        let slot = |leaf: Leaf| Slot {
            x: 0,
            y: 0,
            layer: 0,
            resolution: leaf.grid_resolution(),
        };
        let list = DrawList::new(&cut, |leaf| {
            Some(Instance::new(leaf, slot(leaf), 0.0, [SideMode::Snap; 4]))
        });
        assert_eq!(list.instances.len(), cut.leaves().len());
        assert_eq!(list.triangles(), cut.triangles());
        let mut next = 0;
        for (grid, range) in list.draws() {
            assert_eq!(range.start, next);
            next = range.end;
            for instance in &list.instances[range.start as usize..range.end as usize] {
                assert_eq!(instance.place[3] & 0xff, u32::from(grid));
            }
        }
        assert_eq!(next as usize, list.instances.len());
        assert_eq!(DrawList::new(&cut, |_| None).draws().count(), 0);
        let [kept, rest] = [0, 1].map(|wanted| {
            let mut turn = 0;
            list.filtered(|_| {
                turn += 1;
                turn % 2 == wanted
            })
        });
        assert_eq!(kept.triangles() + rest.triangles(), list.triangles());
        assert_eq!(list.filtered(|_| true), list);
    }
}
