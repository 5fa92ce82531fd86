//! Several materials: which grain is of which, and friction by pair.

use crate::output::number;
use crate::prepare::Ball;
use crate::scene::Scene;
use dem_core::dim::{Dim, Vect};
use dem_core::world::MaterialFriction;

/// The material of each grain, as its place in `Materials::names`; empty for a scene with one
/// material. `sampled` are the materials that the sample gives the grains (empty: all `base`),
/// `balls` their centres and radii (m).
///
/// # Errors
/// Messages about regions and materials without a grain.
pub fn assign<D: Dim>(scene: &Scene, sampled: Vec<u8>, balls: &[Ball<D>]) -> Result<Vec<u8>, Vec<String>> {
    let named = &scene.materials.named;
    if named.is_empty() {
        return Ok(vec![]);
    }
    let mut materials = if sampled.is_empty() { vec![0; balls.len()] } else { sampled };
    let mut wrong = vec![];
    for (k, material) in named.iter().enumerate() {
        for (r, region) in material.regions.iter().enumerate() {
            let mut count = 0;
            for (own, (centre, _)) in materials.iter_mut().zip(balls) {
                if region.holds(centre.as_slice()) {
                    *own = (k + 1) as u8;
                    count += 1;
                }
            }
            if count == 0 {
                wrong.push(format!(
                    "materials.named.{k}.regions.{r}.{}: it holds no centre of a grain; move or enlarge it: the centres \
                     reach {}",
                    region.name(),
                    extent::<D>(balls.iter().map(|(centre, _)| centre))
                ));
            }
        }
    }
    if !wrong.is_empty() {
        return Err(wrong);
    }
    for (k, material) in named.iter().enumerate() {
        if materials.iter().all(|own| usize::from(*own) != k + 1) {
            let remedy = match material.regions.is_empty() {
                true => "give it a region, or name it in the sample",
                false => "materials that come later in materials.named have its grains: move it behind them",
            };
            wrong.push(format!("materials.named.{k}: no grain is of {}: {remedy}", material.name));
        }
    }
    if wrong.is_empty() { Ok(materials) } else { Err(wrong) }
}

/// From where to where points reach, in words.
pub fn extent<'a, D: Dim>(points: impl Iterator<Item = &'a D::Vector> + Clone) -> String {
    let corner = |best: fn(f64, f64) -> f64, start: f64| {
        let along = |axis: usize| number(points.clone().map(|x| x[axis]).fold(start, best));
        (0..D::N).map(along).collect::<Vec<_>>().join(", ")
    };
    format!("from ({}) to ({}) m", corner(f64::min, f64::INFINITY), corner(f64::max, f64::NEG_INFINITY))
}

/// Friction by pair of materials; none for a scene with one material.
pub fn friction(scene: &Scene) -> Option<MaterialFriction> {
    let materials = &scene.materials;
    if materials.named.is_empty() {
        return None;
    }
    let count = materials.named.len() + 1;
    let pairs = (0..count).flat_map(|a| (0..count).map(move |b| (a, b)));
    let walls = |a| scene.walls.values().map(move |wall| materials.wall_friction_of(a, wall.friction));
    Some(MaterialFriction {
        count,
        grain_grain: pairs.map(|(a, b)| materials.friction_of(a, b)).collect(),
        grain_wall: (0..count).flat_map(walls).collect(),
    })
}
