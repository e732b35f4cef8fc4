//! The one place that knows whether there are threads.

/// Maps every item; results are in the order of the items, whatever the number of threads.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn map_ordered<T: Sync, R: Send>(
    items: &[T],
    f: impl Fn(&T) -> R + Sync + Send,
) -> Vec<R> {
    use rayon::prelude::*;
    items.par_iter().map(f).collect()
}

/// Maps every item, one after the other.
#[cfg(target_arch = "wasm32")]
pub(crate) fn map_ordered<T, R>(items: &[T], f: impl Fn(&T) -> R) -> Vec<R> {
    items.iter().map(f).collect()
}
