//! The moments that maps show.

use dem_run::history::History;

use crate::output::{PostError, Result};
use crate::stress_strain;

/// The frames nearest to `times` (s), or, where none is given: the first after the first rupture, the first after the
/// collapse, and the last. In order and without repetition.
///
/// # Errors
/// [`PostError::Usage`] for a time outside the history, [`PostError::Lacking`] for a history without frames.
pub fn chosen(history: &History, times: &[f64]) -> Result<Vec<usize>> {
    let (Some(&first), Some(&last)) = (history.times().first(), history.times().last()) else {
        let what = "it holds no frame yet: wait for the run to write one".into();
        return Err(PostError::Lacking { path: history.path().into(), what });
    };
    let mut frames = vec![];
    for &time in times {
        // written so that NaN is refused too
        if !(first..=last).contains(&time) {
            return Err(PostError::Usage(format!("--times {time}: the history runs from {first} s to {last} s")));
        }
        frames.extend(history.frame_at(time));
    }
    if times.is_empty() {
        let after = |time: f64| history.times().iter().position(|&t| t >= time);
        frames.extend(history.ruptures()?.first().and_then(|rupture| after(rupture.time)));
        frames.extend(stress_strain::collapse_time(history)?.and_then(after));
        frames.push(history.frames() - 1);
    }
    frames.sort_unstable();
    frames.dedup();
    Ok(frames)
}
