//! The slider of the page: grains, walls and broken bonds at up to a hundred moments of the run, as
//! data for its script.
//!
//! Positions are quantised to 16 bits along each axis. Half of the moments are shared out over the
//! time, half over the ruptures, as in a film.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dem_history::{GrainState, History, Rupture, RuptureMode, WallDrive, WallKind};
use serde::Serialize;

use crate::cracks::mode_colour;
use crate::extent::{first_box, range};
use crate::film;
use crate::frames;
use crate::map::{Materials, Perspective, Sample, View};
use crate::output::Result;
use crate::section::{Player, json, quantised, rounded};
use crate::stress_strain;

/// Maximum number of moments, without those of the pictures.
const MOMENTS: usize = 100;
/// Maximum of 16-bit numbers in the page: about 1.2 MB in base 64.
const NUMBERS: usize = 450_000;
/// A grain that is farther from the sample than this many of its sizes is not shown: its place
/// would coarsen that of the others.
const FAR: f64 = 30.0;
/// A bond that never breaks.
const NEVER: u8 = 255;

/// The data of the script.
#[derive(Serialize)]
struct Data {
    dimension: usize,
    /// Left, lower, right and upper edge of the part shown, m.
    view: [f64; 4],
    /// The moment shown at first: that of the middle picture.
    start: usize,
    /// In 3D, the viewpoint.
    eye: Option<Perspective>,
    /// Times of the moments (s).
    time: Vec<f64>,
    /// Their steps.
    step: Vec<i64>,
    /// The load at each (N); empty without a load wall, null where it was not observed.
    load: Vec<Option<f64>>,
    /// Bonds broken at each, and at the start.
    broken: Vec<usize>,
    bonds: usize,
    /// Grains outside the part shown, at each.
    outside: Vec<usize>,
    /// The least and greatest position along each axis, m.
    low: Vec<f64>,
    high: Vec<f64>,
    /// Positions between these, moment by moment and grain by grain; those at an end are outside.
    position: String,
    /// The greatest radius (m), and the radii over it.
    largest: f64,
    radius: String,
    /// Number of the colour of each grain, as bytes; empty for grains of one material.
    material: String,
    /// The two grains of each bond, as 32-bit numbers.
    pair: String,
    /// The first moment at which each bond is broken, and its mode, as bytes.
    broke: String,
    mode: String,
    /// Colours of the modes.
    colours: Vec<&'static str>,
    walls: Vec<WallData>,
}

/// A wall at all moments.
#[derive(Serialize)]
struct WallData {
    name: String,
    driven: bool,
    /// Radius of a round wall (m), 0 for a plane and a plate; negative where the grains are inside.
    radius: f64,
    /// Whether a plane is behind the grains, in 3D.
    behind: bool,
    /// Of a plane or a plate the ends (2D) or the corners (3D), of a round wall its centre, moment
    /// by moment.
    points: Vec<f64>,
}

/// The slider over moments that include the frames `frames`; `None` for a history with a single
/// frame, and for a sample that is too large for the page.
///
/// # Errors
/// Those of reading the history.
pub fn read(
    history: &History,
    ruptures: &[Rupture],
    frames: &[usize],
    load: Option<&stress_strain::Report>,
) -> Result<Option<Player>> {
    let (grains, bonds, d) = (history.grains()?, history.bonds()?, history.dimension());
    let room = NUMBERS.saturating_sub(5 * bonds.len()) / (grains.radius.len() * d).max(1);
    let times: Vec<f64> = ruptures.iter().map(|rupture| rupture.time).collect();
    let moments = moments(history.times(), &times, frames, room.min(MOMENTS));
    if moments.len() < 2 {
        return Ok(None);
    }
    let (sample, materials) = (Sample::with_depth(history)?, Materials::read(history)?);
    let (mut view, mut states, mut outlines) = (View::EMPTY, vec![], vec![]);
    let mut broke = vec![NEVER; bonds.len()];
    let mut mode = vec![0; bonds.len()];
    let mut broken = vec![];
    for (moment, &frame) in moments.iter().enumerate() {
        let (state, walls) = (history.grain_state(frame)?, history.wall_state(frame)?);
        view = view.join(sample.view(std::iter::once((&state, &walls))));
        states.push(state);
        outlines.push(walls.position);
        let mut count = 0;
        for (bond, status) in history.bond_status(frame)?.iter().enumerate().take(bonds.len()) {
            let Some(how) = status.mode() else { continue };
            count += 1;
            if broke[bond] == NEVER {
                broke[bond] = moment as u8;
                mode[bond] = RuptureMode::ALL.iter().position(|other| *other == how).unwrap_or(0) as u8;
            }
        }
        broken.push(count);
    }
    let ends = ends(history, &states)?;
    let shares = states.iter().flat_map(|state| state.position.iter().enumerate()).map(|(k, x)| {
        let [low, high] = ends[k % d];
        if high > low { (x - low) / (high - low) } else { 0.5 }
    });
    let largest = range(grains.radius.iter().copied())[1];
    let time: Vec<f64> = moments.iter().map(|&frame| history.times()[frame]).collect();
    let step: Vec<i64> = moments.iter().map(|&frame| history.steps()[frame]).collect();
    let at = |report: &stress_strain::Report| step.iter().map(|&step| report.load_at(step)).collect();
    let data = Data {
        dimension: d,
        view: view.edges(),
        start: frames.get(frames.len() / 2).and_then(|frame| moments.binary_search(frame).ok()).unwrap_or(0),
        eye: sample.perspective(),
        load: load.map_or_else(Vec::new, at),
        broken,
        bonds: bonds.len(),
        outside: states.iter().map(|state| sample.outside(state, view)).collect(),
        position: quantised(shares),
        low: ends.iter().map(|end| end[0]).collect(),
        high: ends.iter().map(|end| end[1]).collect(),
        radius: quantised(grains.radius.iter().map(|radius| radius / largest)),
        largest,
        material: STANDARD.encode(materials.as_ref().map_or_else(Vec::new, Materials::colours)),
        pair: STANDARD.encode(bonds.pair.iter().flatten().flat_map(|grain| grain.to_le_bytes()).collect::<Vec<u8>>()),
        broke: STANDARD.encode(broke),
        mode: STANDARD.encode(&mode),
        colours: RuptureMode::ALL.iter().map(|mode| mode_colour(*mode)).collect(),
        walls: walls(history, &sample, view, &outlines)?,
        time,
        step,
    };
    let twist = ruptures.iter().any(|rupture| rupture.mode == RuptureMode::Twist);
    let mut legend = if bonds.is_empty() { vec![] } else { frames::bond_legend(d, twist) };
    legend.extend(materials.iter().flat_map(Materials::in_page));
    Ok(Some(Player { moments: moments.len(), data: json(&data)?, legend, charts: vec![] }))
}

/// The frames of at most `count` moments, and of the pictures.
fn moments(times: &[f64], ruptures: &[f64], pictures: &[usize], count: usize) -> Vec<usize> {
    let shown = film::pace::pictures(times, ruptures, count.saturating_sub(pictures.len() + 1));
    let mut moments: Vec<usize> = shown.iter().map(|shown| shown.frame).chain(pictures.iter().copied()).collect();
    moments.sort_unstable();
    moments.dedup();
    if moments.len() > count { vec![] } else { moments }
}

/// The least and greatest position along each axis, m.
fn ends(history: &History, states: &[GrainState]) -> Result<Vec<[f64; 2]>> {
    let first = first_box(history)?;
    let size = first.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
    let axis = |(k, [low, high]): (usize, &[f64; 2])| {
        let all = states.iter().flat_map(|state| state.position.iter().skip(k).step_by(first.len()).copied());
        // a grain at an end counts as outside, so the range is a little wider
        let [least, most] = range(all.filter(|x| x.is_finite()));
        let margin = 1e-3 * size;
        [(least - margin).max(low - FAR * size), (most + margin).min(high + FAR * size)]
    };
    Ok(first.iter().enumerate().map(axis).collect())
}

/// The walls, from their positions at each moment.
fn walls(history: &History, sample: &Sample, view: View, positions: &[Vec<f64>]) -> Result<Vec<WallData>> {
    let d = history.dimension();
    let mut found = vec![];
    for (k, wall) in history.walls()?.iter().enumerate() {
        let mut data = WallData {
            name: wall.name.clone(),
            driven: wall.drive != WallDrive::Fixed,
            radius: if matches!(wall.kind, WallKind::Plane | WallKind::Plate) { 0.0 } else { wall.radius },
            behind: false,
            points: vec![],
        };
        for position in positions {
            let position = position.get(k * d..(k + 1) * d).unwrap_or_default();
            if position.len() < d {
                continue;
            }
            let (points, behind) = sample.outline(wall, position, view);
            data.behind = behind;
            data.points.extend(points.into_iter().map(rounded));
        }
        found.push(data);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_include_those_of_the_pictures_and_fit_the_page() {
        let times: Vec<f64> = (0..=1000).map(|k| 1e-3 * f64::from(k)).collect();
        let found = moments(&times, &[0.9, 0.9005, 0.901], &[3, 777, 1000], 100);
        assert!((45..=100).contains(&found.len()), "{}", found.len());
        assert!([0, 3, 777, 1000].iter().all(|frame| found.contains(frame)), "{found:?}");
        assert!(found.windows(2).all(|pair| pair[0] < pair[1]));
        // no room, no slider
        assert_eq!(moments(&times, &[], &[3, 777, 1000], 2), Vec::<usize>::new());
        assert_eq!(moments(&[0.5], &[], &[0], 100), [0]);
    }
}
