//! Panels side by side or above each other on one sheet: grains, walls, lines, arrows and polygons.

use dem_drawing::{Anchor, Canvas, Drawing};

use super::arrow::draw_arrow;
use super::frame::{ARROW, Frame, HATCH};
use super::legend::{Key, draw_legend, key_width, legend_rows, scale_bar};
use super::panel::{Link, Panel, Patch};
use super::sample::{Sample, View};
use super::scale::mixed;
use super::wall;
use crate::output::counted;

/// Width and greatest height of one panel, units of the drawing.
const PANEL: (f64, f64) = (400.0, 560.0);
/// Margin around each panel.
const MARGIN: f64 = 14.0;
/// Height of a panel's caption, and of one row of the legend.
const CAPTION: f64 = 44.0;
const LEGEND: f64 = 30.0;
/// Width of a stacked panel, for samples much wider than high.
const WIDE: f64 = 860.0;
/// Ratio of width to height of a sample above which panels are stacked.
const STACKED: f64 = 1.6;
/// The size of a sheet is a multiple of this, so that its PNG has an even number of pixels: video
/// encoders require that.
const EVEN: f64 = 4.0;
/// Draws the panels on one scale, side by side or, if the sample is wide, above each other; with a
/// scale bar and the legend below.
pub fn draw(sample: &Sample, panels: &[Panel], legend: &[Key]) -> Drawing {
    let view = sample.view(panels.iter().map(|panel| (&panel.grains, &panel.walls)));
    draw_view(sample, view, panels, legend)
}

/// As [`draw`], for the part of the plane that contains the sample; captions tell how many grains
/// are outside.
pub fn draw_view(sample: &Sample, view: View, panels: &[Panel], legend: &[Key]) -> Drawing {
    let caption = |panel: &Panel| {
        let mut caption = panel.caption.clone();
        let outside = sample.outside(&panel.grains, view);
        if outside > 0 {
            let told = format!("{} outside the picture", counted(outside, "grain"));
            match caption.last_mut() {
                Some(line) => *line += &format!(", {told}"),
                None => caption.push(told),
            }
        }
        caption
    };
    draw_sheet(sample, view, panels, &panels.iter().map(caption).collect::<Vec<_>>(), legend)
}

/// As [`draw`], for a part of the sample.
pub fn draw_part(sample: &Sample, view: View, panels: &[Panel], legend: &[Key]) -> Drawing {
    let captions: Vec<_> = panels.iter().map(|panel| panel.caption.clone()).collect();
    draw_sheet(sample, view, panels, &captions, legend)
}

/// The panels with these captions.
fn draw_sheet(
    sample: &Sample,
    View([low, high]): View,
    panels: &[Panel],
    captions: &[Vec<String>],
    legend: &[Key],
) -> Drawing {
    let extent = [high[0] - low[0], high[1] - low[1]];
    let stacked = extent[0] > STACKED * extent[1];
    let widest = if stacked { WIDE } else { PANEL.0 };
    // room for the hatching of walls, or for arrows
    let loaded = sample.walls.iter().any(wall::bears_arrow);
    let room = if loaded { ARROW + 4.0 } else { 2.0 * HATCH };
    let scale = ((widest - 2.0 * room) / extent[0]).min((PANEL.1 - 2.0 * room) / extent[1]);
    let low = low.map(|x| x - room / scale);
    let size = (extent[0] * scale + 2.0 * room, extent[1] * scale + 2.0 * room);
    let (columns, lines) = if stacked { (1, panels.len()) } else { (panels.len(), 1) };
    let even = |length: f64| (length / EVEN).ceil() * EVEN;
    let entry = legend.iter().map(key_width).fold(0.0, f64::max);
    let width = even((columns as f64 * (size.0 + MARGIN) + MARGIN).max(420.0).max(entry + 2.0 * MARGIN));
    let rows = legend_rows(legend, width - 2.0 * MARGIN);
    let above = if captions.iter().any(|caption| !caption.is_empty()) { CAPTION } else { MARGIN };
    let below = lines as f64 * (above + size.1);
    let mut canvas = Canvas::new(width, even(below + LEGEND * (rows.len() as f64 + 1.0) + MARGIN));
    let left = 0.5 * (width - columns as f64 * (size.0 + MARGIN) + MARGIN);
    for (k, (panel, caption)) in panels.iter().zip(captions).enumerate() {
        let (column, line) = if stacked { (0, k) } else { (k, 0) };
        let top = line as f64 * (above + size.1);
        let corner = (left + column as f64 * (size.0 + MARGIN), top + above);
        let frame = Frame { low, scale, corner, size };
        draw_caption(&mut canvas, caption, &frame);
        draw_panel(&mut canvas, sample, panel, &frame);
    }
    let base = below + 0.7 * LEGEND;
    scale_bar(&mut canvas, (left + 2.0 * HATCH, base), scale, size.0);
    for (k, row) in rows.iter().enumerate() {
        draw_legend(&mut canvas, row, (0.5 * width, base + LEGEND * (k as f64 + 1.0)));
    }
    canvas.finish()
}

fn draw_caption(canvas: &mut Canvas, caption: &[String], frame: &Frame) {
    for (line, text) in caption.iter().enumerate() {
        let at = (frame.corner.0 + 0.5 * frame.size.0, frame.corner.1 - CAPTION + 17.0 + 18.0 * line as f64);
        canvas.text(at, text, 14, Anchor::Middle);
    }
}

fn draw_panel(canvas: &mut Canvas, sample: &Sample, panel: &Panel, frame: &Frame) {
    canvas.clip(frame.corner, frame.size);
    for (wall, position) in sample.walls.iter().zip(panel.walls.position.chunks(sample.dimension)) {
        wall::draw(canvas, &sample.eye, wall, position, frame);
    }
    draw_loads(canvas, sample, panel, frame, true);
    let mut order: Vec<usize> = (0..panel.fills.len()).collect();
    if sample.dimension == 3 {
        farthest_first(&mut order, |grain| sample.eye.depth(&panel.grains.position[grain * 3..]));
    }
    for grain in order {
        draw_grain(canvas, sample, panel, grain, frame);
    }
    for (wall, position) in sample.walls.iter().zip(panel.walls.position.chunks(sample.dimension)) {
        wall::draw_in_front(canvas, &sample.eye, wall, position, frame);
    }
    draw_loads(canvas, sample, panel, frame, false);
    // lines between tiny grains must not merge
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

/// The arrows of the loads at walls, of those behind the grains or of the others.
fn draw_loads(canvas: &mut Canvas, sample: &Sample, panel: &Panel, frame: &Frame, behind: bool) {
    for (k, wall) in sample.walls.iter().enumerate() {
        let own = k * sample.dimension..(k + 1) * sample.dimension;
        if let (Some(position), Some(force)) = (panel.walls.position.get(own.clone()), panel.walls.force.get(own)) {
            wall::draw_load(canvas, &sample.eye, wall, [position, force], frame, behind);
        }
    }
}

/// The drawing order: the farthest first, so that nearer objects cover it.
fn farthest_first<T: Copy>(things: &mut [T], depth: impl Fn(T) -> f64) {
    things.sort_by(|&a, &b| depth(b).total_cmp(&depth(a)));
}

/// Lines no wider than `widest`; in perspective the nearest last, and farther lines thinner and
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

/// A grain as a disk; in perspective farther grains are paler, and the light comes from above and
/// the left.
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
