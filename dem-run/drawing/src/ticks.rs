//! Labels of the ticks of an axis.

/// A tick of an axis of counts: none between whole numbers.
pub(crate) fn whole(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value}") } else { String::new() }
}

/// A tick of a logarithmic axis: powers of ten as such, others as numbers.
pub(crate) fn power_of_ten(value: f64) -> String {
    let exponent = value.log10();
    let whole = (exponent - exponent.round()).abs() < 1e-6;
    if (!whole && exponent > -3.0) || (-0.5..1.5).contains(&exponent) {
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

    #[test]
    fn ticks_are_powers_of_ten() {
        for (value, text) in [
            (1e-4, "10⁻⁴"),
            (1e3, "10³"),
            (0.1, "10⁻¹"),
            (1.0, "1"),
            (2e-5, "2·10⁻⁵"),
            (5e-3, "0.005"),
            (0.02, "0.02"),
            (4.99999996e-6, "5·10⁻⁶"),
            (2e-13, "2·10⁻¹³"),
        ] {
            assert_eq!(power_of_ten(value), text);
        }
    }
}
