//! Colours of faces, as materials without an image.
//!
//! Limit: where vertices have colours too, these count alone.

use super::Soup;
use crate::atlas::colour::linear_from_srgb;
use crate::texture::appearance::{Material, NO_MATERIAL, TexturedFace};
use std::collections::HashMap;

/// Gives the triangles of `soup` the colours of their faces; those of faces without one stay plain.
pub(super) fn put_on(soup: &mut Soup) {
    let colours = std::mem::take(&mut soup.face_colours);
    if !soup.colours.is_empty() || colours.iter().all(Option::is_none) {
        return;
    }
    let mut known: HashMap<[u8; 3], u32> = HashMap::new();
    let mut materials = Vec::new();
    let mut material_of = |colour: [u8; 3]| {
        *known.entry(colour).or_insert_with(|| {
            materials.push(Material {
                factor: linear_from_srgb(colour),
                ..Material::default()
            });
            u32::try_from(materials.len() - 1).unwrap_or(NO_MATERIAL)
        })
    };
    let numbers: Vec<u32> = colours
        .into_iter()
        .map(|colour| colour.map_or(NO_MATERIAL, &mut material_of))
        .collect();
    let Some(numbers) = soup.faces.spread(&soup.positions, &numbers) else {
        return;
    };
    let face = |material| TexturedFace {
        material,
        ..TexturedFace::PLAIN
    };
    soup.appearance.faces = numbers.into_iter().map(face).collect();
    soup.appearance.materials = materials;
}

#[cfg(test)]
mod tests {
    use crate::atlas::colour::srgb_from_linear;
    use crate::import::import_bytes;
    use crate::mesh::ImportedMesh;
    use std::path::Path;

    const PLACES: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n";

    fn imported(text: &str) -> ImportedMesh {
        let bytes = text.as_bytes().to_vec();
        import_bytes(bytes, Path::new("made.up")).unwrap().0
    }

    /// Colour by triangle, sRGB.
    fn colours(mesh: &ImportedMesh) -> Vec<Option<[u8; 3]>> {
        let materials = &mesh.appearance.materials;
        let colour =
            |material: u32| Some(srgb_from_linear(materials.get(material as usize)?.factor));
        let faces = mesh.appearance.faces.iter();
        faces.map(|face| colour(face.material)).collect()
    }

    #[test]
    fn triangles_have_the_colours_of_their_faces() {
        let mesh = imported(&format!(
            "OFF\n5 6 0\n{PLACES}3 0 1 4 9 9 9\n2 0 1 1 1 1\n4 0 1 2 3 200 0 3\n3 1 2 4\n4 0 0 1 1 7 7 7\n3 2 3 4 9 9 9\n"
        ));
        let (one, other) = (Some([9; 3]), Some([200, 0, 3]));
        assert_eq!(
            mesh.triangles,
            [[0, 1, 4], [0, 1, 2], [0, 2, 3], [1, 2, 4], [2, 3, 4]]
        );
        assert_eq!(colours(&mesh), [one, other, other, None, one]);
        // One a colour, used or not.
        assert_eq!(mesh.appearance.materials.len(), 3);
        assert!(mesh.colours.is_empty() && !mesh.appearance.is_textured());
    }

    fn ply(vertex: &str, places: &str) -> String {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n{vertex}element face 3\n\
             property float red\nproperty float green\nproperty float blue\nproperty list uchar int vertex_indices\nend_header\n\
             {places}1 0 0 4 0 1 2 3\n0 0 0 2 0 1\n0 0.2 1 3 0 1 4\n"
        )
    }

    #[test]
    fn colours_of_vertices_go_before() {
        let mesh = imported(&ply("", PLACES));
        let (one, other) = (Some([255, 0, 0]), Some([0, 51, 255]));
        assert_eq!(colours(&mesh), [one, one, other]);
        let properties = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
        let mesh = imported(&ply(properties, &PLACES.replace('\n', " 4 5 6\n")));
        assert_eq!(mesh.colours, [[4, 5, 6]; 5]);
        assert!(mesh.appearance.faces.is_empty() && mesh.appearance.materials.is_empty());
    }
}
