//! Drawing of each kind of wall, and its extent in the drawing.

use dem_drawing::{Canvas, colour};
use dem_history::{Wall, WallDrive, WallKind};

use super::arrow::draw_arrow;
use super::boxes::{Box2, around};
use super::eye::{Eye, Place};
use super::frame::{ARROW, Frame, HATCH};

/// Draws a wall behind the grains.
pub(super) fn draw(canvas: &mut Canvas, eye: &Eye, wall: &Wall, position: &[f64], frame: &Frame) {
    let point = eye.flat(position);
    match wall.kind {
        WallKind::Plane => {
            if let Some(place) = eye.place() {
                return draw_plate(canvas, place, wall, position, frame, true);
            }
            let normal = eye.flat(&wall.normal[..position.len()]);
            // a plane parallel to the sheet has no line
            if normal[0].hypot(normal[1]) > 1e-6 {
                draw_plane(canvas, point, normal, frame);
            }
        }
        WallKind::Circle | WallKind::Sphere | WallKind::Cylinder => {
            let (at, radius) = (frame.at(point), wall.radius.abs() * frame.scale);
            let fill = if wall.radius < 0.0 { "none" } else { "#d0d0d0" };
            canvas.disk(at, radius, fill, colour::BLACK, 1.5);
        }
    }
}

/// Draws the parts in front of the grains: in perspective, the edges of a plane.
pub(super) fn draw_in_front(canvas: &mut Canvas, eye: &Eye, wall: &Wall, position: &[f64], frame: &Frame) {
    if let (WallKind::Plane, Some(place)) = (wall.kind, eye.place()) {
        draw_plate(canvas, place, wall, position, frame, false);
    }
}

/// An arrow of the load at a driven plane: towards the grains where the wall pushes. It stands at
/// the middle of the panel, in perspective at the middle of the plate. None where no grain acts on
/// the wall, and at a plane parallel to the sheet. Only that of a plate behind the grains is drawn
/// with `behind`.
pub(super) fn draw_load(
    canvas: &mut Canvas,
    eye: &Eye,
    wall: &Wall,
    [position, force]: [&[f64]; 2],
    frame: &Frame,
    behind: bool,
) {
    let d = position.len();
    if !bears_arrow(wall) || force.len() != d {
        return;
    }
    // the load is opposite to the force of the grains
    let along = -force.iter().zip(&wall.direction).map(|(f, direction)| f * direction).sum::<f64>();
    if along == 0.0 {
        return;
    }
    let load = wall.direction.map(|x| along.signum() * x);
    let pushes = load.iter().zip(&wall.normal).map(|(f, n)| f * n).sum::<f64>() > 0.0;
    let [tail, head] = if pushes { [-ARROW, -2.0] } else { [2.0, ARROW] };
    if let Some(place) = eye.place() {
        let (corners, is_behind) = place.plane(position, wall.normal);
        if is_behind == behind {
            let middle = [0, 1, 2].map(|k| corners.iter().map(|corner| corner[k]).sum::<f64>() / 4.0);
            let at = |s: f64| frame.at(place.flat(&[0, 1, 2].map(|k| middle[k] + s / frame.scale * load[k])));
            draw_arrow(canvas, at(tail), at(head));
        }
        return;
    }
    // on the sheet y points down
    let [load, normal] = [load, wall.normal].map(|x| eye.flat(&x[..d])).map(|[x, y]| (x, -y));
    let length = normal.0.hypot(normal.1);
    if behind || length < 1e-6 {
        return;
    }
    let from = frame.at(eye.flat(position));
    let line = (-normal.1 / length, normal.0 / length);
    let off = to_the_middle(frame, from, line);
    let foot = (from.0 + line.0 * off, from.1 + line.1 * off);
    let at = |s: f64| (foot.0 + s * load.0, foot.1 + s * load.1);
    draw_arrow(canvas, at(tail), at(head));
}

/// Whether a wall has an arrow of its load: a driven plane.
pub(super) fn bears_arrow(wall: &Wall) -> bool {
    wall.kind == WallKind::Plane && wall.drive != WallDrive::Fixed
}

/// The box around a wall in the drawing, of a round wall its part within `limits`; `None` for an
/// unbounded plane.
pub(super) fn extent(eye: &Eye, wall: &Wall, position: &[f64], limits: Box2) -> Option<Box2> {
    match wall.kind {
        WallKind::Plane => eye.place().map(|place| place.shows(&place.plane(position, wall.normal).0)),
        WallKind::Circle | WallKind::Sphere | WallKind::Cylinder => {
            let corners = around(eye.flat(position), wall.radius.abs());
            Some(corners.map(|[x, y]| [x.clamp(limits[0][0], limits[1][0]), y.clamp(limits[0][1], limits[1][1])]))
        }
    }
}

/// A plane in perspective, as a plate of the sample's size: filled if it is behind the grains, only
/// its edges if it is in front of them.
fn draw_plate(canvas: &mut Canvas, place: &Place, wall: &Wall, position: &[f64], frame: &Frame, behind: bool) {
    let (corners, is_behind) = place.plane(position, wall.normal);
    if is_behind == behind {
        let on_sheet = corners.map(|corner| frame.at(place.flat(&corner)));
        canvas.polygon(&on_sheet, if behind { "#e4e4e4" } else { "none" }, colour::GREY, 1.2);
    }
}

/// The way from a point along a line, with this unit vector, to the place that is nearest to the
/// middle of the panel.
fn to_the_middle(frame: &Frame, from: (f64, f64), line: (f64, f64)) -> f64 {
    let middle = (frame.corner.0 + 0.5 * frame.size.0, frame.corner.1 + 0.5 * frame.size.1);
    (middle.0 - from.0) * line.0 + (middle.1 - from.1) * line.1
}

/// A line across the panel, hatched on the side away from the grains.
fn draw_plane(canvas: &mut Canvas, point: [f64; 2], normal: [f64; 2], frame: &Frame) {
    let length = normal[0].hypot(normal[1]);
    // on the sheet y points down
    let (n, t) = ((normal[0] / length, -normal[1] / length), (normal[1] / length, normal[0] / length));
    // from the point of the line nearest to the middle of the panel, in whole lines of the hatching
    let from = frame.at(point);
    let nearest = HATCH * (to_the_middle(frame, from, t) / HATCH).round();
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
