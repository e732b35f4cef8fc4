//! The `marquetry` binary: subcommands, nothing else.
fn main() {}
