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
