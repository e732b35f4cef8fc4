//! Leaves that come twice.
//!
//! Where texels of the source are far shorter than a pixel while the triangles of leaves are asked for, leaves have longer texels, and a level below, two or three of them at a time,
//! there are the same triangles with all texels. So a view takes images that are about as fine as its pixels. What is above the leaves is made from the
//! longer texels.

use super::below::Below;
use super::{Brush, Painted, TextureError};
use marquetry_format::ClusterMesh;
use marquetry_format::writer::ClusterInput;

/// Least length of the longer texels, over that of the source's.
const LONGER: f64 = 4.0;
/// Texels of the image of a leaf from which on it may come twice.
const LARGE: usize = 1 << 10;
/// Leaves that are replaced together: as few as the children of a group may be. A single one that is left over joins them.
const TOGETHER: usize = 2;

/// Leaves that come twice, and what they are with all of their texels, with the length of these.
pub(super) struct Twice {
    leaves: Vec<usize>,
    finer: Vec<(ClusterMesh, f32)>,
}

impl Twice {
    /// Adds leaves below the leaves, which become a group.
    pub(super) fn add_to(self, nodes: &mut Vec<ClusterInput>) {
        let Self { leaves, finer } = self;
        let first = u32::try_from(nodes.len()).unwrap_or(u32::MAX);
        let children: Vec<u32> = (first..).take(leaves.len()).collect();
        let errors = leaves.iter().map(|&leaf| nodes[leaf].error);
        let error = errors.fold(0.0, f32::max);
        let own = leaves.iter().filter_map(|&leaf| nodes[leaf].texel);
        let texels = own.chain(finer.iter().map(|(_, texel)| *texel));
        let longest = texels.fold(0.0, f32::max);
        for (leaf, (mesh, texel)) in leaves.into_iter().zip(finer) {
            let leaf = &mut nodes[leaf];
            let child = ClusterInput {
                mesh,
                error: leaf.error,
                texel: Some(texel),
                children: Vec::new(),
            };
            leaf.children.clone_from(&children);
            leaf.error = error;
            leaf.texel = Some(longest);
            nodes.push(child);
        }
    }
}

/// Leaves of a group, what they are, and which of them come twice.
pub(super) type Leaves = (Vec<usize>, Vec<Painted>, Vec<Twice>);

impl Brush<'_> {
    /// Gives those `leaves` longer texels that come twice. They are asked for where what is above them shows its `error`, lattice units, and up to
    /// where the source's texels are seen: the longer texels are halfway between these, by their ratio, or a little longer.
    pub(super) fn twice(
        &self,
        nodes: &[ClusterInput],
        error: f64,
        leaves: Vec<usize>,
        painted: Vec<Painted>,
    ) -> Result<Leaves, TextureError> {
        let is_large = |painted: &Painted| {
            let image = painted.image.as_ref();
            image.is_some_and(|(_, texels, _)| texels.rgb.len() >= LARGE)
        };
        let all = leaves.into_iter().zip(painted);
        let (mut large, others): (Vec<_>, Vec<_>) = all.partition(|(_, painted)| is_large(painted));
        let (mut leaves, mut painted): (Vec<_>, Vec<_>) = others.into_iter().unzip();
        let mut twice = Vec::new();
        while !large.is_empty() {
            let is_last = large.len() <= TOGETHER + 1;
            let count = if is_last { large.len() } else { TOGETHER };
            let (members, mut finest): (Vec<_>, Vec<_>) = large.drain(..count).unzip();
            leaves.extend_from_slice(&members);
            let Some(reduced) = self.reduced(nodes, error, &members, &finest)? else {
                painted.extend(finest);
                continue;
            };
            painted.extend(reduced);
            let finer = finest.iter_mut().filter_map(|painted| painted.mesh.take());
            let finer = finer.map(|(mut mesh, texel)| {
                // Each vertex becomes itself, which is the nearest.
                mesh.ranks = vec![0; mesh.positions.len()];
                (mesh, texel)
            });
            twice.push(Twice {
                finer: finer.collect(),
                leaves: members,
            });
        }
        Ok((leaves, painted, twice))
    }

    /// `members` with longer texels; `None` where they are too few, or what is above has texels that are hardly longer.
    fn reduced(
        &self,
        nodes: &[ClusterInput],
        error: f64,
        members: &[usize],
        finest: &[Painted],
    ) -> Result<Option<Vec<Painted>>, TextureError> {
        let below = Below::new(finest).filter(|_| members.len() >= TOGETHER);
        let most = below.as_ref().map_or(0.0, |below| below.finest() * error);
        let longer = most.sqrt().max(LONGER);
        if longer > most {
            return Ok(None);
        }
        let reduce = |&member: &usize| self.inner(&nodes[member], below.as_ref(), 1.0 / longer);
        let reduced = members.iter().map(reduce).collect::<Result<Vec<_>, _>>()?;
        let have_images = reduced.iter().all(|reduced| reduced.mesh.is_some());
        Ok(have_images.then_some(reduced))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(error: f32, texel: f32, children: Vec<u32>) -> ClusterInput {
        ClusterInput {
            mesh: ClusterMesh::default(),
            error,
            texel: Some(texel),
            children,
        }
    }

    #[test]
    fn leaves_become_a_group_with_what_they_were_below() {
        let mut nodes = vec![
            node(9.0, 40.0, vec![1, 2, 3]),
            node(1.0, 20.0, Vec::new()),
            node(3.0, 16.0, Vec::new()),
            node(2.0, 4.0, Vec::new()),
        ];
        let mesh = |x| ClusterMesh {
            positions: vec![[x; 3]],
            ..ClusterMesh::default()
        };
        let twice = Twice {
            leaves: vec![2, 1],
            finer: vec![(mesh(2), 4.0), (mesh(1), 5.0)],
        };
        twice.add_to(&mut nodes);
        let facts = |k: usize| {
            let ClusterInput {
                error,
                texel,
                children,
                ..
            } = &nodes[k];
            (*error, texel.unwrap(), children.as_slice())
        };
        // Members of a group have one error and one length of texels.
        assert_eq!(facts(1), (3.0, 20.0, &[4, 5][..]));
        assert_eq!(facts(2), (3.0, 20.0, &[4, 5][..]));
        assert_eq!(facts(3), (2.0, 4.0, &[][..]));
        // As near to the source as they were, each.
        assert_eq!(facts(4), (3.0, 4.0, &[][..]));
        assert_eq!(facts(5), (1.0, 5.0, &[][..]));
        assert_eq!([4, 5].map(|k: usize| nodes[k].mesh.positions[0][0]), [2, 1]);
    }
}
