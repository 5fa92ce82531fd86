use dem_history::RuptureMode;

use super::super::front::growth;
use super::*;

const D: f64 = 2e-3;

struct Lattice {
    position: Vec<[f64; 3]>,
    radius: Vec<f64>,
    bonds: Bonds,
}

/// Bonds between all spheres that touch.
fn bonded(position: Vec<[f64; 3]>, radius: Vec<f64>) -> Lattice {
    let distance = |i: usize, j: usize| (Point::from(position[i]) - Point::from(position[j])).norm();
    let touch = |i: usize, j: usize| distance(i, j) < 1.001 * (radius[i] + radius[j]);
    let pairs = (0..position.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let pair: Vec<[i32; 2]> = pairs.filter(|&(i, j)| touch(i, j)).map(|(i, j)| [i as i32, j as i32]).collect();
    let mean_diameter = pair.iter().map(|[i, j]| radius[*i as usize] + radius[*j as usize]).collect();
    let bonds = Bonds { rest_gap: vec![0.0; pair.len()], mean_diameter, pair, ..Bonds::default() };
    Lattice { position, radius, bonds }
}

fn cubic(n: usize) -> Lattice {
    let at = |k: usize| D * k as f64;
    let position = (0..n * n * n).map(|k| [at(k % n), at(k / n % n), at(k / n / n)]).collect();
    bonded(position, vec![0.5 * D; n * n * n])
}

/// Layers of a hexagonal close packing.
fn close_packed(n: usize) -> Lattice {
    let place = |k: usize| {
        let [i, j, l] = [k % n, k / n % n, k / n / n];
        let [x, y] = [i as f64 + 0.5 * ((j + l) % 2) as f64, 0.75f64.sqrt() * (j as f64 + (l % 2) as f64 / 3.0)];
        [D * x, D * y, D * (2f64 / 3.0).sqrt() * l as f64]
    };
    bonded((0..n * n * n).map(place).collect(), vec![0.5 * D; n * n * n])
}

impl Lattice {
    fn point(&self, bond: usize) -> [f64; 3] {
        let [a, b] = self.bonds.pair[bond].map(|grain| self.position[grain as usize]);
        std::array::from_fn(|k| 0.5 * (a[k] + b[k]))
    }

    fn where_point(&self, holds: impl Fn([f64; 3]) -> bool) -> Vec<usize> {
        (0..self.bonds.len()).filter(|&bond| holds(self.point(bond))).collect()
    }

    fn broken(&self, bonds: &[usize]) -> (Surfaces, Vec<Rupture>) {
        let rupture = |(k, &bond): (usize, &usize)| Rupture {
            step: k as i64,
            time: 1e-3 * k as f64,
            point: self.point(bond),
            normal_force: 0.0,
            tangential_force: 0.0,
            moment: 0.0,
            twist: 0.0,
            energy: 0.0,
            round: 0,
            bond: bond as i32,
            pair: self.bonds.pair[bond],
            mode: RuptureMode::Tension,
        };
        let ruptures: Vec<Rupture> = bonds.iter().enumerate().map(rupture).collect();
        (Surfaces::find(&self.position, &self.radius, &self.bonds, &ruptures), ruptures)
    }
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs()
}

#[test]
fn a_cut_through_a_cubic_lattice_is_one_flat_crack() {
    let sample = cubic(5);
    let cut = sample.where_point(|x| (2.9e-3..3.1e-3).contains(&x[2]));
    assert_eq!(cut.len(), 25);
    let (found, ruptures) = sample.broken(&cut);
    let [crack] = found.cracks.as_slice() else { panic!("{:?}", found.cracks) };
    // the part of the square cell within the polygon around the circle of half a diameter
    let polygon = SIDES as f64 * (std::f64::consts::PI / SIDES as f64).tan() * 0.25 * D * D;
    assert!(close(crack.area, 25.0 * polygon), "{}", crack.area / polygon);
    assert!(close(crack.flatness, 1.0) && close(crack.normal[2], 1.0), "{crack:?}");
    assert_eq!((crack.bonds, crack.modes.tension, crack.first, crack.last), (25, 25, 0.0, 24e-3));
    // from corner to corner of five by five polygons in a row
    assert!((5.6 * D..7.2 * D).contains(&crack.extent), "{}", crack.extent / D);
    let last = *growth(found.parts(), &ruptures).last().unwrap();
    assert_eq!((last.cracks, last.bonds), (1, 25));
    assert!(close(last.size, crack.area) && close(last.largest, crack.area));
}

#[test]
fn inside_a_close_packing_twelve_facets_surround_a_grain() {
    let sample = close_packed(5);
    // all bonds of the grain in the middle
    let middle = 62;
    let of = |bond: &usize| sample.bonds.pair[*bond].contains(&middle);
    let bonds: Vec<usize> = (0..sample.bonds.len()).filter(of).collect();
    assert_eq!(bonds.len(), 12);
    let (found, _) = sample.broken(&bonds);
    // the twelve faces of its cell: d²/(2√2) each, and they surround a volume of d³/√2
    let face = D * D / 8f64.sqrt();
    assert!(found.facets.iter().all(|facet| close(facet.area, face)), "{:?}", found.facets[0].area / face);
    let [crack] = found.cracks.as_slice() else { panic!("{}", found.cracks.len()) };
    assert!(close(crack.area, 12.0 * face) && close(crack.flatness, 1.0 / 3.0), "{crack:?}");
    let volume: f64 = found.facets.iter().map(|facet| facet.area * 0.5 * D / 3.0).sum();
    assert!(close(volume, D.powi(3) / 2f64.sqrt()));
}

#[test]
fn cracks_with_whole_material_between_them_are_two() {
    let sample = cubic(6);
    let layer = |z: f64| sample.where_point(move |x| (x[2] - z).abs() < 1e-4);
    let both = [layer(0.5 * D), layer(3.5 * D)].concat();
    let (found, ruptures) = sample.broken(&both);
    assert_eq!(found.cracks.iter().map(|crack| crack.bonds).collect::<Vec<_>>(), [36, 36]);
    assert_eq!(found.facets.iter().map(|facet| facet.crack).max(), Some(1));
    let rows = growth(found.parts(), &ruptures);
    assert_eq!((rows[0].cracks, rows[35].cracks, rows[36].cracks, rows[71].cracks), (1, 1, 2, 2));
}

#[test]
fn between_unequal_spheres_the_facet_passes_the_point_of_contact() {
    let sample = bonded(vec![[0.0; 3], [3e-3, 0.0, 0.0]], vec![1e-3, 2e-3]);
    let (found, _) = sample.broken(&[0]);
    let facet = &found.facets[0];
    assert!(facet.corners.iter().all(|x| (x[0] - 1e-3).abs() < 1e-15), "{:?}", facet.corners);
    let polygon = SIDES as f64 * (std::f64::consts::PI / SIDES as f64).tan() * 0.25 * 9e-6;
    assert!(close(facet.area, polygon) && close(found.cracks[0].extent, 3e-3 / (std::f64::consts::PI / 24.0).cos()));
}

#[test]
fn the_extent_is_that_of_all_pairs_of_corners() {
    // from the first corner the farthest is the third, and from that the first: the second and
    // fourth are farther apart
    let kite = [[0.0, 0.0], [2.0, -2.6], [5.0, 0.0], [2.0, 2.6]].map(|[x, y]| Point::new(x, y, 0.0));
    assert!(close(extent(kite.to_vec()), 5.2), "{}", extent(kite.to_vec()));
    assert_eq!((extent(vec![]), extent(vec![kite[0]])), (0.0, 0.0));
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    for round in 0..50 {
        // within a box, or on a sphere
        let point = |random: &mut dyn FnMut() -> f64| Point::new(random(), random(), random());
        let mut points: Vec<Point> = (0..40).map(|_| point(&mut random)).collect();
        if round % 2 == 0 {
            points.iter_mut().for_each(|x| *x = x.normalize());
        }
        let pairs = points.iter().flat_map(|a| points.iter().map(move |b| (a - b).norm()));
        assert_eq!(extent(points.clone()), pairs.fold(0.0, f64::max));
    }
}
