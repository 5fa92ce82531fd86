//! The pressure of a membrane: closed forms, conservation, and surfaces found in another way.

use crate::common::{self, floor, grain, newton, run, settings};
use dem_core::body::{Grains, Schedule, Shape, Wall};
use dem_core::dim::{D2, Dim, Vect};
use dem_core::saved::Saved;
use dem_core::solver::SolverSettings;
use dem_core::world::{Membrane, Settings, StepError, World};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

const R: f64 = 1e-3;
const P: f64 = 2e4;
type Vector = <D2 as Dim>::Vector;

fn constant(pressure: f64) -> Schedule {
    Arc::new(move |_| pressure)
}

fn exact() -> Settings<D2> {
    Settings { solver: SolverSettings::Staged(newton(1e-10, 1e-10, 1e-10)), ..settings(1e-5) }
}

/// Grains of radius `R` at these places (m) under a membrane, with the surface found.
fn under(places: &[[f64; 2]], walls: Vec<Wall<D2>>, between: Option<[usize; 2]>, disk: f64) -> World<D2> {
    let list = places.iter().map(|x| grain(x, R)).collect();
    let mut world = common::world(list, walls, exact());
    world.membrane = Some(Membrane::new(constant(P), between, disk));
    world.find_surface().expect("a surface");
    world
}

fn membrane(world: &World<D2>) -> &Membrane<D2> {
    world.membrane.as_ref().expect("a membrane")
}

/// The sum over the surface for each of its grains (m).
fn lengths(world: &World<D2>) -> BTreeMap<usize, [f64; 2]> {
    let mut sums = BTreeMap::new();
    for (grain, length) in membrane(world).pushes() {
        let sum: &mut [f64; 2] = sums.entry(grain).or_default();
        sum[0] += length[0];
        sum[1] += length[1];
    }
    sums
}

/// Planes at these heights that face each other.
fn plates(low: f64, high: f64) -> Vec<Wall<D2>> {
    let lid = Wall::fixed(Shape::Plane { normal: [0.0, -1.0].into() }, [0.0, high].into(), 0.0);
    let mut bottom = floor(0.0);
    bottom.position = [0.0, low].into();
    vec![bottom, lid]
}

/// A square lattice of touching grains, row by row, on the floor y = 0.
fn block(columns: usize, rows: usize) -> Vec<[f64; 2]> {
    let place = |k: usize| [2.0 * R * (k % columns) as f64, R + 2.0 * R * (k / columns) as f64];
    (0..columns * rows).map(place).collect()
}

#[test]
fn a_ring_bears_the_pressure_times_the_distance_of_its_sides() {
    for count in [3, 8, 31] {
        let half = PI / count as f64;
        let ring = R / half.sin();
        let place = |k: usize| [ring * (2.0 * half * k as f64).cos(), ring * (2.0 * half * k as f64).sin()];
        let places: Vec<[f64; 2]> = (0..count).map(place).collect();
        let mut world = under(&places, vec![], None, 2.0 * R);
        world.settings.thickness = 0.5;
        world.form_bonds(1e-6, |_| 1e3, 0.5);
        run(&mut world, 3);
        // two bonds hold a grain against p times a side: 2 N sin(π/n) = p t L cos(π/n)
        let expected = 0.5 * P * ring * half.cos();
        assert_eq!(world.touches().len(), count);
        for touch in world.touches() {
            let r = touch.reaction;
            assert!((r.n / expected - 1.0).abs() < 1e-8, "{count}: {} is not {expected}", r.n);
            assert!(r.t[0].abs() < 1e-8 * expected && r.m[0].abs() < 1e-8 * expected * R);
        }
        let polygon = 0.5 * count as f64 * ring * ring * (2.0 * half).sin();
        assert!((membrane(&world).area / polygon - 1.0).abs() < 1e-12);
        assert_eq!(membrane(&world).applied, P);
        // a mean pressure: Σ ℓ·f over the bonds and the pushes, whose points are R from the centres
        let trace = expected * count as f64 * 2.0 * R + P * 0.5 * count as f64 * 2.0 * R * half.cos() * R;
        let stress = world.stress();
        assert!(((stress[0] + stress[3]) * world.reference_volume() / trace - 1.0).abs() < 1e-8);
    }
}

#[test]
fn each_row_of_a_block_carries_the_pressure_on_its_pitch() {
    let (columns, rows) = (4, 5);
    let mut world = under(&block(columns, rows), plates(0.0, 10.0 * R), Some([0, 1]), 2.0 * R);
    let found = lengths(&world);
    assert_eq!(found.len(), 2 * rows);
    for row in 0..rows {
        for (grain, sign) in [(row * columns, 1.0), (row * columns + columns - 1, -1.0)] {
            let [x, y] = found[&grain];
            assert!((x - sign * 2.0 * R).abs() < 1e-12 * R && y.abs() < 1e-12 * R, "{grain}: {x}, {y}");
        }
    }
    assert!((membrane(&world).area / (6.0 * R * 10.0 * R) - 1.0).abs() < 1e-12);
    run(&mut world, 2);
    let sideways = world.touches().filter(|touch| touch.pair[1] == touch.pair[0] + 1);
    let forces: Vec<f64> = sideways.map(|touch| touch.reaction.n).collect();
    assert_eq!(forces.len(), rows * (columns - 1));
    forces.iter().for_each(|force| assert!((force / (P * 2.0 * R) - 1.0).abs() < 1e-8, "{force}"));
    // the pressure is the lateral stress, also of the outer halves of the grains
    let stress = world.stress();
    assert!((stress[0] / P - 1.0).abs() < 1e-8 && stress[3].abs() < 1e-8 * P, "{stress:?}");
}

#[test]
fn the_rows_that_a_wide_disk_does_not_reach_carry_nothing() {
    // hexagonal: every second row stands back by R, and the disk spans it
    let height = 3f64.sqrt() * R;
    let place = |k: usize| [2.0 * R * (k % 3) as f64 + R * ((k / 3) % 2) as f64, R + height * (k / 3) as f64];
    let places: Vec<[f64; 2]> = (0..15).map(place).collect();
    let top = 2.0 * R + 4.0 * height;
    for (disk, expected) in [(2.0 * R, vec![0, 6, 12]), (0.5 * R, vec![0, 3, 6, 9, 12])] {
        let world = under(&places, plates(0.0, top), Some([0, 1]), disk);
        let found = lengths(&world);
        let left: Vec<usize> = found.keys().copied().filter(|grain| grain % 3 == 0).collect();
        assert_eq!(left, expected);
        let sum: f64 = left.iter().map(|grain| found[grain][0]).sum();
        assert!((sum / top - 1.0).abs() < 1e-12, "{sum} is not {top}");
    }
}

#[test]
fn pressure_on_both_sides_of_a_column_cancels() {
    let mut world = under(&block(1, 4), plates(0.0, 8.0 * R), Some([0, 1]), R);
    assert_eq!(membrane(&world).pushes().count(), 8);
    lengths(&world).values().for_each(|sum| assert_eq!(*sum, [0.0, 0.0]));
    assert_eq!(membrane(&world).area, 0.0);
    run(&mut world, 2);
    assert!((world.stress()[0] / P - 1.0).abs() < 1e-8);
    world.grains.velocity.iter().for_each(|v| assert_eq!(v.norm(), 0.0));
    // one grain, and two, under a closed membrane
    for places in [&block(1, 1), &block(2, 1)] {
        let world = under(places, vec![], None, R);
        lengths(&world).values().for_each(|sum| assert_eq!(*sum, [0.0, 0.0]));
    }
}

#[test]
fn plates_may_lie_in_any_direction() {
    let straight = under(&block(3, 4), plates(0.0, 8.0 * R), Some([0, 1]), 2.0 * R);
    assert_eq!(lengths(&straight).len(), 8);
    // at each plate this disk touches two rows, or a row and the plate, at the same time
    for angle in [0.3f64, PI / 2.0, 2.5, -1.0] {
        let turn = |[x, y]: [f64; 2]| [angle.cos() * x - angle.sin() * y, angle.sin() * x + angle.cos() * y];
        let places: Vec<[f64; 2]> = block(3, 4).into_iter().map(turn).collect();
        let wall = |normal, at| Wall::fixed(Shape::Plane { normal: turn(normal).into() }, turn(at).into(), 0.0);
        let walls = vec![wall([0.0, 1.0], [0.0, 0.0]), wall([0.0, -1.0], [0.0, 8.0 * R])];
        let turned = under(&places, walls, Some([0, 1]), 2.0 * R);
        let (found, expected) = (lengths(&turned), lengths(&straight));
        assert!(found.keys().eq(expected.keys()));
        for (grain, length) in expected {
            let (found, expected) = (found[&grain], turn(length));
            (0..2).for_each(|k| assert!((found[k] - expected[k]).abs() < 1e-12 * R, "{grain} at {angle}"));
        }
    }
}

/// Grains near a hexagonal lattice in a disk: no hole between them holds a disk of their radius.
fn cluster(seed: u64) -> Vec<[f64; 2]> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut places = Vec::new();
    for row in -6i32..=6 {
        for column in -6i32..=6 {
            let x = 2.1 * R * (f64::from(column) + 0.5 * f64::from(row.rem_euclid(2)));
            let y = 2.1 * R * 0.75f64.sqrt() * f64::from(row);
            let mut move_by = || 0.05 * R * (rng.random::<f64>() - 0.5);
            let place = [x + move_by(), y + move_by()];
            if x.hypot(y) < 9.0 * R && rng.random::<f64>() < 0.97 {
                places.push(place);
            }
        }
    }
    places
}

/// The lengths on a surface without a path: two grains carry the line between them if a disk that
/// touches both overlaps no third one.
fn lengths_by_empty_disks(places: &[[f64; 2]], disk: f64) -> BTreeMap<usize, [f64; 2]> {
    let reach = R + disk;
    let mut sums: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
    for (i, a) in places.iter().enumerate() {
        for (j, b) in places.iter().enumerate() {
            let (x, y) = (b[0] - a[0], b[1] - a[1]);
            let half = 0.5 * x.hypot(y);
            if i == j || half >= reach {
                continue;
            }
            // the disk on the left of the way from a to b; the sample is on its right
            let off = (reach * reach - half * half).sqrt() / (2.0 * half);
            let centre = [0.5 * (a[0] + b[0]) - y * off, 0.5 * (a[1] + b[1]) + x * off];
            let touched =
                |(k, c): (usize, &[f64; 2])| k != i && k != j && (c[0] - centre[0]).hypot(c[1] - centre[1]) < reach;
            if !places.iter().enumerate().any(touched) {
                for k in [i, j] {
                    let sum = sums.entry(k).or_default();
                    sum[0] += 0.5 * y;
                    sum[1] -= 0.5 * x;
                }
            }
        }
    }
    sums
}

#[test]
fn the_surface_is_that_of_all_disks_that_fit_outside() {
    for seed in 0..20 {
        let places = cluster(seed);
        let disk = 1.2 * R;
        let expected = lengths_by_empty_disks(&places, disk);
        let found = lengths(&under(&places, vec![], None, disk));
        assert!(expected.len() > 15 && found.keys().eq(expected.keys()), "seed {seed}: {found:?}, {expected:?}");
        for (grain, sum) in expected {
            (0..2).for_each(|k| assert!((found[&grain][k] - sum[k]).abs() < 1e-12 * R, "seed {seed}, grain {grain}"));
        }
    }
}

/// Area of the convex hull, by Andrew's chains.
fn hull(mut points: Vec<[f64; 2]>) -> f64 {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let cross = |o: [f64; 2], a: [f64; 2], b: [f64; 2]| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    let chain = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while chain.len() > 1 && cross(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain
    };
    let mut outline = chain(&mut points.iter().copied());
    outline.extend(chain(&mut points.iter().rev().copied()));
    let next = outline.iter().cycle().skip(1);
    0.5 * outline.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>()
}

#[test]
fn a_very_large_disk_finds_the_convex_hull_and_the_pressure_has_no_resultant() {
    for seed in 20..30 {
        let places = cluster(seed);
        // between two grains at the distance 18 R it stands back by 18²/8e6 R, along less than 60 R
        let share = membrane(&under(&places, vec![], None, 1e6 * R)).area / hull(places.clone());
        assert!(share < 1.0 + 1e-12 && share > 1.0 - 60.0 * 4.1e-5 / 200.0, "seed {seed}: {share}");
        for disk in [0.7 * R, 2.0 * R, 1e6 * R] {
            let world = under(&places, vec![], None, disk);
            let (mut sum, mut torque) = (Vector::zero(), 0.0);
            for (grain, length) in membrane(&world).pushes() {
                sum += length;
                torque += places[grain][0] * length[1] - places[grain][1] * length[0];
            }
            assert!(sum.norm() < 1e-13 * 60.0 * R && torque.abs() < 1e-13 * 600.0 * R * R, "{sum:?}, {torque}");
        }
    }
}

#[test]
fn the_work_is_the_pressure_times_the_lost_area() {
    // loose grains that the pressure drives together; the midpoint rule leaves an error of order h
    let mut errors = Vec::new();
    for step in [4e-6, 2e-6] {
        let mut world = under(&cluster(3), vec![], None, 1.2 * R);
        world.settings.step = step;
        world.settings.thickness = 2.0;
        let surface: Vec<usize> = membrane(&world).pushes().map(|push| push.0).collect();
        let before = membrane(&world).area;
        for _ in 0..(6e-5 / step).round() as usize {
            world.step().expect("a step");
            let now: Vec<usize> = membrane(&world).pushes().map(|push| push.0).collect();
            assert_eq!(now, surface, "the same grains");
        }
        world.find_surface().expect("a surface");
        let expected = 2.0 * P * (before - membrane(&world).area);
        let work = world.ledger.external_work;
        assert!(expected > 0.0 && (work - world.ledger.kinetic).abs() < 1e-12 * work, "no contact closes");
        assert!(world.ledger.remainder.abs() < 1e-12 * work);
        errors.push((work / expected - 1.0).abs());
    }
    assert!(errors[0] < 1e-4 && errors[1] < 0.6 * errors[0], "{errors:?}");
}

#[test]
fn fragments_beyond_the_reach_of_the_disk_are_outside() {
    let sample = block(3, 4);
    let alone = under(&sample, plates(0.0, 8.0 * R), Some([0, 1]), R);
    let mut places = sample.clone();
    // on the floor on the left: the disk rolls over it; in the air on the right; at the lid
    places.extend([[-6.0 * R, R], [12.0 * R, 4.0 * R], [-6.0 * R, 7.0 * R]]);
    let with = under(&places, plates(0.0, 8.0 * R), Some([0, 1]), R);
    let mut found = lengths(&with);
    assert_eq!(found.remove(&12), Some([0.0, 0.0]));
    assert_eq!(found, lengths(&alone));
    assert!((membrane(&with).area / membrane(&alone).area - 1.0).abs() < 1e-12);
    // a closed membrane is around the largest part, wherever the others are
    let closed = under(&places, vec![], None, R);
    assert_eq!(lengths(&closed), lengths(&under(&sample, vec![], None, R)));
}

#[test]
fn a_sample_that_came_apart_has_no_surface() {
    let places: Vec<[f64; 2]> = block(3, 2).into_iter().chain(block(3, 1).iter().map(|x| [x[0], 8.0 * R])).collect();
    let list = places.iter().map(|x| grain(x, R)).collect();
    let mut world = common::world(list, plates(0.0, 9.0 * R), exact());
    for (disk, found) in [(1.4 * R, false), (1.6 * R, true), (4.6 * R, false)] {
        world.membrane = Some(Membrane::new(constant(P), Some([0, 1]), disk));
        let error = StepError::NoSurface { time: 0.0, walls: Some([9, 10]), disk };
        assert_eq!(world.find_surface(), if found { Ok(()) } else { Err(error.clone()) }, "{disk}");
        if !found {
            let before = world.grains.position.clone();
            assert_eq!(world.step().map(|report| report.time), Err(error));
            assert_eq!((world.steps, &world.grains.position), (0, &before));
        }
    }
}

#[test]
fn a_restored_world_finds_the_same_surface() {
    let make = || {
        let mut world = under(&cluster(5), vec![], None, 1.05 * R);
        world.settings.step = 5e-5;
        world.form_bonds(0.06, |_| 30.0, 0.3);
        world
    };
    let mut world = make();
    run(&mut world, 4);
    let mut saved = Saved::default();
    world.save(&mut saved);
    let mut from = saved.read();
    let grains = Grains::restored(&mut from).expect("grains");
    let mut other = World::restored(grains, vec![], vec![], make().settings, &mut from).expect("what was saved");
    other.membrane = make().membrane;
    for _ in 0..4 {
        run(&mut world, 1);
        run(&mut other, 1);
        let bits = |w: &World<D2>| w.grains.position.iter().flat_map(|x| [x[0].to_bits(), x[1].to_bits()]).collect();
        let [a, b]: [Vec<u64>; 2] = [bits(&world), bits(&other)];
        assert_eq!(a, b);
        assert_eq!(world.ledger, other.ledger);
        assert_eq!(membrane(&world).area.to_bits(), membrane(&other).area.to_bits());
    }
}
