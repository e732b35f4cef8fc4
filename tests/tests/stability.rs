//! The stability list in its reduced form: what runs in seconds. `cargo xtask stability` runs all of it.

use marquetry_tests::data;
use marquetry_tests::stability::{DIFFICULT, Depth, Outcome, Part, catalogue, missing_tests};
use std::collections::BTreeSet;

/// Runs the cases of a set and asserts that each comes out as required.
fn assert_holds(set: &str) {
    let mut faults = Vec::new();
    let mut cases = catalogue();
    cases.retain(|case| case.set == Some(set));
    assert!(!cases.is_empty(), "there is no set {set}");
    for case in cases {
        let row = case.row(Depth::Reduced);
        eprintln!("{}", row.line());
        if matches!(row.outcome, Outcome::Missed(_)) {
            faults.push(row.line());
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// A test a set, and a list of them all.
macro_rules! sets {
    ($($set:ident),* $(,)?) => {
        $(
            #[test]
            fn $set() {
                assert_holds(stringify!($set));
            }
        )*
        const SETS: &[&str] = &[$(stringify!($set)),*];
    };
}

sets!(
    borders,
    tiny,
    handles,
    orientation,
    non_manifold,
    thin,
    many,
    protrusions,
    roughness,
    creases,
    regular,
    difficult_files,
    streaming,
    attributes,
);

#[test]
fn every_set_is_run() {
    let known: BTreeSet<&str> = SETS.iter().copied().collect();
    let used: BTreeSet<&str> = catalogue().iter().filter_map(|case| case.set).collect();
    assert_eq!(known, used);
}

#[test]
fn cases_have_names_of_their_own_and_every_part_has_some() {
    let cases = catalogue();
    assert!(cases.len() >= 60, "{}", cases.len());
    let names: BTreeSet<(Part, &str)> = cases
        .iter()
        .map(|case| (case.part, case.name.as_str()))
        .collect();
    assert_eq!(names.len(), cases.len());
    for part in Part::ALL {
        assert!(cases.iter().any(|case| case.part == part), "{part:?}");
    }
}

#[test]
fn cases_that_are_tests_name_tests_that_exist() {
    assert_eq!(missing_tests().unwrap(), Vec::<String>::new());
}

#[test]
fn every_difficult_file_is_a_case() {
    let Some(folder) = data::find("difficult") else {
        return;
    };
    let found: BTreeSet<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    let known: BTreeSet<String> = DIFFICULT
        .iter()
        .map(|(name, _)| (*name).to_owned())
        .collect();
    assert_eq!(found, known);
}
