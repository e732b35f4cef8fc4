//! The command line: subcommands, options that all of them have, and how a run ends.
//!
//! Exit codes: 0 done, 1 the input or the network is at fault, 2 wrong usage. A panic is caught here and
//! becomes exit 1 with a message, whatever thread it was in.

mod args;
mod chart;
mod convert;
mod export;
mod info;
mod measure;
mod open;
mod output;
mod panics;
mod progress;
mod reference;
mod render;
mod serve;
mod surface;
mod verify;
mod view;

use clap::Parser;
use marquetry_server::config::{Log, LogFormat};
use output::{JsonTarget, Output};
use std::num::NonZeroUsize;
use std::process::ExitCode;

/// Turns huge 3D scans into one streamable file, serves it, and shows it.
#[derive(Debug, Parser)]
#[command(name = "marquetry", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    common: Common,
}

/// Options of every subcommand.
#[derive(Debug, Clone, clap::Args)]
struct Common {
    /// Write the machine-readable report to PATH (`-` for standard output)
    #[arg(long, global = true, value_name = "PATH")]
    json: Option<JsonTarget>,
    /// Use at most N threads [default: all]
    #[arg(long, global = true, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Show progress
    #[arg(long, global = true, value_enum, default_value_t)]
    progress: progress::When,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Convert(convert::Arguments),
    Info(info::Arguments),
    Verify(verify::Arguments),
    Measure(measure::Arguments),
    Chart(chart::Arguments),
    Export(export::Arguments),
    Render(render::Arguments),
    Serve(serve::Arguments),
    View(view::Arguments),
}

/// How a command that ran to its end ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    /// All is well: exit 0.
    Good,
    /// The input is at fault, and the output says how: exit 1.
    Bad,
}

/// Reads the command line, runs the command, and says how it went.
pub(crate) fn run() -> ExitCode {
    // Prints usage errors and exits with 2 by itself.
    let Cli { command, common } = Cli::parse();
    let log = match &command {
        Command::Serve(arguments) => arguments.log(),
        _ => Log::default(),
    };
    start_logging(log);
    match panics::caught(|| dispatch(command, &common)) {
        Ok(Ok(Verdict::Good)) => ExitCode::SUCCESS,
        Ok(Ok(Verdict::Bad)) => ExitCode::FAILURE,
        Ok(Err(error)) => {
            output::complain(&format!("error: {}", output::with_causes(&error)));
            ExitCode::FAILURE
        }
        Err(panic) => {
            output::complain(&format!(
                "internal error: {panic}\nThis is a fault of marquetry, not of your input. Please report \
                 it with the command and, where you may share it, the input: {}/issues",
                env!("CARGO_PKG_REPOSITORY")
            ));
            ExitCode::FAILURE
        }
    }
}

fn dispatch(command: Command, common: &Common) -> anyhow::Result<Verdict> {
    if let Some(threads) = common.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .build_global()?;
    }
    let output = Output::new(common.json.clone());
    match command {
        Command::Convert(arguments) => convert::run(&arguments, common, &output),
        Command::Info(arguments) => info::run(&arguments, &output),
        Command::Verify(arguments) => verify::run(&arguments, &output),
        Command::Measure(arguments) => measure::run(&arguments, &output),
        Command::Chart(arguments) => chart::run(&arguments, common, &output),
        Command::Export(arguments) => export::run(&arguments, &output),
        Command::Render(arguments) => render::run(&arguments, &output),
        Command::Serve(arguments) => serve::run(&arguments, common, &output),
        Command::View(arguments) => view::run(&arguments),
    }
}

/// Warnings and worse go to standard error; the variable `RUST_LOG` asks for more.
fn start_logging(log: Log) {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| {
        let requests = if log.requests {
            ",marquetry::requests=info"
        } else {
            ""
        };
        format!("warn,wgpu_core=error,wgpu_hal=error,naga=error{requests}").into()
    });
    let lines = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr);
    match log.format {
        LogFormat::Text => lines.with_target(false).init(),
        LogFormat::Json => lines.json().flatten_event(true).init(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn common_options_stand_before_or_after_the_subcommand() {
        for line in [
            "marquetry --threads 2 --json - info a.marq",
            "marquetry info a.marq --threads 2 --json -",
        ] {
            let cli = Cli::try_parse_from(line.split(' ')).unwrap();
            assert_eq!(cli.common.threads, NonZeroUsize::new(2));
            assert_eq!(cli.common.json, Some(JsonTarget::Stdout));
        }
    }

    #[test]
    fn wrong_usage_is_refused() {
        for line in [
            "marquetry",
            "marquetry nonsense",
            "marquetry info",
            "marquetry info a.marq --threads 0",
            "marquetry info a.marq --progress sometimes",
            "marquetry convert a.ply",
            "marquetry convert -o a.marq",
            "marquetry convert a.ply -o a.marq --error-rel 0",
            "marquetry convert a.ply -o a.marq --error-rel nan",
            "marquetry convert a.ply -o a.marq --memory lots",
            "marquetry convert a.ply -o a.marq --up w",
            "marquetry measure a.marq",
            "marquetry measure a.marq --against b.ply --triangles 5 --bytes 5",
            "marquetry measure a.marq --against b.ply --samples 0",
            "marquetry chart a.marq --against b.ply",
            "marquetry chart a.marq -o d",
            "marquetry chart a.marq --against b.ply -o d --views 27",
            "marquetry chart a.marq --against b.ply -o d --distances 0",
            "marquetry chart a.marq --against b.ply -o d --error-px nan",
            "marquetry chart a.marq --against b.ply -o d --no-convert --error-rels 1e-3",
            "marquetry export a.marq -o a.fbx",
            "marquetry export a.marq -o a.ply --triangles 5 --error-rel 1e-3",
            "marquetry render a.marq -o a.png --view 26",
            "marquetry render a.marq -o a.png --size 100",
            "marquetry render a.marq -o a.png --size 0x100",
            "marquetry render a.marq -o a.png --view 1 --camera 0,0,1,0,0,0",
            "marquetry render a.marq -o a.png --camera 0,0,1,0,0",
            "marquetry render a.marq -o a.png --error-px -1",
            "marquetry render a.marq -o a.png --background red",
            "marquetry serve",
            "marquetry serve a.marq --tls-key k.pem",
            "marquetry serve a.marq --valid soon",
            "marquetry serve a.marq --log-format xml",
        ] {
            let error = Cli::try_parse_from(line.split(' ')).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{line}");
        }
    }
}
