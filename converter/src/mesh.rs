//! Triangle meshes between import and segmentation.
//!
//! [`prepare`] is the whole way: [`mod@weld`] finds the vertices, [`mod@decimate`] takes away triangles that a huge mesh has to
//! spare ([`mod@refit`] moves what is left to where it is nearest), `t_junction` joins edges that meet along their length, [`duplicates`] finds what is there twice, [`mod@manifold`]
//! the oriented surface, and [`account`] keeps the books.

pub mod account;
pub mod adjacency;
pub mod caps;
mod check;
pub mod decimate;
pub mod duplicates;
mod fans;
pub mod fingers;
pub mod handles;
pub mod manifold;
pub mod normals;
pub mod refit;
mod simplicial;
mod t_junction;
pub mod weld;

use crate::error::{ImportError, MAX_TRIANGLES};
use crate::texture::appearance::Appearance;
use account::{Account, Reason, Topology};
use adjacency::EdgeTable;
use glam::DVec3;
use marquetry_evaluation::distance::Mesh;

/// No vertex, half-edge or face.
pub const NONE: u32 = u32::MAX;

/// Coordinates up to this, either way, are taken for places: squares of areas made of them are still numbers.
pub const FARTHEST: f64 = 1e70;

/// Whether a position is a place: finite, and no farther along any axis than [`FARTHEST`].
pub fn is_place(position: DVec3) -> bool {
    position.is_finite() && position.abs().max_element() <= FARTHEST
}

/// Least and greatest coordinates; infinite, and the wrong way round, without positions.
pub fn bounds(positions: &[DVec3]) -> (DVec3, DVec3) {
    positions
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &p| {
            (min.min(p), max.max(p))
        })
}

/// A mesh as an importer read it: polygons triangulated, nothing welded, nothing dropped yet.
#[derive(Debug, Clone, Default)]
pub struct ImportedMesh {
    /// Vertex positions, input units. May hold what is no place ([`is_place`]).
    pub positions: Vec<DVec3>,
    /// Vertex sRGB colours, as many as positions, or empty.
    pub colours: Vec<[u8; 3]>,
    /// Triangles; every index is in range.
    pub triangles: Vec<[u32; 3]>,
    /// Materials and textures of the triangles.
    pub appearance: Appearance,
}

/// A mesh in which every position occurs once: all corners are places, every triangle has three different ones, and
/// every vertex is used.
#[derive(Debug, Clone, Default)]
pub struct WeldedMesh {
    /// Vertex positions, input units.
    pub positions: Vec<DVec3>,
    /// Vertex sRGB colours, as many as positions, or empty.
    pub colours: Vec<[u8; 3]>,
    /// Triangles, in the order of the import.
    pub triangles: Vec<[u32; 3]>,
}

impl WeldedMesh {
    /// As what distances are measured of.
    pub fn surface(&self) -> Mesh<'_> {
        Mesh {
            positions: &self.positions,
            triangles: &self.triangles,
        }
    }
}

/// An oriented 2-manifold with border. Every vertex has one fan of triangles; every edge has one or two.
///
/// It is a simplicial complex: no two edges have the same two vertices, and no two triangles the same three.
#[derive(Debug, Clone, Default)]
pub struct ManifoldMesh {
    /// Vertex positions; copies made to split a vertex have bit-equal positions.
    pub positions: Vec<DVec3>,
    /// Welded vertex that each vertex is (a copy of).
    pub origin: Vec<u32>,
    /// sRGB colours, as many as positions, or empty.
    pub colours: Vec<[u8; 3]>,
    /// Unit vertex normals (area-and-angle-weighted over all copies of the origin that lie on the same sheet).
    pub normals: Vec<DVec3>,
    /// Counter-clockwise triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Opposite half-edge of half-edge `3 * t + k` (which runs from corner k to corner k + 1 of triangle t), or [`NONE`].
    pub twins: Vec<u32>,
    /// Middle vertices of the caps that [`handles`] and [`fingers`] put in, ascending; the triangles around them are no part of the import.
    pub cap_apexes: Vec<u32>,
}

/// Welds `mesh` and makes an oriented manifold of it; the account says what became of every triangle.
///
/// # Errors
/// [`ImportError::NoSurface`] if no triangle is left, [`ImportError::TooLarge`] if there are more than 32-bit ids can number.
/// The file's name is missing in both: add it with [`ImportError::in_file`].
pub fn prepare(mesh: ImportedMesh) -> Result<(ManifoldMesh, Account), ImportError> {
    let (welded, mut account) = weld(mesh)?;
    let manifold = orient(welded, &mut account);
    Ok((manifold, account))
}

/// The first part of [`prepare`]: vertices with the same position become one.
///
/// # Errors
/// As [`prepare`].
pub fn weld(mesh: ImportedMesh) -> Result<(WeldedMesh, Account), ImportError> {
    if mesh.triangles.len() > MAX_TRIANGLES {
        return Err(ImportError::TooLarge {
            path: None,
            triangles: mesh.triangles.len(),
        });
    }
    let mut account = Account::new(&mesh);
    let welded = weld::exact(mesh, &mut account);
    if welded.triangles.is_empty() {
        return Err(ImportError::NoSurface {
            path: None,
            triangles: account.imported.triangles,
            non_finite: account.lost(Reason::NonFinite).triangles,
            degenerate: account.lost(Reason::Degenerate).triangles,
        });
    }
    Ok((welded, account))
}

/// The second part of [`prepare`]: an oriented manifold.
pub fn orient(mut welded: WeldedMesh, account: &mut Account) -> ManifoldMesh {
    let mut table = EdgeTable::new(&welded.triangles, welded.positions.len());
    if let Some((better, better_table)) = weld::tolerant(&welded, &table, account) {
        (welded, table) = (better, better_table);
    }
    account.topology = Topology::of(&welded, &table);
    if t_junction::insert(&mut welded, &table, account) {
        table = EdgeTable::new(&welded.triangles, welded.positions.len());
    }
    if duplicates::remove(&mut welded, &table, account) {
        table = EdgeTable::new(&welded.triangles, welded.positions.len());
    }
    let manifold = manifold::manifold(welded, &table, account);
    account.close(&manifold);
    manifold
}

#[cfg(test)]
mod tests;
