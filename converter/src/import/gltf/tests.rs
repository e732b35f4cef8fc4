use super::*;
use crate::import::import_bytes;
use crate::mesh::ImportedMesh;
use glam::DVec3;

/// A `.glb` of this JSON and these bytes.
fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut text = json.as_bytes().to_vec();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut data = binary.to_vec();
    data.resize(data.len().next_multiple_of(4), 0);
    let word = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend(word(12 + 8 + text.len() + 8 + data.len()));
    file.extend(word(text.len()));
    file.extend(b"JSON");
    file.extend(text);
    file.extend(word(data.len()));
    file.extend(b"BIN\0");
    file.extend(data);
    file
}

/// Four corners of a square as floats, then 0 1 2 3 as bytes at offset 48.
fn square() -> Vec<u8> {
    let corners = [
        0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0,
    ];
    let mut bytes: Vec<u8> = corners.iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0, 1, 2, 3]);
    bytes
}

/// A scene of one node (`node`) with one primitive (`primitive`) over accessor 0 (positions) and 1 (indices).
fn json(node: &str, primitive: &str, more: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0{node}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}{primitive}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
        {{"bufferView":1,"componentType":5121,"count":4,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":4}}],
        "buffers":[{{"byteLength":52}}]{more}}}"#
    )
}

fn read_glb(json: &str, binary: &[u8]) -> Result<ImportedMesh, String> {
    import_bytes(glb(json, binary), Path::new("test.glb"))
        .map(|(mesh, _)| mesh)
        .map_err(|e| e.to_string())
}

#[test]
fn modes_unroll_to_triangles() {
    for (primitive, expected) in [
        (r#","indices":1,"mode":5"#, vec![[0, 1, 2], [2, 1, 3]]),
        (r#","indices":1,"mode":6"#, vec![[0, 1, 2], [0, 2, 3]]),
        (r#","indices":1"#, vec![[0, 1, 2]]),
        (r#","mode":4"#, vec![[0, 1, 2]]),
    ] {
        let mesh = read_glb(&json("", primitive, ""), &square()).unwrap();
        assert_eq!(mesh.triangles, expected, "{primitive}");
        assert!(mesh.colours.is_empty());
    }
    let error = read_glb(&json("", r#","mode":1"#, ""), &square()).unwrap_err();
    assert!(error.contains("no triangles"), "{error}");
}

#[test]
fn mirrored_nodes_turn_their_triangles() {
    let mesh = read_glb(
        &json(r#","scale":[-1,1,1],"translation":[5,0,0]"#, "", ""),
        &square(),
    )
    .unwrap();
    assert_eq!(mesh.positions[1], DVec3::new(4.0, 0.0, 0.0));
    assert_eq!(mesh.triangles, [[0, 2, 1]]);
    let turned = read_glb(&json(r#","rotation":[0,0,1,0]"#, "", ""), &square()).unwrap();
    assert!(turned.positions[1].distance(DVec3::NEG_X) < 1e-12);
    assert_eq!(turned.triangles, [[0, 1, 2]]);
}

#[test]
fn quantized_positions_are_scaled() {
    let quantized = json("", "", r#","extensionsUsed":["KHR_mesh_quantization"],"extensionsRequired":["KHR_mesh_quantization"]"#)
        .replace(r#""componentType":5126,"count":4"#, r#""componentType":5122,"normalized":true,"count":3"#)
        .replace(r#""byteLength":48}"#, r#""byteLength":48,"byteStride":8}"#);
    let mut bytes = square();
    for (i, p) in [[0_i16, 0, 0], [32767, 0, 0], [0, -32768, 0]]
        .iter()
        .enumerate()
    {
        for (k, c) in p.iter().enumerate() {
            bytes[8 * i + 2 * k..8 * i + 2 * k + 2].copy_from_slice(&c.to_le_bytes());
        }
    }
    let mesh = read_glb(&quantized, &bytes).unwrap();
    assert_eq!(mesh.positions, [DVec3::ZERO, DVec3::X, DVec3::NEG_Y]);
}

#[test]
fn colours_come_from_vertices_and_materials() {
    let coloured = json(
        "",
        r#","material":0"#,
        r#","materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,0.5,0,1]}}]"#,
    );
    let mesh = read_glb(&coloured, &square()).unwrap();
    assert_eq!(mesh.colours, [[255, 188, 0]; 4]);
    let both = coloured
        .replace(r#"{"POSITION":0}"#, r#"{"POSITION":0,"COLOR_0":2}"#)
        .replace(r#""type":"SCALAR"}"#, r#""type":"SCALAR"},{"bufferView":1,"componentType":5121,"normalized":true,"count":1,"type":"VEC4"}"#);
    let mesh = read_glb(&both, &square()).unwrap();
    assert_eq!(mesh.colours[1], [255, 188, 0]);
    assert_eq!(mesh.colours[0][0], 0);
}

#[test]
fn sparse_accessors_replace_elements() {
    let sparse = json("", "", "").replace(
        r#""type":"VEC3"}"#,
        r#""type":"VEC3","sparse":{"count":1,"indices":{"bufferView":1,"byteOffset":1,"componentType":5121},
           "values":{"bufferView":0,"byteOffset":36}}}"#,
    );
    let mesh = read_glb(&sparse, &square()).unwrap();
    assert_eq!(mesh.positions[1], DVec3::new(1.0, 1.0, 0.0));
}

#[test]
fn buffers_may_be_embedded_or_lie_beside() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a b.bin"), square()).unwrap();
    let path = folder.path().join("scene.gltf");
    let beside = json("", "", "").replace(
        r#"{"byteLength":52}"#,
        r#"{"byteLength":52,"uri":"a%20b.bin"}"#,
    );
    let (mesh, report) = import_bytes(beside.clone().into_bytes(), &path).unwrap();
    assert_eq!(mesh.triangles.len(), 1);
    assert_eq!(report.bytes, beside.len() as u64 + 52);
    let missing = import_bytes(beside.replace("a%20b", "c").into_bytes(), &path)
        .unwrap_err()
        .to_string();
    assert!(missing.contains("c.bin"), "{missing}");
}

#[test]
fn compressed_geometry_is_refused_by_name() {
    for (extension, part) in [
        ("KHR_draco_mesh_compression", "Draco"),
        ("EXT_meshopt_compression", "meshopt"),
        ("EXT_unheard_of", "EXT_unheard_of"),
    ] {
        let text = json("", "", &format!(r#","extensionsRequired":["{extension}"]"#));
        let error = read_glb(&text, &square()).unwrap_err();
        assert!(
            error.contains(part) && error.contains("not supported"),
            "{error}"
        );
    }
    let text = json("", "", r#","extensionsRequired":["KHR_materials_unlit"]"#);
    assert!(read_glb(&text, &square()).is_ok());
    let text = json("", "", r#","extensionsUsed":["EXT_mesh_gpu_instancing"]"#);
    assert!(read_glb(&text, &square()).is_err());
}

#[test]
fn faults_in_the_json_are_named() {
    for (from, to, part) in [
        (r#""mesh":0"#, r#""mesh":0,"children":[0]"#, "two parents"),
        (r#""mesh":0"#, r#""mesh":7"#, "no mesh 7"),
        (r#""nodes":[0]"#, r#""nodes":[3]"#, "no node 3"),
        (r#""POSITION":0"#, r#""POSITION":9"#, "no accessor 9"),
        (r#""POSITION":0"#, r#""POSITION":1"#, "three coordinates"),
        (
            r#""count":4,"type":"VEC3""#,
            r#""count":5,"type":"VEC3""#,
            "within its buffer",
        ),
        (
            r#""count":4,"type":"VEC3""#,
            r#""count":18446744073709551615,"type":"VEC3""#,
            "more elements",
        ),
        (
            r#""byteOffset":48,"byteLength":4"#,
            r#""byteOffset":48,"byteLength":5"#,
            "within its buffer",
        ),
        (r#""byteLength":52"#, r#""byteLength":60"#, "announces 60"),
        (
            r#""count":4,"type":"VEC3""#,
            r#""count":3,"type":"VEC3""#,
            "refers to vertex 3, but there are 3",
        ),
        (r#""version":"2.0""#, r#""version":"2.0"#, "JSON"),
    ] {
        let good = json("", r#","indices":1,"mode":5"#, "");
        let bad = good.replacen(from, to, 1);
        assert_ne!(good, bad, "{from}");
        let error = read_glb(&bad, &square()).unwrap_err();
        assert!(error.contains(part), "{to}: {error}");
    }
}

#[test]
fn a_cut_glb_is_refused() {
    let file = glb(&json("", "", ""), &square());
    for end in 4..file.len() {
        let error = import_bytes(file[..end].to_vec(), Path::new("a.glb"))
            .unwrap_err()
            .to_string();
        assert!(error.contains("ends early"), "{end}: {error}");
    }
}

#[test]
fn instances_cannot_multiply_without_end() {
    let nodes: Vec<String> = (0..4000).map(|_| r#"{"mesh":0}"#.to_owned()).collect();
    let roots: Vec<String> = (0..4000).map(|i| i.to_string()).collect();
    let text = json("", "", "")
        .replace(
            r#""nodes":[0]"#,
            &format!(r#""nodes":[{}]"#, roots.join(",")),
        )
        .replace(r#"{"mesh":0}"#, &nodes.join(","))
        .replace(
            r#""count":4,"type":"VEC3""#,
            r#""count":30000,"type":"VEC3""#,
        )
        .replace(r#""byteLength":48"#, r#""byteLength":360000"#)
        .replace(r#""byteLength":52"#, r#""byteLength":360000"#);
    let error = read_glb(&text, &vec![0; 360_000]).unwrap_err();
    assert!(error.contains("instances"), "{error}");
}

/// The square with texture coordinates (accessor 2), one material and one image that `image` says.
fn textured(material: &str, image: &str, sampler: &str) -> (String, Vec<u8>) {
    let mut bytes = square();
    for uv in [[0.0_f32, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
        bytes.extend(uv.iter().flat_map(|x| x.to_le_bytes()));
    }
    let more = format!(
        r#","materials":[{{"normalTexture":{{"index":0}},"pbrMetallicRoughness":{{{material}}}}}],
        "textures":[{{"source":0,"sampler":0}}],"samplers":[{{{sampler}}}],"images":[{{{image}}}]"#
    );
    let json = json("", r#","indices":1,"mode":5,"material":0"#, &more)
        .replace(r#"{"POSITION":0}"#, r#"{"POSITION":0,"TEXCOORD_0":2}"#)
        .replace(
            r#""type":"SCALAR"}]"#,
            r#""type":"SCALAR"},{"bufferView":2,"componentType":5126,"count":4,"type":"VEC2"}]"#,
        )
        .replace(
            r#""byteLength":4}]"#,
            r#""byteLength":4},{"buffer":0,"byteOffset":52,"byteLength":32}]"#,
        )
        .replace(
            r#""buffers":[{"byteLength":52}]"#,
            r#""buffers":[{"byteLength":84}]"#,
        );
    (json, bytes)
}

#[test]
fn base_colour_textures_cover_their_triangles() {
    use crate::texture::appearance::Wrap;
    use glam::{Vec2, Vec3};
    let (text, bytes) = textured(
        r#""baseColorFactor":[1,0.5,0,1],"baseColorTexture":{"index":0}"#,
        r#""bufferView":1,"mimeType":"image/png""#,
        r#""wrapS":33071,"wrapT":33648"#,
    );
    let appearance = read_glb(&text, &bytes).unwrap().appearance;
    assert_eq!(appearance.images[0].bytes, [0, 1, 2, 3]);
    let material = appearance.materials[0];
    assert_eq!(material.factor, Vec3::new(1.0, 0.5, 0.0));
    assert_eq!(material.wrap, [Wrap::Clamp, Wrap::Mirror]);
    assert_eq!(appearance.normal_maps, 1);
    assert_eq!(appearance.faces[0].uv, [Vec2::ZERO, Vec2::X, Vec2::Y]);
    assert_eq!(appearance.faces[1].uv, [Vec2::Y, Vec2::X, Vec2::ONE]);
}

#[test]
fn texture_coordinates_are_transformed() {
    use glam::Vec2;
    let (text, bytes) = textured(
        r#""baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"offset":[1,2],"rotation":1.5707963,"scale":[2,3]}}}"#,
        r#""uri":"data:image/png;base64,AAEC""#,
        "",
    );
    let appearance = read_glb(&text, &bytes).unwrap().appearance;
    assert_eq!(appearance.images[0].bytes, [0, 1, 2]);
    // As the extension's specification writes it: translation · rotation · scale, rotation by (cos, sin; −sin, cos).
    let expected = [[1.0, 2.0], [1.0, 0.0], [4.0, 2.0]];
    for (found, expected) in appearance.faces[0].uv.iter().zip(expected) {
        assert!(
            found.distance(Vec2::from_array(expected)) < 1e-5,
            "{found} {expected:?}"
        );
    }
}

#[test]
fn images_that_are_missing_cost_a_warning() {
    for (image, part) in [
        (r#""uri":"gone.png""#, "gone.png"),
        (r#""bufferView":9"#, "within its buffer"),
        (r#""name":"empty""#, "neither"),
    ] {
        let (text, bytes) = textured(r#""baseColorTexture":{"index":0}"#, image, "");
        let appearance = read_glb(&text, &bytes).unwrap().appearance;
        assert!(
            appearance.warnings[0].contains(part),
            "{:?}",
            appearance.warnings
        );
        assert!(!appearance.is_textured());
    }
    let (text, bytes) = textured(r#""baseColorTexture":{"index":0}"#, r#""bufferView":1"#, "");
    let without = text.replace(r#","TEXCOORD_0":2"#, "");
    let appearance = read_glb(&without, &bytes).unwrap().appearance;
    assert!(appearance.warnings[0].contains("2 triangles"));
}
