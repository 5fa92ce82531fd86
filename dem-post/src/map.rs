//! Maps of the sample: grains, walls and what joins them, several moments side by side on one scale.

use dem_run::history::{GrainState, Grains, History, Wall, WallKind, WallState};

use crate::output::Result;
use crate::plot::{Anchor, Canvas, Drawing, colour};

/// Width and greatest height of one panel, units of the drawing.
const PANEL: (f64, f64) = (400.0, 560.0);
/// Free space around each panel.
const MARGIN: f64 = 14.0;
/// Height of a panel's caption, and of one row of the legend.
const CAPTION: f64 = 44.0;
const LEGEND: f64 = 30.0;
/// Lines of a wall's hatching: their distance and length.
const HATCH: f64 = 7.0;

/// What all panels share: the grains' sizes, the walls, and the plane of the drawing (in 3D the first and last axes).
pub struct Sample {
    radius: Vec<f64>,
    walls: Vec<Wall>,
    dimension: usize,
    axes: [usize; 2],
    /// Corners of what may be shown, m: the first frame and as much again around it.
    limits: Box2,
}

/// One moment.
pub struct Panel {
    /// Lines of text above it.
    pub caption: Vec<String>,
    /// The grains.
    pub grains: GrainState,
    /// The walls.
    pub walls: WallState,
    /// Fill of each grain.
    pub fills: Vec<&'static str>,
    /// Colour of the outlines of grains.
    pub outline: &'static str,
    /// Lines on top, in the order in which they are drawn.
    pub links: Vec<Link>,
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
    pub colour: &'static str,
}

/// An entry of the legend.
pub enum Key {
    /// A disk of this fill and outline.
    Disk(&'static str, &'static str, String),
    /// A line of this colour and width.
    Line(&'static str, f64, String),
}

impl Sample {
    /// Reads what all panels share.
    ///
    /// # Errors
    /// Those of [`History::grains`], [`History::walls`] and [`History::grain_state`].
    pub fn read(history: &History) -> Result<Self> {
        let Grains { radius, .. } = history.grains()?;
        let (walls, dimension) = (history.walls()?, history.dimension());
        let mut sample = Self { radius, walls, dimension, axes: [0, dimension - 1], limits: [[0.0; 2]; 2] };
        let first = history.grain_state(0)?;
        let [low, high] = sample.bounds(&first, EVERYWHERE);
        let spread = |k: usize| 0.5 * (high[k] - low[k]);
        sample.limits = [[low[0] - spread(0), low[1] - spread(1)], [high[0] + spread(0), high[1] + spread(1)]];
        Ok(sample)
    }

    fn flat(&self, point: &[f64]) -> [f64; 2] {
        self.axes.map(|axis| point[axis])
    }

    fn centre(&self, state: &GrainState, grain: usize) -> [f64; 2] {
        self.flat(&state.position[grain * self.dimension..(grain + 1) * self.dimension])
    }

    /// The box around the grains within `limits`, `[low, high]`, m.
    fn bounds(&self, state: &GrainState, limits: Box2) -> Box2 {
        let mut found = EMPTY;
        for (grain, &radius) in self.radius.iter().enumerate() {
            let centre = self.centre(state, grain);
            if (0..2).all(|k| (limits[0][k]..=limits[1][k]).contains(&centre[k])) {
                found = union(found, around(centre, radius));
            }
        }
        found
    }

    /// The box around what a panel shows: its grains, and of its round walls what is near.
    fn extent(&self, panel: &Panel) -> Box2 {
        let mut found = self.bounds(&panel.grains, self.limits);
        if found == EMPTY {
            // all have left together, as a disk on an incline does
            found = self.bounds(&panel.grains, EVERYWHERE);
        }
        for (wall, position) in self.walls.iter().zip(panel.walls.position.chunks(self.dimension)) {
            if wall.kind != WallKind::Plane {
                let [low, high] = around(self.flat(position), wall.radius.abs());
                let near = |k: usize, x: f64| x.clamp(self.limits[0][k], self.limits[1][k]);
                found = union(found, [[near(0, low[0]), near(1, low[1])], [near(0, high[0]), near(1, high[1])]]);
            }
        }
        found
    }
}

/// Lower and upper corner of a box, m.
type Box2 = [[f64; 2]; 2];

/// The box that holds nothing.
const EMPTY: Box2 = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];

/// The box that holds everything.
const EVERYWHERE: Box2 = [[f64::NEG_INFINITY; 2], [f64::INFINITY; 2]];

fn around(centre: [f64; 2], radius: f64) -> Box2 {
    [centre.map(|x| x - radius), centre.map(|x| x + radius)]
}

fn union([l, h]: Box2, [low, high]: Box2) -> Box2 {
    [[l[0].min(low[0]), l[1].min(low[1])], [h[0].max(high[0]), h[1].max(high[1])]]
}

/// From metres to units of the drawing, for one panel.
struct Frame {
    low: [f64; 2],
    scale: f64,
    /// Upper left corner and size on the sheet.
    corner: (f64, f64),
    size: (f64, f64),
}

impl Frame {
    fn at(&self, point: [f64; 2]) -> (f64, f64) {
        let x = self.corner.0 + (point[0] - self.low[0]) * self.scale;
        let y = self.corner.1 + self.size.1 - (point[1] - self.low[1]) * self.scale;
        (x, y)
    }

    fn shows(&self, (x, y): (f64, f64), margin: f64) -> bool {
        let (right, bottom) = (self.corner.0 + self.size.0, self.corner.1 + self.size.1);
        (self.corner.0 - margin..=right + margin).contains(&x)
            && (self.corner.1 - margin..=bottom + margin).contains(&y)
    }
}

/// Draws the panels side by side on one scale, with a scale bar and the legend below.
pub fn draw(sample: &Sample, panels: &[Panel], legend: &[Key]) -> Drawing {
    let [low, high] = panels.iter().fold(EMPTY, |all, panel| union(all, sample.extent(panel)));
    // room for the hatching of walls
    let extent = [high[0] - low[0], high[1] - low[1]];
    let scale = ((PANEL.0 - 4.0 * HATCH) / extent[0]).min((PANEL.1 - 4.0 * HATCH) / extent[1]);
    let low = low.map(|x| x - 2.0 * HATCH / scale);
    let size = (extent[0] * scale + 4.0 * HATCH, extent[1] * scale + 4.0 * HATCH);
    let columns = panels.len() as f64;
    let width = (columns * (size.0 + MARGIN) + MARGIN).max(420.0);
    let rows = legend_rows(legend, width);
    let height = CAPTION + size.1 + LEGEND * (rows.len() as f64 + 1.0) + MARGIN;
    let left = 0.5 * (width - columns * (size.0 + MARGIN) + MARGIN);
    let mut canvas = Canvas::new(width, height);
    for (k, panel) in panels.iter().enumerate() {
        let corner = (left + k as f64 * (size.0 + MARGIN), CAPTION);
        draw_panel(&mut canvas, sample, panel, &Frame { low, scale, corner, size });
    }
    let base = CAPTION + size.1 + 0.7 * LEGEND;
    scale_bar(&mut canvas, (left, base), scale, size.0);
    for (k, row) in rows.iter().enumerate() {
        draw_legend(&mut canvas, row, (0.5 * width, base + LEGEND * (k as f64 + 1.0)));
    }
    canvas.finish()
}

fn draw_panel(canvas: &mut Canvas, sample: &Sample, panel: &Panel, frame: &Frame) {
    for (line, text) in panel.caption.iter().enumerate() {
        let at = (frame.corner.0 + 0.5 * frame.size.0, 17.0 + 18.0 * line as f64);
        canvas.text(at, text, 14, Anchor::Middle);
    }
    canvas.clip(frame.corner, frame.size);
    for (wall, position) in sample.walls.iter().zip(panel.walls.position.chunks(sample.dimension)) {
        draw_wall(canvas, sample, wall, position, frame);
    }
    let mut order: Vec<usize> = (0..sample.radius.len()).collect();
    if sample.dimension == 3 {
        // what is further away (along y) is drawn first
        let depth = |grain: usize| panel.grains.position[grain * 3 + 1];
        order.sort_by(|&a, &b| depth(b).total_cmp(&depth(a)));
    }
    for grain in order {
        let (at, radius) = (frame.at(sample.centre(&panel.grains, grain)), sample.radius[grain] * frame.scale);
        if frame.shows(at, 0.0) {
            canvas.disk(at, radius - 0.3, panel.fills[grain], panel.outline, 0.6);
        }
    }
    for link in &panel.links {
        let ends = [&link.from, &link.to].map(|point| frame.at(sample.flat(point)));
        if ends.iter().all(|&end| frame.shows(end, 2.0)) {
            canvas.line(ends[0], ends[1], link.colour, link.width);
        }
    }
    canvas.end_clip();
}

fn draw_wall(canvas: &mut Canvas, sample: &Sample, wall: &Wall, position: &[f64], frame: &Frame) {
    let point = sample.flat(position);
    if wall.kind == WallKind::Plane {
        let normal = sample.flat(&wall.normal[..sample.dimension]);
        // a plane that faces the reader has no line
        if normal[0].hypot(normal[1]) > 1e-6 {
            draw_plane(canvas, point, normal, frame);
        }
        return;
    }
    let (at, radius) = (frame.at(point), wall.radius.abs() * frame.scale);
    let fill = if wall.radius < 0.0 { "none" } else { "#d0d0d0" };
    canvas.disk(at, radius, fill, colour::BLACK, 1.5);
}

/// A line across the panel, hatched on the side away from the grains.
fn draw_plane(canvas: &mut Canvas, point: [f64; 2], normal: [f64; 2], frame: &Frame) {
    let length = normal[0].hypot(normal[1]);
    // on the sheet y points down
    let (n, t) = ((normal[0] / length, -normal[1] / length), (normal[1] / length, normal[0] / length));
    let centre = frame.at(point);
    let at = |s: f64| (centre.0 + s * t.0, centre.1 + s * t.1);
    let reach =
        2.0 * (frame.size.0 + frame.size.1) + (centre.0 - frame.corner.0).abs() + (centre.1 - frame.corner.1).abs();
    let steps = (reach / HATCH) as i64;
    let inside: Vec<f64> = (-steps..=steps).map(|k| k as f64 * HATCH).filter(|&s| frame.shows(at(s), 0.0)).collect();
    let (Some(&first), Some(&last)) = (inside.first(), inside.last()) else {
        return;
    };
    canvas.line(at(first), at(last), colour::BLACK, 1.8);
    for s in inside {
        let from = at(s);
        let to = (from.0 - HATCH * (n.0 + t.0) * 0.8, from.1 - HATCH * (n.1 + t.1) * 0.8);
        canvas.line(from, to, colour::GREY, 0.8);
    }
}

/// A bar of a round length, at most a third of the panel.
fn scale_bar(canvas: &mut Canvas, (x, y): (f64, f64), scale: f64, width: f64) {
    let longest = width / 3.0 / scale;
    let power = 10f64.powf(longest.log10().floor());
    let length = [5.0, 2.0, 1.0].into_iter().map(|m| m * power).find(|l| *l <= longest).unwrap_or(power);
    let (from, to) = (x + 2.0 * HATCH, x + 2.0 * HATCH + length * scale);
    canvas.line((from, y), (to, y), colour::BLACK, 2.0);
    for end in [from, to] {
        canvas.line((end, y - 4.0), (end, y + 4.0), colour::BLACK, 1.2);
    }
    canvas.text((to + 8.0, y + 5.0), &metres(length), 14, Anchor::Start);
}

/// A round length with the unit that suits it.
fn metres(length: f64) -> String {
    let (value, unit) = match length {
        l if l < 1e-3 => (l * 1e6, "µm"),
        l if l < 1.0 => (l * 1e3, "mm"),
        l => (l, "m"),
    };
    format!("{value:.0} {unit}")
}

/// Width of an entry of the legend, from the number of its characters.
fn key_width(key: &Key) -> f64 {
    let (Key::Disk(_, _, text) | Key::Line(_, _, text)) = key;
    46.0 + 8.2 * text.chars().count() as f64
}

/// The legend in rows that fit `width`.
fn legend_rows(legend: &[Key], width: f64) -> Vec<Vec<&Key>> {
    let mut rows: Vec<Vec<&Key>> = vec![];
    let mut used = f64::INFINITY;
    for key in legend {
        used += key_width(key);
        if used > width - 2.0 * MARGIN {
            rows.push(vec![]);
            used = key_width(key);
        }
        if let Some(row) = rows.last_mut() {
            row.push(key);
        }
    }
    rows
}

fn draw_legend(canvas: &mut Canvas, row: &[&Key], (middle, y): (f64, f64)) {
    let total: f64 = row.iter().map(|key| key_width(key)).sum();
    let mut x = middle - 0.5 * total;
    for key in row {
        let text = match key {
            Key::Disk(fill, outline, text) => {
                canvas.disk((x + 17.0, y), 7.0, fill, outline, 1.0);
                text
            }
            Key::Line(colour, width, text) => {
                canvas.line((x + 4.0, y), (x + 28.0, y), colour, *width);
                text
            }
        };
        canvas.text((x + 34.0, y + 5.0), text, 14, Anchor::Start);
        x += key_width(key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_round() {
        for (length, text) in [(1e-2, "10 mm"), (5e-4, "500 µm"), (2.0, "2 m")] {
            assert_eq!(metres(length), text);
        }
    }

    #[test]
    fn a_legend_breaks_into_rows_that_fit() {
        let key = || Key::Line(colour::BLUE, 1.0, "twenty characters ...".into());
        let legend = [key(), key(), key()];
        let rows = legend_rows(&legend, 2.0 * key_width(&legend[0]) + 2.0 * MARGIN + 1.0);
        assert_eq!(rows.iter().map(Vec::len).collect::<Vec<_>>(), [2, 1]);
    }
}
