//! Drawing: charts of curves, and a canvas for maps. No other crate depends on the plotting crate
//! (kuva).
//!
//! SVG and PNG of a drawing are made from the same scene. The PNG uses a font embedded in the
//! crate, so that it is the same on every machine.

use kuva::backend::svg::SvgBackend;
use kuva::render::render::Scene;

pub use canvas::{Anchor, Canvas};
pub use chart::{Axes, Bars, Chart, Curve, thinned};
use compact::compact;
pub use legend::Style;
pub use raster::{RGB, Raster};

mod axis;
mod canvas;
mod chart;
mod compact;
mod legend;
mod print;
mod raster;
mod ticks;
mod titles;

/// Colours that colour-blind readers can distinguish, also in print (Okabe & Ito).
pub mod colour {
    /// Black.
    pub const BLACK: &str = "#000000";
    /// Grey of secondary marks.
    pub const GREY: &str = "#7f7f7f";
    /// Blue: compression, first curve.
    pub const BLUE: &str = "#0072b2";
    /// Vermillion: tension, second curve.
    pub const VERMILLION: &str = "#d55e00";
    /// Bluish green: third curve.
    pub const GREEN: &str = "#009e73";
    /// Reddish purple: fourth curve.
    pub const PURPLE: &str = "#cc79a7";
    /// Orange: fifth curve.
    pub const ORANGE: &str = "#e69f00";
    /// One colour for each curve of a family.
    pub const CYCLE: [&str; 5] = [BLUE, VERMILLION, GREEN, PURPLE, ORANGE];
}

/// Pixels of the PNG per unit of length of a drawing.
const PNG_SCALE: f32 = 2.5;

/// A finished drawing.
pub struct Drawing {
    scene: Scene,
    /// Whether lines of the SVG end in half disks, as all lines of a PNG do.
    round_ends: bool,
    /// The charts, if it is a drawing of charts.
    charts: Vec<Chart>,
}

impl Drawing {
    /// The drawing as SVG.
    pub fn svg(&self) -> String {
        let svg = compact(&SvgBackend::new().render_scene(&self.scene));
        if self.round_ends { svg.replacen("<svg ", r#"<svg stroke-linecap="round" "#, 1) } else { svg }
    }

    /// Width and height.
    pub fn size(&self) -> (f64, f64) {
        (self.scene.width, self.scene.height)
    }

    /// The drawing as PNG.
    ///
    /// # Errors
    /// The plotting crate's message.
    pub fn png(&self) -> Result<Vec<u8>, String> {
        self.png_scaled(PNG_SCALE)
    }

    /// The drawing as PNG with `scale` pixels per unit of length.
    ///
    /// # Errors
    /// The plotting crate's message.
    pub fn png_scaled(&self, scale: f32) -> Result<Vec<u8>, String> {
        self.pixels(scale)?.png(f64::from(scale) * UNITS)
    }

    /// The drawing as pixels, `scale` per unit of length.
    ///
    /// # Errors
    /// The plotting crate's message.
    pub fn pixels(&self, scale: f32) -> Result<Raster, String> {
        Raster::of(&self.scene, scale)
    }
}

/// Units of a drawing in a metre: those of CSS, 96 in an inch.
const UNITS: f64 = 96.0 / 0.0254;
