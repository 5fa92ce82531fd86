//! Broken bonds, counted by mode of rupture; the colour of each mode.

use dem_drawing::colour;
use dem_history::RuptureMode;
use serde::Serialize;

/// The colour of a mode in all drawings.
pub fn mode_colour(mode: RuptureMode) -> &'static str {
    match mode {
        RuptureMode::Tension => colour::BLUE,
        RuptureMode::Shear => colour::VERMILLION,
        RuptureMode::Rolling => colour::GREEN,
        RuptureMode::Twist => colour::PURPLE,
    }
}

/// The name of a mode in drawings.
pub fn mode_name(mode: RuptureMode) -> String {
    mode.label().to_lowercase()
}

/// A number for each mode of rupture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Modes {
    /// In tension.
    pub tension: usize,
    /// In shear.
    pub shear: usize,
    /// By the rolling moment.
    pub rolling: usize,
    /// By the twisting moment.
    pub twist: usize,
}

impl Modes {
    /// The sum over the modes.
    pub fn total(self) -> usize {
        self.tension + self.shear + self.rolling + self.twist
    }

    /// Counts one more.
    pub fn add(&mut self, mode: RuptureMode) {
        match mode {
            RuptureMode::Tension => self.tension += 1,
            RuptureMode::Shear => self.shear += 1,
            RuptureMode::Rolling => self.rolling += 1,
            RuptureMode::Twist => self.twist += 1,
        }
    }
}
