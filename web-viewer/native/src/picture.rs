//! A picture in memory, and as a PNG file.

use crate::NativeError;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use std::io::Write;
use std::path::Path;

/// A picture: sRGB with alpha, 8 bits a channel, row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Four bytes a pixel.
    pub rgba: Vec<u8>,
}

impl Picture {
    /// Red, green, blue and alpha at (x, y); `None` outside.
    pub fn pixel(&self, x: u32, y: u32) -> Option<[u8; 4]> {
        if x >= self.width || y >= self.height {
            return None;
        }
        let start = usize::try_from(u64::from(y) * u64::from(self.width) + u64::from(x))
            .ok()?
            .checked_mul(4)?;
        self.rgba.get(start..start.checked_add(4)?)?.try_into().ok()
    }

    /// Writes a PNG to `path`: whole, or not at all.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_png(&self, path: &Path) -> Result<(), NativeError> {
        let mut png = Vec::new();
        PngEncoder::new(&mut png)
            .write_image(
                &self.rgba,
                self.width,
                self.height,
                ExtendedColorType::Rgba8,
            )
            .map_err(|cause| NativeError::Encode {
                path: path.to_owned(),
                cause,
            })?;
        write_whole(path, &png).map_err(|cause| NativeError::File {
            path: path.to_owned(),
            cause,
        })
    }
}

/// Writes beside `path`, syncs, renames.
fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    make_readable(file.as_file())?;
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}

/// Temporary files are private; a result is not.
#[cfg(unix)]
fn make_readable(file: &std::fs::File) -> std::io::Result<()> {
    file.set_permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644))
}

#[cfg(not(unix))]
fn make_readable(_: &std::fs::File) -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_round_trips_and_replaces() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.png");
        std::fs::write(&path, b"old").unwrap();
        let picture = Picture {
            width: 2,
            height: 1,
            rgba: vec![255, 0, 255, 255, 1, 2, 3, 255],
        };
        picture.write_png(&path).unwrap();
        let read = image::load_from_memory(&std::fs::read(&path).unwrap())
            .unwrap()
            .to_rgba8();
        assert_eq!(read.as_raw(), &picture.rgba);
        assert_eq!(picture.pixel(1, 0), Some([1, 2, 3, 255]));
        assert_eq!(picture.pixel(0, 1), None);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_that_does_not_exist_is_named() {
        let picture = Picture {
            width: 1,
            height: 1,
            rgba: vec![0; 4],
        };
        let error = picture
            .write_png(Path::new("/does/not/exist/x.png"))
            .unwrap_err();
        assert!(error.to_string().contains("/does/not/exist/x.png"));
    }
}
