//! Selection of the frames shown in maps.

use dem_history::History;

use crate::clock::Clock;
use crate::output::{PostError, Result, plain};

/// Share of broken bonds at which a map is drawn.
const BROKEN: f64 = 0.05;
/// Rounding of a time, as a share of the length of the run.
const ROUNDING: f64 = 1e-9;

/// Times closer than this share of the later one are equal: the clocks of two time steps round
/// differently.
pub(crate) const SAME_TIME: f64 = 1e-9;

/// The frames nearest to `times`, in the unit of the clock (s or steps). Without times: the first
/// frame after the first rupture, the first after 5 % of the bonds have broken, and the last. In
/// order, without repetition.
///
/// # Errors
/// [`PostError::Usage`] for a time outside the history, [`PostError::Lacking`] for a history
/// without frames.
pub fn chosen(history: &History, times: &[f64]) -> Result<Vec<usize>> {
    let (Some(&first), Some(&last)) = (history.times().first(), history.times().last()) else {
        let what = "it holds no frame yet: wait for the run to write one".into();
        return Err(PostError::Lacking { path: history.path().into(), what });
    };
    let clock = Clock::of(history);
    let mut frames = vec![];
    for &asked in times {
        let time = clock.time(asked);
        // times of frames are sums of steps: what is printed of the last may be a little beyond it
        let room = ROUNDING * (last - first);
        // this form also rejects NaN
        if !(first - room..=last + room).contains(&time) {
            let [first, last] = [first, last].map(|time| plain(clock.value(time)));
            let range = if clock.step().is_some() {
                format!("counts steps, from {first} to {last}")
            } else {
                format!("runs from {first} s to {last} s")
            };
            return Err(PostError::Usage(format!("--times {asked}: the history {range}")));
        }
        frames.extend(history.frame_at(time));
    }
    if times.is_empty() {
        let ruptures = history.ruptures()?;
        let few = (BROKEN * history.bonds()?.len() as f64).ceil() as usize;
        for rupture in [ruptures.first(), ruptures.get(few.saturating_sub(1))].into_iter().flatten() {
            frames.extend(history.times().iter().position(|&time| time >= rupture.time));
        }
        frames.push(history.frames() - 1);
    }
    frames.sort_unstable();
    frames.dedup();
    Ok(frames)
}
