//! Panics become a message.

use std::panic::{self, AssertUnwindSafe};
use std::sync::{Mutex, PoisonError};

/// What the first panic said, and where it was. Later ones mostly follow from it.
static FIRST: Mutex<Option<String>> = Mutex::new(None);

/// Runs `work`; a panic in it, or one that another thread passed on to it, comes back as its message.
pub(super) fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    panic::set_hook(Box::new(|info| {
        let mut first = FIRST.lock().unwrap_or_else(PoisonError::into_inner);
        first.get_or_insert_with(|| {
            let message = info.payload_as_str().unwrap_or("no message");
            match info.location() {
                Some(place) => format!("{message} ({}:{})", place.file(), place.line()),
                None => message.to_owned(),
            }
        });
    }));
    // Nothing of what `work` touched is used again after a panic.
    panic::catch_unwind(AssertUnwindSafe(work)).map_err(|payload| {
        // The hook has had it all; what `panic_any` was given may not even be text.
        drop(payload);
        let first = FIRST.lock().unwrap_or_else(PoisonError::into_inner).take();
        first.unwrap_or_else(|| "no message".to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_comes_back_with_its_place() {
        let message = caught(|| panic!("number {}", 7)).unwrap_err();
        assert!(message.starts_with("number 7 ("), "{message}");
        assert!(message.contains("panics.rs:"), "{message}");
        assert_eq!(caught(|| 5), Ok(5));
    }
}
