//! The part shown, the viewpoint and the outlines of walls as numbers, for the slider of the page.

use dem_history::{Wall, WallKind};

use super::eye::Perspective;
use super::sample::{Sample, View};
use super::wall::corners;

impl View {
    /// Left, lower, right and upper edge, m.
    pub fn edges(&self) -> [f64; 4] {
        let [low, high] = self.0;
        [low[0], low[1], high[0], high[1]]
    }
}

impl Sample {
    /// The viewpoint of a perspective.
    pub fn perspective(&self) -> Option<Perspective> {
        self.eye.place().map(|place| place.as_seen())
    }

    /// Points of a wall at `position` (m): two ends of a line that crosses the view or of a plate,
    /// in 3D four corners, the centre of a round wall; and whether a plane or a plate is behind the
    /// grains.
    pub fn outline(&self, wall: &Wall, position: &[f64], view: View) -> (Vec<f64>, bool) {
        match wall.kind {
            WallKind::Plane => {}
            WallKind::Plate => {
                let behind = self.eye.place().is_none_or(|place| place.is_behind(position, wall.normal));
                return (corners(wall, position).concat(), behind);
            }
            WallKind::Circle | WallKind::Sphere | WallKind::Cylinder => return (position.to_vec(), true),
        }
        if let Some(place) = self.eye.place() {
            let (corners, behind) = place.plane(position, wall.normal);
            return (corners.concat(), behind);
        }
        // from the point of the line that is nearest to the middle of the view
        let [left, lower, right, upper] = view.edges();
        let [nx, ny, _] = wall.normal;
        let middle = [0.5 * (left + right), 0.5 * (lower + upper)];
        let along = (middle[0] - position[0]) * -ny + (middle[1] - position[1]) * nx;
        let reach = (right - left).hypot(upper - lower);
        let end = |s: f64| [position[0] - ny * s, position[1] + nx * s];
        ([end(along - reach), end(along + reach)].concat(), true)
    }
}
