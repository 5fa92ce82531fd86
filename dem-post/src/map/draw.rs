//! Panels side by side or above each other on one sheet: grains, walls, lines, arrows and polygons.

use dem_drawing::{Anchor, Canvas, Drawing, colour};
use dem_history::{Wall, WallKind};

use super::arrow::draw_arrow;
use super::eye::Place;
use super::legend::{Key, draw_legend, legend_rows, scale_bar};
use super::panel::{Link, Panel, Patch};
use super::sample::{Sample, View};
use super::scale::mixed;

/// Width and greatest height of one panel, units of the drawing.
const PANEL: (f64, f64) = (400.0, 560.0);
/// Free space around each panel.
const MARGIN: f64 = 14.0;
/// Height of a panel's caption, and of one row of the legend.
const CAPTION: f64 = 44.0;
const LEGEND: f64 = 30.0;
/// Width of a panel where panels are stacked: samples that are much wider than high.
const WIDE: f64 = 860.0;
/// Width over height of a sample from which on panels are stacked.
const STACKED: f64 = 1.6;
/// The size of a sheet is a multiple of this, so that its PNG has an even number of pixels: video
/// encoders ask for that.
const EVEN: f64 = 4.0;
/// Lines of a wall's hatching: their distance and length.
const HATCH: f64 = 7.0;

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

/// Draws the panels on one scale, side by side or, if the sample is wide, above each other; with a
/// scale bar and the legend below.
pub fn draw(sample: &Sample, panels: &[Panel], legend: &[Key]) -> Drawing {
    let view = sample.view(panels.iter().map(|panel| (&panel.grains, &panel.walls)));
    draw_view(sample, view, panels, legend)
}

/// As [`draw`], for a given part of the plane.
pub fn draw_view(sample: &Sample, View([low, high]): View, panels: &[Panel], legend: &[Key]) -> Drawing {
    let extent = [high[0] - low[0], high[1] - low[1]];
    let stacked = extent[0] > STACKED * extent[1];
    let widest = if stacked { WIDE } else { PANEL.0 };
    // room for the hatching of walls
    let scale = ((widest - 4.0 * HATCH) / extent[0]).min((PANEL.1 - 4.0 * HATCH) / extent[1]);
    let low = low.map(|x| x - 2.0 * HATCH / scale);
    let size = (extent[0] * scale + 4.0 * HATCH, extent[1] * scale + 4.0 * HATCH);
    let (columns, lines) = if stacked { (1, panels.len()) } else { (panels.len(), 1) };
    let even = |length: f64| (length / EVEN).ceil() * EVEN;
    let width = even((columns as f64 * (size.0 + MARGIN) + MARGIN).max(420.0));
    let rows = legend_rows(legend, width - 2.0 * MARGIN);
    let below = lines as f64 * (CAPTION + size.1);
    let mut canvas = Canvas::new(width, even(below + LEGEND * (rows.len() as f64 + 1.0) + MARGIN));
    let left = 0.5 * (width - columns as f64 * (size.0 + MARGIN) + MARGIN);
    for (k, panel) in panels.iter().enumerate() {
        let (column, line) = if stacked { (0, k) } else { (k, 0) };
        let top = line as f64 * (CAPTION + size.1);
        let corner = (left + column as f64 * (size.0 + MARGIN), top + CAPTION);
        draw_panel(&mut canvas, sample, panel, &Frame { low, scale, corner, size });
    }
    let base = below + 0.7 * LEGEND;
    scale_bar(&mut canvas, (left + 2.0 * HATCH, base), scale, size.0);
    for (k, row) in rows.iter().enumerate() {
        draw_legend(&mut canvas, row, (0.5 * width, base + LEGEND * (k as f64 + 1.0)));
    }
    canvas.finish()
}

fn draw_panel(canvas: &mut Canvas, sample: &Sample, panel: &Panel, frame: &Frame) {
    for (line, text) in panel.caption.iter().enumerate() {
        let at = (frame.corner.0 + 0.5 * frame.size.0, frame.corner.1 - CAPTION + 17.0 + 18.0 * line as f64);
        canvas.text(at, text, 14, Anchor::Middle);
    }
    canvas.clip(frame.corner, frame.size);
    for (wall, position) in sample.walls.iter().zip(panel.walls.position.chunks(sample.dimension)) {
        draw_wall(canvas, sample, wall, position, frame);
    }
    let mut order: Vec<usize> = (0..panel.fills.len()).collect();
    if sample.dimension == 3 {
        farthest_first(&mut order, |grain| sample.eye.depth(&panel.grains.position[grain * 3..]));
    }
    for grain in order {
        draw_grain(canvas, sample, panel, grain, frame);
    }
    for (wall, position) in sample.walls.iter().zip(panel.walls.position.chunks(sample.dimension)) {
        if wall.kind == WallKind::Plane
            && let Some(place) = sample.eye.place()
        {
            draw_plate(canvas, place, wall, position, frame, false);
        }
    }
    // lines between grains that are drawn tiny must not run into one another
    let diameter = 2.0 * frame.scale * sample.radius.iter().sum::<f64>() / sample.radius.len() as f64;
    let widest = (0.6 * diameter).max(1.0);
    let mut patches: Vec<&Patch> = panel.patches.iter().collect();
    farthest_first(&mut patches, |patch| {
        patch.corners.iter().map(|x| sample.eye.depth(x)).sum::<f64>() / patch.corners.len().max(1) as f64
    });
    for patch in patches {
        let corners: Vec<_> = patch.corners.iter().map(|x| frame.at(sample.flat(x))).collect();
        let lit = sample.eye.place().map(|place| place.lit(&patch.colour, &patch.corners));
        canvas.polygon(&corners, lit.as_ref().unwrap_or(&patch.colour), "#ffffff", 0.3);
    }
    draw_links(canvas, sample, &panel.links, frame, widest);
    for arrow in &panel.arrows {
        let [from, to] = [&arrow.from, &arrow.to].map(|point| frame.at(sample.flat(point)));
        draw_arrow(canvas, from, to);
    }
    canvas.end_clip();
}

/// The order in which things are drawn so that what is nearer to the eye covers what is farther.
fn farthest_first<T: Copy>(things: &mut [T], depth: impl Fn(T) -> f64) {
    things.sort_by(|&a, &b| depth(b).total_cmp(&depth(a)));
}

/// Lines no wider than `widest`; in perspective the nearest last, the farther the thinner and
/// paler.
fn draw_links(canvas: &mut Canvas, sample: &Sample, links: &[Link], frame: &Frame, widest: f64) {
    let mut line = |link: &Link, width: f64, colour: &str| {
        let ends = [&link.from, &link.to].map(|point| frame.at(sample.flat(point)));
        if ends.iter().all(|&end| frame.shows(end, 2.0)) {
            canvas.line(ends[0], ends[1], colour, width.min(widest));
        }
    };
    let Some(place) = sample.eye.place() else {
        links.iter().for_each(|link| line(link, link.width, &link.colour));
        return;
    };
    let middle = |link: &Link| [0, 1, 2].map(|k| 0.5 * (link.from[k] + link.to[k]));
    let mut order: Vec<&Link> = links.iter().collect();
    farthest_first(&mut order, |link| sample.eye.depth(&middle(link)));
    for link in order {
        let middle = middle(link);
        line(link, link.width * sample.eye.magnified(&middle), &place.hazy(&link.colour, &middle));
    }
}

/// A grain as a disk; in perspective the paler the farther, and lit from above and the left.
fn draw_grain(canvas: &mut Canvas, sample: &Sample, panel: &Panel, grain: usize, frame: &Frame) {
    let Some(radius) = sample.seen_radius(&panel.grains, grain) else { return };
    let (at, radius) = (frame.at(sample.centre(&panel.grains, grain)), radius * frame.scale);
    if !frame.shows(at, radius) {
        return;
    }
    // the outline of a tiny disk must not hide its fill
    let outline = (0.15 * radius).min(0.6);
    let mut disk = |fill: &str, edge: &str| canvas.disk(at, radius - 0.5 * outline, fill, edge, outline);
    let Some(place) = sample.eye.place() else {
        disk(&panel.fills[grain], panel.outline);
        return;
    };
    let hazy = |colour: &str| place.hazy(colour, &panel.grains.position[grain * 3..]);
    let fill = hazy(&panel.fills[grain]);
    disk(&fill, &hazy(panel.outline));
    let (lit, light) = ((at.0 - 0.25 * radius, at.1 - 0.25 * radius), mixed(&fill, 0.3));
    canvas.disk(lit, 0.5 * radius, &light, &light, 0.0);
}

fn draw_wall(canvas: &mut Canvas, sample: &Sample, wall: &Wall, position: &[f64], frame: &Frame) {
    let point = sample.flat(position);
    if wall.kind == WallKind::Plane {
        if let Some(place) = sample.eye.place() {
            return draw_plate(canvas, place, wall, position, frame, true);
        }
        let normal = sample.flat(&wall.normal[..sample.dimension]);
        // a plane parallel to the sheet has no line
        if normal[0].hypot(normal[1]) > 1e-6 {
            draw_plane(canvas, point, normal, frame);
        }
        return;
    }
    let (at, radius) = (frame.at(point), wall.radius.abs() * frame.scale);
    let fill = if wall.radius < 0.0 { "none" } else { "#d0d0d0" };
    canvas.disk(at, radius, fill, colour::BLACK, 1.5);
}

/// A plane in perspective, as a plate of the sample's size, if it is behind the grains or before
/// them: full, or its edges alone.
fn draw_plate(canvas: &mut Canvas, place: &Place, wall: &Wall, position: &[f64], frame: &Frame, behind: bool) {
    let (corners, is_behind) = place.plane(position, wall.normal);
    if is_behind == behind {
        let on_sheet = corners.map(|corner| frame.at(place.flat(&corner)));
        canvas.polygon(&on_sheet, if behind { "#e4e4e4" } else { "none" }, colour::GREY, 1.2);
    }
}

/// A line across the panel, hatched on the side away from the grains.
fn draw_plane(canvas: &mut Canvas, point: [f64; 2], normal: [f64; 2], frame: &Frame) {
    let length = normal[0].hypot(normal[1]);
    // on the sheet y points down
    let (n, t) = ((normal[0] / length, -normal[1] / length), (normal[1] / length, normal[0] / length));
    // from the place on the line that is nearest to the middle of the panel, in whole lines of the
    // hatching
    let (from, middle) = (frame.at(point), [0.5 * frame.size.0, 0.5 * frame.size.1]);
    let off = [frame.corner.0 + middle[0] - from.0, frame.corner.1 + middle[1] - from.1];
    let nearest = HATCH * ((off[0] * t.0 + off[1] * t.1) / HATCH).round();
    let centre = (from.0 + nearest * t.0, from.1 + nearest * t.1);
    let at = |s: f64| (centre.0 + s * t.0, centre.1 + s * t.1);
    let steps = ((frame.size.0 + frame.size.1) / HATCH) as i64;
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
