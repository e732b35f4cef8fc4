//! Cases that are tests elsewhere.

use super::named::{Named, Test, case};
use super::{Case, Part};

pub(super) fn cases() -> Vec<Case> {
    NAMED
        .iter()
        .map(|&(part, name, required, test)| case(part, name, required, test))
        .collect()
}

const ENGINE: &str = "web-viewer/engine";
const NATIVE: &str = "web-viewer/native";
const HOLDS: &str = "holds";
const REFUSED: &str = "is refused, named";

const fn of(
    part: Part,
    name: &'static str,
    required: &'static str,
    test: [&'static str; 3],
) -> Named {
    (part, name, required, Test(test[0], test[1], test[2]))
}

pub(super) const NAMED: &[Named] = &[
    of(
        Part::Topology,
        "walls with T-junctions are joined",
        HOLDS,
        [
            "converter",
            "lib",
            "mesh::t_junction::tests::walls_with_t_junctions_become_connected",
        ],
    ),
    of(
        Part::Topology,
        "a hole keeps both borders",
        HOLDS,
        [
            "tests",
            "convert_serve_render",
            "surface_with_a_hole_keeps_both_borders",
        ],
    ),
    of(
        Part::Numbers,
        "NaN and infinity, also with `--allow-worse`",
        "is refused, or left out and counted",
        ["converter", "numbers", "a_vertex_that_is_not_finite"],
    ),
    of(
        Part::Numbers,
        "no vertex is finite",
        REFUSED,
        ["converter", "numbers", "nothing_finite"],
    ),
    of(
        Part::Numbers,
        "nothing but collinear triangles",
        "converts, or is refused for lack of area",
        ["converter", "numbers", "nothing_but_collinear_triangles"],
    ),
    of(
        Part::Numbers,
        "slivers, all triangles kept",
        HOLDS,
        ["converter", "numbers", "slivers_of_a_million_to_one"],
    ),
    of(
        Part::Numbers,
        "collinear triangles, all kept",
        HOLDS,
        [
            "converter",
            "numbers",
            "collinear_triangles_within_a_surface",
        ],
    ),
    of(
        Part::Numbers,
        "coplanar along every axis",
        HOLDS,
        ["converter", "numbers", "coplanar_triangles_and_a_flat_axis"],
    ),
    of(
        Part::Numbers,
        "ten scales and a far place give the same result",
        HOLDS,
        [
            "converter",
            "numbers",
            "results_do_not_depend_on_units_or_place",
        ],
    ),
    of(
        Part::Numbers,
        "far more triangles than the error asks for",
        HOLDS,
        [
            "converter",
            "numbers",
            "far_more_triangles_than_the_error_asks_for",
        ],
    ),
    of(
        Part::Numbers,
        "a target finer than the lattice",
        "ends, and says what was reached",
        ["converter", "targets", "a_target_finer_than_the_lattice"],
    ),
    of(
        Part::Shape,
        "deep tubes and towers have certified maps",
        HOLDS,
        [
            "converter",
            "lib",
            "parameterize::tests::a_deep_tube_is_certified",
        ],
    ),
    of(
        Part::Shape,
        "any surface is segmented",
        HOLDS,
        [
            "converter",
            "lib",
            "segment::tests::any_surface_is_segmented",
        ],
    ),
    of(
        Part::Glue,
        "a chart glued to itself twice, in the file",
        HOLDS,
        ["format", "round_trip", "torus_glued_to_itself_survives"],
    ),
    of(
        Part::Glue,
        "a chart glued to itself turned over, in the file",
        HOLDS,
        ["format", "round_trip", "moebius_strip_survives"],
    ),
    of(
        Part::Glue,
        "mixed levels, in the file",
        HOLDS,
        [
            "format",
            "round_trip",
            "cube_sphere_at_mixed_levels_survives",
        ],
    ),
    of(
        Part::Glue,
        "a chart glued to its own neighbouring side, resampled",
        HOLDS,
        [
            "converter",
            "lib",
            "atlas::leaves::tests::a_chart_glued_to_itself_shares_its_own_side",
        ],
    ),
    of(
        Part::Glue,
        "a corner of five charts, resampled",
        HOLDS,
        [
            "converter",
            "lib",
            "atlas::leaves::tests::a_corner_of_five_charts_is_one_point",
        ],
    ),
    of(
        Part::Glue,
        "all eight orientations",
        HOLDS,
        [
            ENGINE,
            "lib",
            "testing::crown::tests::charts_are_glued_in_all_eight_ways_and_meet_by_three_to_ten",
        ],
    ),
    of(
        Part::Glue,
        "corners of 3 to 10 charts at mixed levels",
        "no crack",
        [
            ENGINE,
            "lib",
            "testing::crown::tests::corners_of_three_to_ten_charts_are_closed_at_mixed_levels_and_in_motion",
        ],
    ),
    of(
        Part::Glue,
        "any cut of glued charts is closed",
        "no crack",
        [
            ENGINE,
            "lib",
            "lod::mesh::tests::closed_atlas_gives_a_closed_mesh_for_any_cut_and_residency",
        ],
    ),
    of(
        Part::Glue,
        "any cut in motion is closed",
        "no crack",
        [
            ENGINE,
            "lib",
            "lod::mesh::tests::closed_atlas_stays_closed_in_motion",
        ],
    ),
    of(
        Part::Glue,
        "balance goes through glue",
        HOLDS,
        [
            ENGINE,
            "lib",
            "lod::balance::tests::one_deep_node_pulls_its_neighbours_along_across_glue",
        ],
    ),
    of(
        Part::Glue,
        "both leaves at a border draw it alike",
        HOLDS,
        [
            ENGINE,
            "lib",
            "lod::edge_morph::tests::both_leaves_at_a_border_agree",
        ],
    ),
    of(
        Part::Glue,
        "the shader closes every border",
        "no crack",
        [
            NATIVE,
            "gpu_parity",
            "shader_agrees_with_the_reference_and_closes_every_border",
        ],
    ),
    of(
        Part::Streaming,
        "26 views of a torus in ten states of the cache",
        "no hole",
        ["tests", "watertight", "torus_has_no_holes"],
    ),
    of(
        Part::Streaming,
        "26 views of a scan in ten states of the cache",
        "no hole",
        ["tests", "watertight", "armadillo_has_no_holes"],
    ),
    of(
        Part::Streaming,
        "a cache of a tenth of the file",
        "settles within it, no hole",
        ["tests", "tiny_cache", "torus_settles_in_a_tenth"],
    ),
    of(
        Part::Streaming,
        "teleports and spins of made-up charts",
        "no crack",
        [
            ENGINE,
            "lib",
            "viewer::tests::teleports_and_spins_never_show_a_hole",
        ],
    ),
    of(
        Part::Streaming,
        "groups of clusters within a budget",
        "no crack",
        [
            ENGINE,
            "lib",
            "viewer::tests::groups::groups_stream_within_a_budget_and_without_a_crack",
        ],
    ),
    of(
        Part::Streaming,
        "faults are said and overcome",
        "the picture of a good network",
        [
            ENGINE,
            "lib",
            "viewer::tests::faults_are_reported_and_overcome",
        ],
    ),
    of(
        Part::Streaming,
        "pages that never come",
        "the coarser picture",
        [
            ENGINE,
            "lib",
            "viewer::tests::pages_that_never_come_leave_the_coarser_picture",
        ],
    ),
    of(
        Part::Streaming,
        "results of decoding in any order, with faults",
        "the picture of inline decoding",
        [
            ENGINE,
            "lib",
            "viewer::jobs::tests::settles_as_inline_does_whatever_the_order_and_the_faults",
        ],
    ),
    of(
        Part::Streaming,
        "every way to a view",
        "the same picture",
        [
            NATIVE,
            "headless",
            "settled_picture_is_the_same_by_every_way_to_it",
        ],
    ),
    of(
        Part::Streaming,
        "an answer that stops half-way",
        "an error",
        ["tests", "bad_input", "url_that_stops_half_way_is_an_error"],
    ),
    of(
        Part::Streaming,
        "a body that breaks off at the server",
        "is never passed on as whole",
        [
            "server",
            "http",
            "sources::a_body_that_breaks_off_is_never_passed_on_as_whole",
        ],
    ),
    of(
        Part::Attributes,
        "a textured scan, whole and torn",
        "SSIM of 0.85 to 0.9 to its source",
        ["tests", "textures", "a_scan_keeps_its_textures"],
    ),
    of(
        Part::Attributes,
        "mirrored nodes of glTF",
        HOLDS,
        [
            "converter",
            "lib",
            "import::gltf::tests::mirrored_nodes_turn_their_triangles",
        ],
    ),
    of(
        Part::Scale,
        "killed at 24 moments",
        "nothing is left behind",
        ["tests", "killed", "killed_conversions_leave_nothing_behind"],
    ),
    of(
        Part::Scale,
        "a full disk",
        REFUSED,
        ["tests", "killed", "a_full_disk_is_named_and_leaves_nothing"],
    ),
    of(
        Part::Scale,
        "what needs more than `--memory`",
        REFUSED,
        ["tests", "killed", "the_memory_ceiling_holds"],
    ),
    of(
        Part::Scale,
        "one thread and two",
        "the same bytes",
        [
            "tests",
            "convert_serve_render",
            "any_number_of_threads_writes_the_same_bytes",
        ],
    ),
    of(
        Part::Input,
        "empty files",
        REFUSED,
        ["tests", "bad_input", "empty_files_are_refused"],
    ),
    of(
        Part::Input,
        "no triangles",
        REFUSED,
        ["tests", "bad_input", "files_without_triangles_are_refused"],
    ),
    of(
        Part::Input,
        "all triangles degenerate",
        REFUSED,
        ["tests", "bad_input", "files_without_area_are_refused"],
    ),
    of(
        Part::Input,
        "files cut short",
        REFUSED,
        ["tests", "bad_input", "files_cut_short_are_refused"],
    ),
    of(
        Part::Input,
        "no meshes at all",
        REFUSED,
        ["tests", "bad_input", "files_that_are_no_mesh_are_refused"],
    ),
    of(
        Part::Input,
        "coordinates that are no numbers",
        REFUSED,
        [
            "tests",
            "bad_input",
            "coordinates_that_are_no_numbers_are_refused",
        ],
    ),
    of(
        Part::Input,
        "indices out of range",
        REFUSED,
        ["tests", "bad_input", "indices_out_of_range_are_refused"],
    ),
    of(
        Part::Input,
        "counts beyond the file",
        "is refused without taking memory",
        [
            "tests",
            "bad_input",
            "counts_beyond_the_file_are_refused_without_taking_memory",
        ],
    ),
    of(
        Part::Input,
        "converted files cut short",
        "is refused by every command",
        [
            "tests",
            "bad_input",
            "marq_cut_short_is_refused_by_every_command",
        ],
    ),
    of(
        Part::Input,
        "converted files with a bit flipped",
        "is noticed",
        ["tests", "bad_input", "every_flipped_bit_is_found"],
    ),
    of(
        Part::Input,
        "malformed files of every kind",
        REFUSED,
        [
            "format",
            "malformed",
            "every_malformed_file_is_refused_for_its_fault",
        ],
    ),
];
