//! Work in the pool of threads.

/// Run `work`, if it is `shared` among threads inside their pool: they then need not be woken for
/// each of its parts.
pub(crate) fn among_threads<R: Send>(shared: bool, work: impl FnOnce() -> R + Send) -> R {
    if shared { rayon::scope(|_| work()) } else { work() }
}
