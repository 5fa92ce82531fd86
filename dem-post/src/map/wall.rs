//! Drawing of each kind of wall, and its extent in the drawing.

use dem_drawing::{Canvas, colour};
use dem_history::{Wall, WallDrive, WallKind};
use nalgebra::Vector3;

use super::arrow::draw_arrow;
use super::boxes::{Box2, EMPTY, around, union};
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
        WallKind::Plate => draw_plate_wall(canvas, eye, wall, position, frame, true),
        WallKind::Circle | WallKind::Sphere | WallKind::Cylinder => {
            let (at, radius) = (frame.at(point), wall.radius.abs() * frame.scale);
            let fill = if wall.radius < 0.0 { "none" } else { "#d0d0d0" };
            canvas.disk(at, radius, fill, colour::BLACK, 1.5);
        }
    }
}

/// Draws the parts in front of the grains: plates in 2D; in perspective, the edges of a plane or a
/// plate.
pub(super) fn draw_in_front(canvas: &mut Canvas, eye: &Eye, wall: &Wall, position: &[f64], frame: &Frame) {
    match (wall.kind, eye.place()) {
        (WallKind::Plane, Some(place)) => draw_plate(canvas, place, wall, position, frame, false),
        (WallKind::Plate, _) => draw_plate_wall(canvas, eye, wall, position, frame, false),
        _ => {}
    }
}

/// Draws the arrow of the load at a wall, if it has one; with `behind` only at a plate behind the
/// grains, else only at other walls.
pub(super) fn draw_load(canvas: &mut Canvas, eye: &Eye, wall: &Wall, at: [&[f64]; 2], frame: &Frame, behind: bool) {
    if let Some(([from, to], is_behind)) = load_arrow(eye, wall, at, frame)
        && is_behind == behind
    {
        draw_arrow(canvas, from, to);
    }
}

/// The ends of the arrow of the load at a driven plane or plate, and whether it is drawn behind the
/// grains. The arrow points towards the grains where the wall pushes. It stands at the middle of
/// the plate, at a plane at the middle of the panel, in perspective of the part that is drawn. None
/// where no grain acts on the wall, and at a wall parallel to the sheet.
fn load_arrow(
    eye: &Eye,
    wall: &Wall,
    [position, force]: [&[f64]; 2],
    frame: &Frame,
) -> Option<([(f64, f64); 2], bool)> {
    let d = position.len();
    // the load is opposite to the force of the grains
    let along = -force.iter().zip(&wall.direction).map(|(f, direction)| f * direction).sum::<f64>();
    if !bears_arrow(wall) || force.len() != d || along == 0.0 {
        return None;
    }
    let load = wall.direction.map(|x| along.signum() * x);
    let along_normal = |x: &[f64]| x.iter().zip(&wall.normal).map(|(x, n)| x * n).sum::<f64>();
    let mut towards = along_normal(&load);
    // the grains of a plate may be on either side: they press it away from them
    if wall.kind == WallKind::Plate && along_normal(force) > 0.0 {
        towards = -towards;
    }
    let pushes = towards > 0.0;
    let ends = if pushes { [-ARROW, -2.0] } else { [2.0, ARROW] };
    if let Some(place) = eye.place() {
        let (corners, behind) = place.plane(position, wall.normal);
        let middle = match wall.kind {
            WallKind::Plate => [position[0], position[1], position[2]],
            _ => [0, 1, 2].map(|k| corners.iter().map(|corner| corner[k]).sum::<f64>() / 4.0),
        };
        let behind = behind && wall.kind == WallKind::Plane;
        let at = |s: f64| frame.at(place.flat(&[0, 1, 2].map(|k| middle[k] + s / frame.scale * load[k])));
        return Some((ends.map(at), behind));
    }
    // on the sheet y points down
    let [load, normal] = [load, wall.normal].map(|x| eye.flat(&x[..d])).map(|[x, y]| (x, -y));
    let length = normal.0.hypot(normal.1);
    if length < 1e-6 {
        return None;
    }
    let from = frame.at(eye.flat(position));
    let line = (-normal.1 / length, normal.0 / length);
    let off = if wall.kind == WallKind::Plate { 0.0 } else { to_the_middle(frame, from, line) };
    let foot = (from.0 + line.0 * off, from.1 + line.1 * off);
    let at = |s: f64| (foot.0 + s * load.0, foot.1 + s * load.1);
    Some((ends.map(at), false))
}

/// Whether a wall has an arrow of its load: a driven plane or plate.
pub(super) fn bears_arrow(wall: &Wall) -> bool {
    matches!(wall.kind, WallKind::Plane | WallKind::Plate) && wall.drive != WallDrive::Fixed
}

/// The box around a wall in the drawing, of a round wall and a plate the part within `limits`;
/// `None` for an unbounded plane.
pub(super) fn extent(eye: &Eye, wall: &Wall, position: &[f64], limits: Box2) -> Option<Box2> {
    let within = |[x, y]: [f64; 2]| [x.clamp(limits[0][0], limits[1][0]), y.clamp(limits[0][1], limits[1][1])];
    match wall.kind {
        WallKind::Plane => eye.place().map(|place| place.shows(&place.plane(position, wall.normal).0)),
        WallKind::Plate => {
            let shown = |found, corner: &Vec<f64>| union(found, around(within(eye.flat(corner)), 0.0));
            Some(corners(wall, position).iter().fold(EMPTY, shown))
        }
        WallKind::Circle | WallKind::Sphere | WallKind::Cylinder => {
            Some(around(eye.flat(position), wall.radius.abs()).map(within))
        }
    }
}

/// The ends (2D) or corners (3D) of a plate with its middle at `position`, m.
pub(super) fn corners(wall: &Wall, position: &[f64]) -> Vec<Vec<f64>> {
    let side = Vector3::from(wall.side);
    let (a, b) = (0.5 * wall.length * side, 0.5 * wall.width * Vector3::from(wall.normal).cross(&side));
    let signs: &[[f64; 2]] = match position.len() {
        2 => &[[-1.0, 0.0], [1.0, 0.0]],
        _ => &[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]],
    };
    let corner = |[s, t]: &[f64; 2]| (a * *s + b * *t).iter().zip(position).map(|(x, at)| at + x).collect();
    signs.iter().map(corner).collect()
}

/// A plate: in 2D a thick line, without hatching, since it is solid from both sides; in 3D its
/// outline, filled if it is behind the grains.
fn draw_plate_wall(canvas: &mut Canvas, eye: &Eye, wall: &Wall, position: &[f64], frame: &Frame, behind: bool) {
    let corners = corners(wall, position);
    let on_sheet: Vec<(f64, f64)> = corners.iter().map(|corner| frame.at(eye.flat(corner))).collect();
    match (&on_sheet[..], eye.place()) {
        // in front: the grains that touch it reach into the width of the line
        (&[from, to], _) if !behind => canvas.line(from, to, colour::BLACK, 3.0),
        (&[_, _], _) => {}
        // parallel to an axis, and often seen from its edge
        (_, None) if behind => canvas.polygon(&on_sheet, "none", colour::BLACK, 1.8),
        (_, None) => {}
        (_, Some(place)) if place.is_behind(position, wall.normal) == behind => {
            canvas.polygon(&on_sheet, if behind { "#e4e4e4" } else { "none" }, colour::GREY, 1.2);
        }
        (_, Some(_)) => {}
    }
}

/// A plane in perspective, as a rectangle of the sample's size: filled if it is behind the grains,
/// only its edges if it is in front of them.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn frame() -> Frame {
        Frame { low: [-2.0, -2.0], scale: 100.0, corner: (0.0, 0.0), size: (400.0, 400.0) }
    }

    /// The upper wall of a cube of side 2 m, driven along an axis of d.
    fn lid(axis: usize, sign: f64) -> Wall {
        let unit = |sign: f64| [0, 1, 2].map(|k| if k == axis { sign } else { 0.0 });
        Wall {
            name: String::new(),
            kind: WallKind::Plane,
            normal: unit(-1.0),
            radius: 0.0,
            drive: WallDrive::Force,
            direction: unit(sign),
            ..Wall::default()
        }
    }

    #[test]
    fn the_arrow_of_a_pushing_wall_points_at_its_middle() {
        let eye = Eye::Along([0, 1]);
        // the grains act upwards: the load is 5 N downwards, whatever the sense of the drive
        for sign in [-1.0, 1.0] {
            let ends = load_arrow(&eye, &lid(1, sign), [&[0.5, 1.0], &[0.0, 5.0]], &frame());
            assert_eq!(ends, Some(([(200.0, 100.0 - ARROW), (200.0, 98.0)], false)));
            let pulled = load_arrow(&eye, &lid(1, sign), [&[0.5, 1.0], &[0.0, -5.0]], &frame());
            assert_eq!(pulled, Some(([(200.0, 98.0), (200.0, 100.0 - ARROW)], false)));
        }
        assert_eq!(load_arrow(&eye, &lid(1, 1.0), [&[0.5, 1.0], &[0.0, 0.0]], &frame()), None);
        // seen along y: the lid is a line, a wall that is driven along y is parallel to the sheet
        let eye = Eye::Along([0, 2]);
        let ends = load_arrow(&eye, &lid(2, 1.0), [&[0.0, 0.0, 1.0], &[0.0, 0.0, 5.0]], &frame());
        assert_eq!(ends, Some(([(200.0, 100.0 - ARROW), (200.0, 98.0)], false)));
        assert_eq!(load_arrow(&eye, &lid(1, 1.0), [&[0.0, 1.0, 0.0], &[0.0, 5.0, 0.0]], &frame()), None);
    }

    #[test]
    fn the_arrow_of_a_plate_stands_at_its_middle_on_the_side_away_from_its_grains() {
        let eye = Eye::Along([0, 1]);
        for normal in [-1.0, 1.0] {
            let plate = Wall { kind: WallKind::Plate, normal: [0.0, normal, 0.0], ..lid(1, -1.0) };
            let ends = load_arrow(&eye, &plate, [&[0.5, 1.0], &[0.0, 5.0]], &frame());
            assert_eq!(ends, Some(([(250.0, 100.0 - ARROW), (250.0, 98.0)], false)));
        }
    }

    #[test]
    fn in_perspective_the_arrow_stands_on_the_middle_of_the_plate() {
        let place = Place::of([[-1.0; 3], [1.0; 3]].iter().map(<[f64; 3]>::as_slice), 0.1);
        let middle = frame().at(place.flat(&[0.0, 0.0, 1.0]));
        let eye = Eye::At(place);
        let ([tail, head], behind) =
            load_arrow(&eye, &lid(2, 1.0), [&[9.0, 9.0, 1.0], &[0.0, 0.0, 5.0]], &frame()).unwrap();
        // from above, at the plate; a vertical line stays vertical
        assert!(!behind && tail.1 < head.1 && head.1 < middle.1);
        assert!((head.1 - middle.1).abs() < 3.0 && (head.0 - middle.0).abs() < 1e-9 && (tail.0 - head.0).abs() < 1e-9);
        // a wall behind the grains has its arrow there
        let back = load_arrow(&eye, &lid(1, 1.0), [&[0.0, 1.0, 0.0], &[0.0, 5.0, 0.0]], &frame()).unwrap();
        assert!(back.1);
    }

    #[test]
    fn a_plate_has_its_ends_and_its_corners() {
        let plate = Wall { kind: WallKind::Plate, side: [0.6, 0.8, 0.0], length: 2.0, ..Wall::default() };
        assert_eq!(corners(&plate, &[1.0, 5.0]), [[0.4, 4.2], [1.6, 5.8]]);
        let plate = Wall { normal: [0.8, -0.6, 0.0], width: 4.0, ..plate };
        // normal × side = (0, 0, 1)
        let expected = [[0.4, 4.2, 1.0], [1.6, 5.8, 1.0], [1.6, 5.8, 5.0], [0.4, 4.2, 5.0]];
        let off = corners(&plate, &[1.0, 5.0, 3.0])
            .concat()
            .iter()
            .zip(expected.concat())
            .map(|(a, b)| a - b)
            .collect::<Vec<_>>();
        assert!(off.iter().all(|x: &f64| x.abs() < 1e-15), "{off:?}");
    }

    /// The part of a plate beyond the limits is not shown.
    #[test]
    fn a_plate_widens_the_picture_up_to_the_limits() {
        let plate = Wall { kind: WallKind::Plate, side: [1.0, 0.0, 0.0], length: 8.0, ..Wall::default() };
        let limits = [[-2.0, -2.0], [9.0, 9.0]];
        let found = extent(&Eye::Along([0, 1]), &plate, &[0.0, 1.0], limits);
        assert_eq!(found, Some([[-2.0, 1.0], [4.0, 1.0]]));
    }
}
