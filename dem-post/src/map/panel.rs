//! Content of one panel of a map.

use dem_history::{GrainState, WallState};

use super::scale::Colour;

/// One moment.
#[derive(Clone, Default)]
pub struct Panel {
    /// Lines of text above it.
    pub caption: Vec<String>,
    /// The grains.
    pub grains: GrainState,
    /// The walls.
    pub walls: WallState,
    /// Fill of each grain; none where only walls and lines are drawn.
    pub fills: Vec<Colour>,
    /// Colour of the outlines of grains.
    pub outline: &'static str,
    /// Lines on top, in the order in which they are drawn; in perspective the nearest last.
    pub links: Vec<Link>,
    /// Arrows on top of all.
    pub arrows: Vec<Arrow>,
    /// Polygons over the grains; nearer polygons cover farther ones.
    pub patches: Vec<Patch>,
}

/// A flat polygon in 3D.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Its corners, m.
    pub corners: Vec<[f64; 3]>,
    /// Colour.
    pub colour: Colour,
}

/// An arrow.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrow {
    /// Where it begins, m, D numbers.
    pub from: Vec<f64>,
    /// Where its head is, m, D numbers.
    pub to: Vec<f64>,
}

/// A line between two points of the sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Where it begins, m, D numbers.
    pub from: Vec<f64>,
    /// Where it ends, m, D numbers.
    pub to: Vec<f64>,
    /// Width, units of the drawing.
    pub width: f64,
    /// Colour.
    pub colour: Colour,
}
