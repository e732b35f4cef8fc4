//! Real scans, CAD models and broken meshes, where they are at hand: what is read, and that it becomes a valid manifold.

use marquetry_converter::error::ImportError;
use marquetry_converter::import::import;
use marquetry_converter::mesh::account::Reason;
use marquetry_converter::mesh::prepare;
use std::path::PathBuf;

/// The data folder beside the project; a note instead of the tests where there is none.
fn data() -> Option<PathBuf> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let found = root.is_dir();
    if !found {
        eprintln!("ignored: {} is not there", root.display());
    }
    found.then_some(root)
}

/// File, triangles, vertices as stored; components, boundary loops, edges with more than two faces after welding.
type Row = (&'static str, u64, u64, usize, usize, usize);

fn check(rows: &[Row]) {
    let Some(root) = data() else { return };
    for &(name, triangles, vertices, components, loops, non_manifold) in rows {
        let path = root.join(name);
        let (mesh, report) = import(&path).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(
            (report.triangles, report.vertices),
            (triangles, vertices),
            "{name}"
        );
        assert_eq!(
            report.bytes,
            path.metadata().map_or(0, |m| m.len()),
            "{name}"
        );
        let (manifold, account) = prepare(mesh).unwrap_or_else(|e| panic!("{e}"));
        let t = account.topology;
        assert_eq!(
            (t.components, t.boundary_loops, t.non_manifold_edges),
            (components, loops, non_manifold),
            "{name}"
        );
        assert_eq!(
            (manifold.check(), account.check()),
            (Ok(()), Ok(())),
            "{name}"
        );
        assert_eq!(account.weld_tolerance, None, "{name}");
    }
}

#[test]
fn difficult_files_become_manifolds() {
    check(&[
        ("difficult/as_sphereWithHole.stl", 285, 855, 1, 1, 0),
        ("difficult/as_triangle_with_empty_solid.stl", 1, 3, 1, 1, 0),
        ("difficult/cgal_b9_mesh.off", 10174, 5951, 47, 76, 0),
        ("difficult/cgal_blobby-shuffled.off", 4050, 2027, 1, 0, 0),
        ("difficult/cgal_cheese.off", 17786, 8629, 1, 0, 0),
        ("difficult/cgal_diplodocus.off.gz", 47960, 23982, 1, 0, 2),
        (
            "difficult/cgal_elephant-with-holes.off",
            4463,
            2798,
            1,
            106,
            0,
        ),
        ("difficult/cgal_mech-holes-shark.off", 10192, 5246, 1, 4, 0),
        ("difficult/cgal_pig.stl.gz", 16848, 50544, 1, 5, 0),
        ("difficult/cgal_turbine.off", 18460, 9210, 1, 0, 0),
        ("difficult/igea_tristrips.ply.gz", 268_686, 134_345, 1, 0, 0),
        ("difficult/igl_truck.obj", 4770, 2956, 50, 144, 54),
        ("difficult/mp_chair.off", 1804, 2564, 3, 1, 1029),
        ("difficult/mp_table.off", 12500, 13244, 12, 0, 31),
        ("difficult/tm_bunny.ply", 16301, 8171, 1, 5, 150),
        ("difficult/tm_capsule.obj.gz", 10200, 5252, 1, 0, 0),
        ("difficult/tm_multibody.stl", 32, 96, 2, 0, 0),
        ("difficult/tm_negative_indices.obj", 12, 8, 1, 0, 0),
        ("difficult/tm_soup.stl", 100, 300, 100, 100, 0),
        ("difficult/wm_37989_sf.obj", 11210, 5233, 1, 0, 232),
        ("textured_meshroom/texturedMesh.obj", 53364, 26984, 50, 4, 0),
    ]);
}

#[test]
fn scans_and_buildings_become_manifolds() {
    check(&[
        ("bun_zipper.ply", 69451, 35947, 1, 5, 0),
        ("armadillo_86k.obj.gz", 86482, 43243, 1, 0, 0),
        ("dragon_vrip.ply", 871_414, 437_645, 1, 0, 0),
        (
            "komaba_textured_600k.glb",
            588_061,
            541_759,
            363,
            1080,
            48076,
        ),
        (
            "bim/schependomlaan_subcontractors.glb",
            348_925,
            231_354,
            7229,
            35,
            15861,
        ),
        (
            "bim/openfoam_motorBike.obj.gz",
            331_653,
            132_871,
            4,
            2,
            100_089,
        ),
    ]);
}

#[test]
fn welding_closes_the_dragon() {
    let Some(root) = data() else { return };
    let (mesh, _) = import(&root.join("dragon_vrip.ply")).unwrap_or_else(|e| panic!("{e}"));
    let (manifold, account) = prepare(mesh).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(account.lost(Reason::Degenerate).triangles, 108);
    assert_eq!(account.topology.vertices, 437_645 - 2100);
    assert!(!manifold.twins.contains(&marquetry_converter::mesh::NONE));
    let euler = i128::try_from(manifold.positions.len() + manifold.triangles.len()).unwrap_or(0)
        - i128::try_from(manifold.twins.len() / 2).unwrap_or(0);
    assert_eq!(euler, -108);
}

#[test]
fn files_without_geometry_are_refused() {
    let Some(root) = data() else { return };
    for name in ["difficult/tm_empty.ply", "difficult/tm_empty.stl"] {
        let error = import(&root.join(name)).map(|_| ()).expect_err(name);
        assert!(matches!(error, ImportError::Content { .. }));
        let message = error.to_string();
        assert!(
            message.contains(name) && message.contains("no triangles"),
            "{message}"
        );
    }
}
