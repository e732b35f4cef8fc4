use super::*;
use crate::import::import;
use crate::mesh::ImportedMesh;

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

/// Imports `square.obj` of a folder with these files.
fn imported(obj: &str, files: &[(&str, &[u8])]) -> ImportedMesh {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let path = folder.path().join("square.obj");
    std::fs::write(&path, format!("mtllib all.mtl\n{SQUARE}{obj}")).unwrap();
    let (mesh, report) = import(&path).unwrap();
    let others: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    let own = std::fs::metadata(&path).unwrap().len();
    assert!(report.bytes <= own + others as u64 && report.bytes >= own);
    mesh
}

#[test]
fn corners_keep_their_coordinates_through_triangulation() {
    let mesh = imported(
        "usemtl wall\nf 1/1 2/2 3/3 4/4\nusemtl floor\nf -4/-1 -3/-2 -2/-3\nf 1 2\n",
        &[
            ("all.mtl", b"newmtl wall\nKd 1 1 1\nmap_Kd a b.png\nnewmtl floor\nmap_Kd -clamp on -s 2 3 -o 0.5 0 c.png\nbump n.png\n"),
            ("a b.png", b"one"),
            ("c.png", b"two"),
        ],
    );
    let Appearance {
        images,
        materials,
        faces,
        warnings,
        normal_maps,
    } = &mesh.appearance;
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(*normal_maps, 1);
    let names: Vec<&str> = images.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["a b.png", "c.png"]);
    assert_eq!(materials[1].wrap, [Wrap::Clamp; 2]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    let uv = |pairs: [[f32; 2]; 3]| pairs.map(Vec2::from_array);
    assert_eq!(faces[0].uv, uv([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]));
    assert_eq!(faces[1].uv, uv([[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]]));
    // Scaled, moved, and counted from the upper edge: (u, v) is (2u + ½, 1 − 3v).
    assert_eq!(faces[2].uv, uv([[0.5, -2.0], [2.5, -2.0], [2.5, 1.0]]));
    assert_eq!([0, 1, 2].map(|k| faces[k].material), [0, 0, 1]);
}

#[test]
fn what_is_missing_costs_a_warning() {
    let face = "usemtl wall\nf 1/1 2/2 3/3\n";
    let none = imported(face, &[]);
    assert_eq!(none.appearance.warnings.len(), 1);
    assert!(none.appearance.warnings[0].contains("all.mtl"));
    let no_image = imported(
        face,
        &[("all.mtl", b"newmtl wall\nKd 1 0 0\nmap_Kd gone.png\n")],
    );
    assert!(no_image.appearance.warnings[0].contains("gone.png"));
    assert!(!no_image.appearance.is_textured() && no_image.appearance.has_colours());
    assert_eq!(no_image.appearance.materials[0].factor, Vec3::X);
    let no_material = imported(face, &[("all.mtl", b"newmtl other\n")]);
    assert!(no_material.appearance.warnings[0].contains("`wall`"));
    let no_uv = imported(
        "usemtl wall\nf 1 2 3\n",
        &[("all.mtl", b"newmtl wall\nmap_Kd a.png\n"), ("a.png", b"x")],
    );
    assert!(no_uv.appearance.warnings[0].contains("1 triangles"));
    assert_eq!(no_uv.appearance.faces, [TexturedFace::PLAIN]);
}

#[test]
fn files_elsewhere_are_not_read() {
    let mesh = imported(
        "usemtl wall\nf 1/1 2/2 3/3\n",
        &[("all.mtl", b"newmtl wall\nmap_Kd /etc/hostname\n")],
    );
    assert!(mesh.appearance.images.is_empty());
    assert_eq!(mesh.appearance.warnings.len(), 1);
}

#[test]
fn options_of_maps_are_told_from_names() {
    for (text, file, scale) in [
        ("a.png", "a.png", 1.0),
        ("-s 2 2 2 a.png", "a.png", 2.0),
        ("-s 2 a.png", "a.png", 2.0),
        ("-blendu on -s 3 3 my file.png", "my file.png", 3.0),
        ("-mm 0 1 7.png", "7.png", 1.0),
        ("", "", 1.0),
        ("-s", "", 1.0),
    ] {
        let map = Map::parse(text.as_bytes());
        assert_eq!((map.file.as_str(), map.scale.x), (file, scale), "{text}");
    }
}
