//! The list itself.

use super::meshes as m;
use super::model::Expected::{Charts, Clusters, Converts};
use super::model::{both_ways, each_way, refused};
use super::{Case, Part, attributes, elsewhere, files, scale, streaming};
use glam::DVec3;

/// Every case, part by part.
pub fn catalogue() -> Vec<Case> {
    let mut cases = topology();
    cases.extend(numbers());
    cases.extend(shape());
    cases.extend(files::cases());
    cases.extend(streaming::cases());
    cases.extend(attributes::cases());
    cases.extend(scale::cases());
    cases.extend(elsewhere::cases());
    cases.extend(not_built());
    cases.sort_by_key(|case| case.part);
    cases
}

fn topology() -> Vec<Case> {
    let of = |set, name: &str, expected, make: fn() -> super::soup::Soup| {
        both_ways(Part::Topology, set, name, expected, make)
    };
    let (borders, tiny, handles) = (Some("borders"), Some("tiny"), Some("handles"));
    let (orientation, joints) = (Some("orientation"), Some("non_manifold"));
    let (thin, many) = (Some("thin"), Some("many"));
    let mut cases = vec![
        of(borders, "ears", Charts, || m::ears(24)),
        of(borders, "chords", Charts, || m::strip(400)),
        of(borders, "400 holes", Clusters, || {
            m::sheet(121, |i, j| i % 6 == 3 && j % 6 == 3)
        }),
        of(borders, "2 500 pinholes", Clusters, || {
            m::sheet(100, |i, j| i % 2 == 1 && j % 2 == 1)
        }),
        of(None, "100 489 pinholes", Clusters, || {
            m::sheet(634, |i, j| i % 2 == 1 && j % 2 == 1)
        }),
        of(borders, "holes far apart", Charts, || {
            m::sheet(121, |i, j| i % 24 == 3 && j % 24 == 3)
        }),
        of(tiny, "triangle", Clusters, m::triangle),
        of(tiny, "tetrahedron", Clusters, m::tetrahedron),
        of(tiny, "pillow", Clusters, m::pillow),
        of(tiny, "cube", Clusters, || m::cube(1)),
        of(handles, "genus 100", Charts, || m::perforated(10)),
        of(handles, "genus 100 with noise", Charts, || {
            m::perforated(10).shaken(0.02, 3)
        }),
        of(orientation, "Moebius strip", Charts, || m::moebius(120, 10)),
        of(orientation, "Klein bottle", Converts, || m::klein(80, 40)),
        of(orientation, "half of the faces flipped", Charts, || {
            m::sphere(60, 30).half_flipped(5)
        }),
        of(joints, "bow-ties", Converts, || m::bow_ties(12)),
        of(None, "T-junction walls", Converts, || {
            m::t_junctions(&[24, 7, 31, 10])
        }),
        of(thin, "double shell 1e-4 apart", Charts, || {
            m::double_shell(60, 30, 1e-4)
        }),
        of(thin, "plate 1e-4 thick", Charts, || m::plate(20, 1e-4)),
        of(many, "3 000 cubes", Clusters, || m::cubes(3000)),
        of(many, "3 000 grass cards", Clusters, || m::cards(3000)),
        of(many, "cubes on a sheet", Converts, || {
            m::sheet(40, |_, _| false).with(&m::cubes(200))
        }),
        of(None, "100 000 cubes", Clusters, || m::cubes(100_000)),
        of(None, "100 000 grass cards", Clusters, || m::cards(100_000)),
    ];
    for pages in 3..=8 {
        let set = [3, 5, 8].contains(&pages).then_some("non_manifold");
        let name = format!("{pages} faces on an edge");
        cases.push(both_ways(Part::Topology, set, &name, Converts, move || {
            m::book(pages, 16)
        }));
    }
    cases.into_iter().flatten().collect()
}

fn numbers() -> Vec<Case> {
    let of = |name: &str, expected, make: fn() -> super::soup::Soup| {
        both_ways(Part::Numbers, None, name, expected, make)
    };
    let mut cases: Vec<Case> = [
        of("torus times 1e20", Charts, || {
            m::torus(64, 32).map(|p| p * 1e20)
        }),
        of("torus times 1e-20", Charts, || {
            m::torus(64, 32).map(|p| p * 1e-20)
        }),
        of("torus 1e7 away", Charts, || {
            m::torus(64, 32).map(|p| p + DVec3::new(1e7, -1e7, 1e7))
        }),
        of("slivers of a million to one", Converts, || {
            m::torus(40, 20).pinched(5, 1e-6)
        }),
        // Mostly thinner than the lattice tells, which has charts by default, too.
        each_way(
            Part::Numbers,
            None,
            "a sheet drawn out a million times",
            [Converts; 2],
            || m::sheet(24, |_, _| false).map(|p| p * DVec3::new(1e6, 1.0, 1.0)),
        ),
        of("collinear triangles in a surface", Converts, || {
            m::torus(40, 20).pinched(7, 0.0)
        }),
        of("coplanar, a flat axis", Converts, || m::flat(30)),
        of("coplanar, a slope", Converts, || {
            m::flat(30).map(|p| p + DVec3::Z * (0.3 * p.x - 0.7 * p.y))
        }),
    ]
    .into_iter()
    .flatten()
    .collect();
    for (name, bad) in [
        ("NaN", f64::NAN),
        ("infinity", f64::INFINITY),
        ("beyond the range of the format", -1.2e182),
    ] {
        cases.push(refused(Part::Numbers, name, "not finite", move || {
            let mut soup = m::torus(32, 16);
            soup.positions[77].y = bad;
            soup
        }));
    }
    cases
}

fn shape() -> Vec<Case> {
    let of = |set, name: &str, expected, make: fn() -> super::soup::Soup| {
        both_ways(Part::Shape, set, name, expected, make)
    };
    let (far, rough) = (Some("protrusions"), Some("roughness"));
    let (creases, regular) = (Some("creases"), Some("regular"));
    // An edge of this sphere is about 0.08 long.
    let noisy = |edges: f64| m::sphere(80, 40).shaken(edges * 0.08, 1);
    let mut cases: Vec<Case> = [
        of(far, "spikes", Charts, || m::sphere(80, 40).spiked(3.0, 12)),
        of(far, "fingers", Charts, || m::fingers(5)),
        of(far, "tube of 60 radii", Charts, || m::tube(60.0, 24, 200)),
        of(far, "pole of valence 1 000", Clusters, || {
            m::sphere(1_000, 3)
        }),
        of(None, "pole of valence 10 000", Clusters, || {
            m::sphere(10_000, 3)
        }),
        of(rough, "voxel stairs", Charts, || m::voxel_ball(12)),
        of(creases, "cube of 16² cells a face", Charts, || m::cube(16)),
        of(creases, "bracket", Charts, || m::bracket(24)),
        of(regular, "regular grid", Charts, || {
            m::sheet(64, |_, _| false)
        }),
        of(None, "regular flat grid", Converts, || m::flat(64)),
        of(regular, "regular torus", Charts, || m::torus(64, 32)),
    ]
    .into_iter()
    .flatten()
    .collect();
    let [huge_pole, _] = of(None, "pole of valence 100 000", Clusters, || {
        m::sphere(100_000, 3)
    });
    cases.push(huge_pole);
    cases.push(Case::open(
        Part::Shape,
        "pole of valence 100 000, charts",
        "`--charts always` needs more than 4 GiB before it sees that charts take too many samples, and is refused",
    ));
    for (edges, set) in [
        (0.05, rough),
        (0.1, None),
        (0.2, rough),
        (0.4, None),
        (0.6, rough),
    ] {
        let name = format!("noise of {edges} edges");
        cases.extend(both_ways(Part::Shape, set, &name, Charts, move || {
            noisy(edges)
        }));
    }
    cases
}

/// What the design lists and the converter does not do yet.
fn not_built() -> Vec<Case> {
    let scenes = "scenes are not built: `convert --kind scene` and `--schedule` are refused";
    let terrain = "terrain is not built: `convert --kind terrain` is refused";
    [
        (Part::Time, "objects of one step's life", scenes),
        (Part::Time, "f exactly ½", scenes),
        (Part::Time, "complementary pairs", scenes),
        (Part::Time, "a million events", scenes),
        (Part::Terrain, "one-sample spikes", terrain),
        (Part::Terrain, "voids", terrain),
        (Part::Terrain, "edge pages", terrain),
        (Part::Terrain, "a flat sea", terrain),
    ]
    .map(|(part, name, why)| Case::open(part, name, why))
    .into()
}
