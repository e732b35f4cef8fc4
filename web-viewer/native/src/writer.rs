//! Pictures written beside what goes on: encoding one takes longer than drawing the next.

use crate::{NativeError, Picture};
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::mpsc::{SyncSender, sync_channel};

/// Takes pictures to write.
pub(crate) struct Writer<'a> {
    begin: SyncSender<(PathBuf, Picture)>,
    failed: &'a Mutex<Option<NativeError>>,
}

impl Writer<'_> {
    /// Has a picture written to `path`, as [`Picture::write_png`] does; waits where as many are under way as there are threads.
    /// Whether all went well so far: if not, nothing more is written.
    pub(crate) fn write(&self, path: PathBuf, picture: Picture) -> bool {
        !has_failed(self.failed) && self.begin.send((path, picture)).is_ok()
    }
}

/// Runs `work`, which has pictures written, on `threads` threads, at least one; ends when all of them are written.
///
/// # Errors
/// That of `work`, else the first picture that could not be written.
pub(crate) fn writing<T>(
    threads: usize,
    work: impl FnOnce(&Writer<'_>) -> Result<T, NativeError>,
) -> Result<T, NativeError> {
    let failed = Mutex::new(None);
    let (begin, begun) = sync_channel::<(PathBuf, Picture)>(0);
    let begun = Mutex::new(begun);
    let result = std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                // One waits, the others wait for that one.
                let next = || begun.lock().ok()?.recv().ok();
                while let Some((path, picture)) = next() {
                    if has_failed(&failed) {
                        continue;
                    }
                    if let Err(error) = picture.write_png(&path)
                        && let Ok(mut failed) = failed.lock()
                    {
                        failed.get_or_insert(error);
                    }
                }
            });
        }
        // Dropped here: then there is nothing more to wait for.
        let writer = Writer {
            begin,
            failed: &failed,
        };
        work(&writer)
    })?;
    match failed.into_inner() {
        Ok(Some(error)) => Err(error),
        _ => Ok(result),
    }
}

fn has_failed(failed: &Mutex<Option<NativeError>>) -> bool {
    failed.lock().is_ok_and(|failed| failed.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn picture(level: u8) -> Picture {
        Picture {
            width: 2,
            height: 1,
            rgba: vec![level; 8],
        }
    }

    #[test]
    fn every_picture_is_written_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = |k: u8| folder.path().join(format!("{k}.png"));
        for threads in [0, 1, 3] {
            let sum = writing(threads, |writer| {
                assert!((0..20).all(|k| writer.write(path(k), picture(k))));
                Ok(7)
            });
            assert_eq!(sum.unwrap(), 7);
            for k in 0..20 {
                let read = image::open(path(k)).unwrap().into_rgba8();
                assert_eq!(read.into_raw(), picture(k).rgba);
                std::fs::remove_file(path(k)).unwrap();
            }
        }
    }

    #[test]
    fn what_cannot_be_written_ends_it_and_is_said() {
        let bad = Path::new("/does/not/exist/x.png");
        let mut taken = 0;
        let error = writing(2, |writer| {
            while writer.write(bad.to_owned(), picture(1)) {
                taken += 1;
            }
            Ok(())
        });
        assert!(error.unwrap_err().to_string().contains("x.png"));
        assert!(taken > 0);
        // What went wrong before comes first.
        let error = writing(2, |writer| {
            writer.write(bad.to_owned(), picture(1));
            Err::<(), _>(NativeError::CameraPath {
                path: "path.json".into(),
                reason: "none".to_owned(),
            })
        });
        assert!(error.unwrap_err().to_string().contains("path.json"));
    }
}
