//! `marquetry view`: a window.

use super::render::Looks;
use super::{Verdict, open};
use anyhow::Context;
use marquetry_native::window;
use std::sync::Arc;

/// Show a file in a window
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The .marq file, or its URL
    file: String,
    #[command(flatten)]
    looks: Looks,
}

pub(super) fn run(arguments: &Arguments) -> anyhow::Result<Verdict> {
    let opened = open::open(&arguments.file)?;
    let options = arguments.looks.viewer_options();
    window::view(&Arc::from(opened.source), options).with_context(|| arguments.file.clone())?;
    Ok(Verdict::Good)
}
