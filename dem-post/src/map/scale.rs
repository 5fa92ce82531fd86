//! Colour scales: colours that represent a value.

use std::borrow::Cow;

/// A colour, as `#rrggbb`.
pub type Colour = Cow<'static, str>;

/// A sequence of colours of steadily changing lightness, for colour-blind readers and for print:
/// after matplotlib's maps of S. van der Walt and N. Smith, in ten steps with straight lines
/// between.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ramp {
    /// From dark blue to yellow: viridis. For areas.
    Areas,
    /// From near black over red to orange: inferno without its lightest part, which is invisible on
    /// a white sheet. For lines.
    Lines,
}

impl Ramp {
    fn stops(self) -> &'static [[u8; 3]] {
        match self {
            Self::Areas => &[
                [0x44, 0x01, 0x54],
                [0x48, 0x28, 0x78],
                [0x3e, 0x49, 0x89],
                [0x31, 0x68, 0x8e],
                [0x26, 0x82, 0x8e],
                [0x1f, 0x9e, 0x89],
                [0x35, 0xb7, 0x79],
                [0x6e, 0xce, 0x58],
                [0xb5, 0xde, 0x2b],
                [0xfd, 0xe7, 0x25],
            ],
            Self::Lines => &[
                [0x1b, 0x0c, 0x41],
                [0x4a, 0x0c, 0x6b],
                [0x78, 0x1c, 0x6d],
                [0xa5, 0x2c, 0x60],
                [0xcf, 0x44, 0x46],
                [0xed, 0x69, 0x25],
                [0xfb, 0x9b, 0x06],
            ],
        }
    }
}

/// A range of values and its colours.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// The quantity, with its unit.
    pub title: String,
    /// The value of the first colour.
    pub low: f64,
    /// The value of the last colour.
    pub high: f64,
    /// The colours.
    pub ramp: Ramp,
}

impl Scale {
    /// The colour of a value; a value outside the range has the colour of the nearer end.
    pub fn colour(&self, value: f64) -> Colour {
        let stops = self.ramp.stops();
        let span = self.high - self.low;
        let part = if span > 0.0 { ((value - self.low) / span).clamp(0.0, 1.0) } else { 0.0 };
        let place = part * (stops.len() - 1) as f64;
        let k = (place as usize).min(stops.len() - 2);
        between(stops[k], stops[k + 1], place - k as f64)
    }
}

/// Interpolates between two colours; `part` is 0 to 1.
fn between(from: [u8; 3], to: [u8; 3], part: f64) -> Colour {
    let mix = |c: usize| {
        let (from, to) = (f64::from(from[c]), f64::from(to[c]));
        (from + (to - from) * part).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2)).into()
}

/// A colour with this share of white in it.
pub(super) fn mixed(colour: &str, white: f64) -> Colour {
    let part = |k: usize| colour.get(k..k + 2).and_then(|digits| u8::from_str_radix(digits, 16).ok()).unwrap_or(0);
    between([part(1), part(3), part(5)], [0xff; 3], white)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(ramp: Ramp) -> Scale {
        Scale { title: String::new(), low: -1.0, high: 3.0, ramp }
    }

    #[test]
    fn the_ends_of_the_range_have_the_ends_of_the_colours() {
        let scale = scale(Ramp::Areas);
        assert_eq!((scale.colour(-1.0), scale.colour(3.0)), ("#440154".into(), "#fde725".into()));
        assert_eq!((scale.colour(-9.0), scale.colour(9.0)), ("#440154".into(), "#fde725".into()));
        assert_eq!(Scale { high: -1.0, ..scale }.colour(-1.0), "#440154");
    }

    #[test]
    fn white_is_mixed_in() {
        assert_eq!(mixed("#102030", 0.0), "#102030");
        assert_eq!(mixed("#102030", 1.0), "#ffffff");
    }

    #[test]
    fn lightness_only_grows() {
        for ramp in [Ramp::Areas, Ramp::Lines] {
            let light = |k: i32| {
                let colour = scale(ramp).colour(-1.0 + 4.0 * f64::from(k) / 100.0);
                let part = |from: usize| f64::from(u8::from_str_radix(&colour[from..from + 2], 16).unwrap());
                0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5)
            };
            assert!((0..100).all(|k| light(k + 1) > light(k) - 0.5), "{ramp:?}");
        }
    }
}
