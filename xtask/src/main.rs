//! Tasks of the project: demo, test, web build.
fn main() {}
