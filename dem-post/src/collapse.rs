//! What is read off a curve: where it gives way, where it peaks, the work under it.

use serde_json::Value;

/// A maximum is a peak if the load falls at least this share below it afterwards.
const PEAK_DROP: f64 = 0.05;

/// The last step before `strain` exceeds `threshold` in magnitude; `None` if it never does.
pub fn last_step_below(strain: &[f64], threshold: f64) -> Option<usize> {
    let above = strain.iter().position(|e| e.abs() > threshold)?;
    Some(above.saturating_sub(1))
}

/// Whether no bond had broken where `strain` passed its threshold, a step after `step`: `broken` counts them step by step.
pub fn whole_at(broken: &[f64], step: usize) -> bool {
    broken.get(step + 1).or(broken.last()).is_some_and(|&n| n == 0.0)
}

/// Whether the bonds of a scene yield before they break.
pub fn is_elastic(scene: &str) -> bool {
    serde_json::from_str::<Value>(scene).is_ok_and(|scene| !scene["bonds"]["stiffness"].is_null())
}

/// Where the load is greatest, if it falls by at least 5 % afterwards.
pub fn peak(load: &[f64]) -> Option<usize> {
    let top = (0..load.len()).max_by(|&a, &b| load[a].total_cmp(&load[b]).then(b.cmp(&a)))?;
    let lowest = load[top..].iter().copied().fold(f64::INFINITY, f64::min);
    (load[top] > 0.0 && lowest < (1.0 - PEAK_DROP) * load[top]).then_some(top)
}

/// Work of a force along a way, by trapezoids, J; from zero force at way zero.
pub fn work(load: &[f64], way: &[f64]) -> f64 {
    let (mut sum, mut last) = (0.0, (0.0, 0.0));
    for now in load.iter().copied().zip(way.iter().copied()) {
        sum += 0.5 * (now.0 + last.0) * (now.1 - last.1);
        last = now;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn collapse_is_the_last_step_before_the_strain_exceeds_its_threshold() {
        let strain = [0.0, 5e-5, 1e-4, -2e-4, 0.0, 2e-3];
        assert_eq!(last_step_below(&strain, 1e-4), Some(2));
        assert_eq!(last_step_below(&strain, 1e-3), Some(4));
        assert_eq!(last_step_below(&strain, 1.0), None);
        assert_eq!(last_step_below(&[1.0], 1e-4), Some(0));
    }

    #[test]
    fn a_load_that_only_grows_has_no_peak() {
        assert_eq!(peak(&[0.0, 1.0, 2.0]), None);
        assert_eq!(peak(&[0.0, 2.0, 1.99]), None);
        assert_eq!(peak(&[0.0, 2.0, 1.0, 1.5]), Some(1));
        assert_eq!(peak(&[]), None);
    }

    #[test]
    fn work_is_the_area_under_the_curve() {
        assert!((work(&[1.0, 2.0, 2.0], &[1.0, 2.0, 4.0]) - (0.5 + 1.5 + 4.0)).abs() < 1e-15);
    }
}
