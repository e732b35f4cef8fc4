//! What can go wrong in the native shell.

use marquetry_engine::{EngineError, wgpu};
use std::path::PathBuf;

/// Something the native shell could not do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NativeError {
    /// No GPU, not even a software one.
    #[error(
        "no graphics adapter: install a Vulkan driver (on Debian, mesa-vulkan-drivers has one in software): {0}"
    )]
    NoAdapter(String),
    /// The adapter refused to make a device.
    #[error("the graphics adapter {adapter} gives no device: {cause}")]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// Its reason.
        cause: wgpu::RequestDeviceError,
    },
    /// The window could not be made or shown.
    #[error("no window: {0}")]
    Window(String),
    /// The picture did not come back from the GPU.
    #[error("the picture cannot be read back: {0}")]
    ReadBack(String),
    /// A picture larger than the adapter can make, or empty.
    #[error("a picture of {width}x{height} pixels is not possible; sides are 1 to {most}")]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// Most pixels a side.
        most: u32,
    },
    /// A mesh that does not fit into a buffer of the device.
    #[error("a mesh takes {size_bytes} bytes in one buffer; the graphics adapter allows {most}")]
    MeshTooLarge {
        /// Bytes of its vertices, or of its triangles.
        size_bytes: u64,
        /// Most bytes of a buffer.
        most: u64,
    },
    /// What the view needs could not be fetched.
    #[error("the view is incomplete, {missing} pages did not come: {}", reasons.join("; "))]
    Incomplete {
        /// Pages missing.
        missing: u64,
        /// The last failures, in words.
        reasons: Vec<String>,
    },
    /// The engine refused something.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The file could not be opened.
    #[error(transparent)]
    Format(#[from] marquetry_format::Error),
    /// A file on disk could not be read or written.
    #[error("{}: {cause}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        cause: std::io::Error,
    },
    /// A picture could not be encoded.
    #[error("{}: {cause}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: image::ImageError,
    },
    /// A camera path that is not what [`crate::path`] describes.
    #[error("{}: {reason}", path.display())]
    CameraPath {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        reason: String,
    },
}
