//! The `marquetry` binary: subcommands, nothing else.

mod cli;

fn main() -> std::process::ExitCode {
    cli::run()
}
