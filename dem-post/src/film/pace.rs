//! Which frames a film shows, and for how long.

use serde::Serialize;

/// A picture of a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Shown {
    /// Its frame.
    pub frame: usize,
    /// For how many ticks of the film.
    pub ticks: usize,
}

/// The pictures of a film of `ticks` ticks, from the times of the frames and of the ruptures (s),
/// both in order: half of the ticks are shared out over the time, the other half, if bonds break,
/// over the ruptures. The first and the last frame are shown.
pub fn pictures(times: &[f64], ruptures: &[f64], ticks: usize) -> Vec<Shown> {
    let (Some(first), Some(last)) = (times.first(), times.last()) else { return vec![] };
    let by_time = |time: f64| if last > first { (time - first) / (last - first) } else { 1.0 };
    let by_ruptures = |time: f64| ruptures.partition_point(|other| *other <= time) as f64 / ruptures.len() as f64;
    let reached = |time: f64| {
        if ruptures.is_empty() { by_time(time) } else { 0.5 * (by_time(time) + by_ruptures(time)) }
    };
    let reached: Vec<f64> = times.iter().map(|time| reached(*time)).collect();
    let mut pictures: Vec<Shown> = vec![];
    for tick in 0..=ticks {
        // the frame that shows all that happened until then
        let due = tick as f64 / ticks.max(1) as f64;
        let frame = reached.partition_point(|reached| *reached < due).min(times.len() - 1);
        match pictures.last_mut() {
            Some(shown) if shown.frame == frame => shown.ticks += 1,
            _ => pictures.push(Shown { frame, ticks: 1 }),
        }
    }
    pictures
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(pictures: &[Shown], frames: std::ops::Range<usize>) -> usize {
        pictures.iter().filter(|shown| frames.contains(&shown.frame)).map(|shown| shown.ticks).sum()
    }

    #[test]
    fn without_ruptures_time_passes_evenly() {
        let times: Vec<f64> = (0..=100).map(|k| 0.01 * f64::from(k)).collect();
        let pictures = pictures(&times, &[], 50);
        assert_eq!(pictures.len(), 51);
        assert!(pictures.iter().enumerate().all(|(k, shown)| shown.frame.abs_diff(2 * k) <= 1 && shown.ticks == 1));
        assert_eq!((pictures[0].frame, pictures[50].frame), (0, 100));
    }

    #[test]
    fn half_of_the_film_is_where_bonds_break() {
        let times: Vec<f64> = (0..=100).map(|k| 0.01 * f64::from(k)).collect();
        // all between frames 90 and 95
        let ruptures: Vec<f64> = (0..400).map(|k| 0.9 + 0.05 * f64::from(k) / 400.0).collect();
        let shown = pictures(&times, &ruptures, 200);
        assert_eq!(ticks(&shown, 0..101), 201);
        let slow = ticks(&shown, 91..96);
        assert!((100..=108).contains(&slow), "{slow} of 201");
        assert!(shown.windows(2).all(|pair| pair[0].frame < pair[1].frame));
        assert_eq!((shown[0].frame, shown.last().map(|shown| shown.frame)), (0, Some(100)));
    }

    #[test]
    fn one_frame_is_a_film_too() {
        assert_eq!(pictures(&[0.5], &[], 10), [Shown { frame: 0, ticks: 11 }]);
        assert_eq!(pictures(&[], &[], 10), []);
    }
}
