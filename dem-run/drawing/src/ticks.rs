//! Labels of the ticks of an axis.

/// A tick of an axis of counts: none between whole numbers.
pub(crate) fn whole(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value}") } else { String::new() }
}

/// The format of the ticks of a linear axis: all have the digits that their step needs and, far
/// from 1, one power of ten.
pub(crate) fn linear(ticks: &[f64]) -> impl Fn(f64) -> String + use<> {
    let greatest = ticks.iter().fold(0.0, |most: f64, tick| most.max(tick.abs()));
    let power = if greatest > 0.0 && !(1e-2..1e6).contains(&greatest) {
        // round-off: 9.9999999e10 is 1e11
        (greatest.log10() + 1e-9).floor() as i32
    } else {
        0
    };
    let unit = 10f64.powi(power);
    let step = ticks.windows(2).map(|pair| pair[1] - pair[0]).fold(greatest, f64::min);
    let whole = |digits: &i32| {
        let scaled = step / unit * 10f64.powi(*digits);
        (scaled - scaled.round()).abs() < 1e-6 * scaled
    };
    let digits = (0..=15).find(whole).unwrap_or(0) as usize;
    move |value: f64| match power {
        _ if value.abs() < 1e-6 * step => "0".into(),
        0 => format!("{value:.digits$}"),
        power => format!("{:.digits$}e{power}", value / unit),
    }
}

/// The step at which labels of the size `size` of a linear axis do not touch, a multiple of that of
/// `ticks`; `None` where theirs is large enough. `unit` is the length of a unit of the axis.
pub(crate) fn step(ticks: &[f64], unit: f64, size: f64) -> Option<f64> {
    let [first, second, ..] = ticks else { return None };
    let (own, label) = (second - first, linear(ticks));
    let widest = ticks.iter().map(|tick| label(*tick).chars().count()).max().unwrap_or(0);
    // digits are 0.64 times as wide as high, and a blank separates two labels
    let room = 0.64 * size * (widest as f64 + 1.0);
    let times = [1.0, 2.0, 4.0].into_iter().find(|times| times * own * unit >= room).unwrap_or(4.0);
    (times > 1.0).then_some(times * own)
}

/// A tick of a logarithmic axis: powers of ten as such, others as numbers.
pub(crate) fn power_of_ten(value: f64) -> String {
    let exponent = value.log10();
    let whole = (exponent - exponent.round()).abs() < 1e-6;
    if (!whole && exponent > -1.0) || (-0.5..1.5).contains(&exponent) {
        // round-off: 4.9999999e-6 is 5e-6
        let rounded = format!("{value:.3e}").parse().unwrap_or(value);
        return format!("{rounded}");
    }
    let power = if whole { exponent.round() } else { exponent.floor() };
    let factor = if whole { String::new() } else { format!("{:.0}·", value / 10f64.powf(power)) };
    let raise = |digit: char| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32(0x2070 + digit.to_digit(10).unwrap_or(0)).unwrap_or(digit),
    };
    format!("{factor}10{}", format!("{power:.0}").chars().map(raise).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Chart, Style, colour};

    #[test]
    fn labels_that_would_touch_are_farther_apart() {
        // five letters and a blank take 50 of 13 units each
        let ticks = [0.18, 0.185, 0.19, 0.195];
        for (unit, found) in [(11e3, None), (6e3, Some(0.01)), (3e3, Some(0.02)), (1.0, Some(0.02))] {
            let step = step(&ticks, unit, 13.0);
            assert!(step.zip(found).map_or(step == found, |(a, b): (f64, f64)| (a - b).abs() < 1e-12), "{step:?}");
        }
    }

    #[test]
    fn ticks_of_a_linear_axis_have_the_digits_of_their_step() {
        for (ticks, texts) in [
            (&[0.0555, 0.05575, 0.056][..], &["0.05550", "0.05575", "0.05600"][..]),
            (&[0.0, 2.5e-3, 5e-3, 7.5e-3, 0.01, 0.0125], &["0", "0.0025", "0.0050", "0.0075", "0.0100", "0.0125"]),
            (&[0.0911, 0.09111, 0.09112], &["0.09110", "0.09111", "0.09112"]),
            (&[0.0, 9.999999999999998e10, 2e11, 3.9999999999999994e11], &["0", "1e11", "2e11", "4e11"]),
            (&[-2e-17, 5e-4, 1e-3], &["0", "0.5e-3", "1.0e-3"]),
            (&[-50.0, 0.0, 50.0], &["-50", "0", "50"]),
            (&[1_000.0, 1_200.0], &["1000", "1200"]),
            (&[3.5], &["3.5"]),
            (&[0.0], &["0"]),
        ] {
            let label = linear(ticks);
            let found: Vec<String> = ticks.iter().map(|tick| label(*tick)).collect();
            assert_eq!(found, texts);
        }
    }

    #[test]
    fn ticks_of_a_chart_are_exact() {
        let points = vec![(0.0, 0.0555), (0.0125, 0.0565)];
        let chart = Chart::new("x", "y").curve("", colour::BLUE, Style::Line, points);
        let svg = Chart::draw(vec![chart]).svg();
        for label in ["0.05550", "0.05575", "0.0025", "0.0125"] {
            assert!(svg.contains(&format!(">{label}<")), "{label}");
        }
    }

    #[test]
    fn ticks_are_powers_of_ten() {
        for (value, text) in [
            (1e-4, "10⁻⁴"),
            (1e3, "10³"),
            (0.1, "10⁻¹"),
            (1.0, "1"),
            (2e-5, "2·10⁻⁵"),
            (5e-3, "5·10⁻³"),
            (0.02, "2·10⁻²"),
            (0.2, "0.2"),
            (4.99999996e-6, "5·10⁻⁶"),
            (2e-13, "2·10⁻¹³"),
        ] {
            assert_eq!(power_of_ten(value), text);
        }
    }
}
