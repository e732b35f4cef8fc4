//! What can go wrong in the engine.

/// The engine refused something.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EngineError {
    /// A camera that is not six finite numbers, or whose eye is its target.
    #[error("camera `{text}`: {reason}; expected six numbers eye.x,y,z,target.x,y,z")]
    Camera {
        /// What was given.
        text: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A standard view that does not exist.
    #[error("view {0} does not exist; standard views are 0 to 25")]
    NoSuchView(usize),
    /// An option outside its range.
    #[error("{name} is {value}; it must be {expected}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// What was given.
        value: String,
        /// What would be right.
        expected: &'static str,
    },
    /// The file holds content that this version does not draw.
    #[error("the file holds {0} content, which this version does not show")]
    UnsupportedContent(&'static str),
    /// The device cannot hold the first image.
    #[error("the GPU offers {available} texture layers; the base of this file needs {needed}")]
    DeviceTooSmall {
        /// Layers the base needs.
        needed: u32,
        /// Layers the device has.
        available: u32,
    },
    /// A cut refers to pages that its source cannot give.
    #[error(transparent)]
    File(#[from] marquetry_format::Error),
    /// The index does not hold what the cut needs.
    #[error("page {0} is not in the index; load the whole index first")]
    IndexIncomplete(u32),
}
