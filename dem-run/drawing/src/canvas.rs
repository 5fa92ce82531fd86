//! A sheet to draw on.

use kuva::render::render::{PathData, Primitive, Scene, TextAnchor};

use crate::Drawing;

/// Fonts of the text of a map in SVG, those of charts.
const FONTS: &str = "DejaVu Sans, Verdana, Liberation Sans, Arial, sans-serif";
/// Alignment of a text at its point.
#[derive(Clone, Copy, Debug)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

/// A sheet to draw on; lengths in units of the drawing, y downwards.
pub struct Canvas {
    pub(crate) scene: Scene,
    /// As in [`Drawing`].
    pub(crate) round_ends: bool,
}

impl Canvas {
    /// An empty white sheet.
    pub fn new(width: f64, height: f64) -> Self {
        let mut scene = Scene::new(width, height);
        scene.font_family = Some(FONTS.into());
        Self { scene, round_ends: true }
    }

    /// Clips all drawing to a rectangle until [`Canvas::end_clip`].
    pub fn clip(&mut self, corner: (f64, f64), size: (f64, f64)) {
        self.scene.add(Primitive::ClipStart {
            x: corner.0,
            y: corner.1,
            width: size.0,
            height: size.1,
            id: format!("panel-{}", self.scene.elements.len()),
        });
    }

    /// Ends the clip of [`Canvas::clip`].
    pub fn end_clip(&mut self) {
        self.scene.add(Primitive::ClipEnd);
    }

    /// A disk with an outline.
    pub fn disk(&mut self, centre: (f64, f64), radius: f64, fill: &str, outline: &str, width: f64) {
        self.scene.add(Primitive::Circle {
            cx: centre.0,
            cy: centre.1,
            r: radius,
            fill: fill.into(),
            fill_opacity: None,
            stroke: Some(outline.into()),
            stroke_width: Some(width),
        });
    }

    /// A straight line.
    pub fn line(&mut self, from: (f64, f64), to: (f64, f64), colour: &str, width: f64) {
        self.scene.add(Primitive::Line {
            x1: from.0,
            y1: from.1,
            x2: to.0,
            y2: to.1,
            stroke: colour.into(),
            stroke_width: width,
            stroke_dasharray: None,
        });
    }

    /// A filled polygon with an outline.
    pub fn polygon(&mut self, corners: &[(f64, f64)], fill: &str, outline: &str, width: f64) {
        let mut d = String::new();
        for (k, (x, y)) in corners.iter().enumerate() {
            d += &format!("{}{x:.2},{y:.2} ", if k == 0 { "M" } else { "L" });
        }
        self.scene.add(Primitive::Path(Box::new(PathData {
            d: d + "Z",
            fill: Some(fill.into()),
            stroke: outline.into(),
            stroke_width: width,
            opacity: None,
            stroke_dasharray: None,
        })));
    }

    /// A filled rectangle.
    pub fn rectangle(&mut self, corner: (f64, f64), size: (f64, f64), fill: &str) {
        self.scene.add(Primitive::Rect {
            x: corner.0,
            y: corner.1,
            width: size.0,
            height: size.1,
            fill: fill.into(),
            stroke: None,
            stroke_width: None,
            opacity: None,
        });
    }

    /// A line of text; `at` is on its baseline.
    pub fn text(&mut self, at: (f64, f64), text: &str, size: u32, anchor: Anchor) {
        self.scene.add(Primitive::Text {
            x: at.0,
            y: at.1,
            content: text.into(),
            size,
            anchor: match anchor {
                Anchor::Start => TextAnchor::Start,
                Anchor::Middle => TextAnchor::Middle,
                Anchor::End => TextAnchor::End,
            },
            rotate: None,
            bold: false,
            color: None,
        });
    }

    /// The drawing.
    pub fn finish(self) -> Drawing {
        Drawing { scene: self.scene, round_ends: self.round_ends, charts: vec![] }
    }
}
