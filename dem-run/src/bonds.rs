//! The bonds of a sample: which grains are bonded, by how much, and what differs between materials.

use crate::bond_list::{self, Listed};
use crate::error::RunError;
use crate::materials::extent;
use crate::scene::{self, Scene};
use dem_core::body::Grains;
use dem_core::bond::{self, Bond};
use dem_core::dim::{Dim, Vect};
use dem_core::world::close_pairs;
use rand::RngExt;
use rand_pcg::Pcg64;
use std::f64::consts::PI;

/// Stream of the random generator from which strengths of bonds are drawn.
const SCATTER_STREAM: u128 = 1;

/// Which pairs of grains form no bond at any gap.
pub const EXCEPT: &str = ", except pairs that form no bond: both grains fixed or held by the grip of a wall, a strength \
                          of 0, or a region of bonds.absent between them";

/// Why a run of this scene has no bonds; `None` if the scene has none either.
#[must_use]
pub fn why_none(scene: &Scene) -> Option<String> {
    let bonds = scene.bonds.as_ref().filter(|_| scene.has_bonds())?;
    Some(match scene.cement_stage() {
        // a stage that forms no bond is an error
        Some(_) => "the stage that forms them did not begin".into(),
        None => {
            let gap = bonds.gap_tolerance;
            format!("no two grains are within bonds.gap_tolerance, {gap} mean diameters{EXCEPT}")
        }
    })
}

/// The bonds of a scene between its grains, sorted by pair.
///
/// # Errors
/// [`RunError::Sample`]: a region without a bond, or what is wrong with the list of bonds;
/// [`RunError::SceneFile`] and [`RunError::File`] for a list that cannot be read.
pub fn of_sample<D: Dim>(scene: &Scene, grains: &Grains<D>) -> Result<Vec<Bond>, RunError> {
    let Some(bonds) = &scene.bonds else { return Ok(vec![]) };
    let laws = Laws::<D> { scene, bonds, grains };
    let mut list = match &bonds.list {
        Some(path) => bond_list::read::<D>(path, grains, bonds.gap_tolerance)?,
        None => {
            let formed = close_pairs(grains, bonds.gap_tolerance, |pair, a| laws.strength(pair, a), 0.0);
            outside(bonds, grains, formed)?.into_iter().map(Listed::of).collect()
        }
    };
    list.sort_by_key(|listed| listed.bond.pair);
    for Listed { bond, strength, shear, rolling } in &mut list {
        let pair = bond.pair.map(|k| k as usize);
        bond.strength = strength.unwrap_or_else(|| laws.strength(pair, bond.mean_diameter));
        let limits = laws.limits(pair);
        (bond.shear, bond.rolling) = (shear.unwrap_or(limits[0]), rolling.unwrap_or(limits[1]));
        bond.twist = laws.pair(pair).and_then(|pair| pair.twist).or(bonds.twist).unwrap_or(0.0);
        bond.stiffness = bonds.stiffness.map(|stiffness| {
            let factor = laws.stiffness_factor(pair);
            scaled(bond_stiffness::<D>(stiffness, bond.mean_diameter, scene.thickness()), factor)
        });
    }
    // a strength of zero is no bond
    list.retain(|listed| listed.bond.strength > 0.0);
    let drawn = list.iter_mut().filter(|listed| listed.strength.is_none()).filter_map(|listed| {
        let own = laws.pair(listed.bond.pair.map(|k| k as usize)).and_then(|pair| pair.scatter);
        Some((&mut listed.bond, own.or(bonds.scatter)?))
    });
    scatter_strengths(drawn, scene.seed);
    Ok(list.into_iter().map(|listed| listed.bond).collect())
}

/// What the scene says of the bond of a pair of grains.
struct Laws<'a, D: Dim> {
    scene: &'a Scene,
    bonds: &'a scene::Bonds,
    grains: &'a Grains<D>,
}

impl<D: Dim> Laws<'_, D> {
    /// What is listed for the materials of two grains.
    fn pair(&self, pair: [usize; 2]) -> Option<&scene::PairBonds> {
        let [a, b] = pair.map(|k| self.grains.material_of(k));
        self.scene.materials.pair(a, b)?.bonds.as_ref()
    }

    /// Tensile strength (N) of the bond of two grains with this mean diameter (m).
    fn strength(&self, pair: [usize; 2], mean_diameter: f64) -> f64 {
        let scene = self.scene;
        self.bonds.cohesion_of(self.pair(pair), scene.dimension, mean_diameter, scene.thickness())
    }

    /// Coefficients of the limits of shear and rolling.
    fn limits(&self, pair: [usize; 2]) -> [f64; 2] {
        let bonds = self.bonds;
        let [a, b] = pair.map(|k| self.grains.material_of(k));
        let friction = bonds.friction.unwrap_or_else(|| self.scene.materials.friction_of(a, b));
        let of_pair = self.pair(pair);
        let shear = of_pair.and_then(|pair| pair.shear).or(bonds.shear);
        let rolling = of_pair.and_then(|pair| pair.rolling).or(bonds.rolling);
        [shear.unwrap_or(friction), rolling.unwrap_or(friction)]
    }

    fn stiffness_factor(&self, pair: [usize; 2]) -> f64 {
        self.pair(pair).and_then(|pair| pair.stiffness_factor).unwrap_or(1.0)
    }
}

/// The bonds that no region of `bonds.absent` meets.
///
/// # Errors
/// Messages about regions that meet no bond.
fn outside<D: Dim>(bonds: &scene::Bonds, grains: &Grains<D>, formed: Vec<Bond>) -> Result<Vec<Bond>, RunError> {
    if bonds.absent.is_empty() {
        return Ok(formed);
    }
    let ends = |bond: &Bond| bond.pair.map(|k| grains.position[k as usize]);
    let meets = |region: &scene::Region, bond: &Bond| {
        let [a, b] = ends(bond);
        region.meets(a.as_slice(), b.as_slice())
    };
    let mut wrong = vec![];
    for (k, region) in bonds.absent.iter().enumerate() {
        if !formed.iter().any(|bond| meets(region, bond)) {
            wrong.push(format!(
                "bonds.absent.{k}.{}: no bond would pass through it; move or enlarge it: the centres of the grains reach {}",
                region.name(),
                extent::<D>(grains.position.iter())
            ));
        }
    }
    if !wrong.is_empty() {
        return Err(RunError::Sample(wrong));
    }
    Ok(formed.into_iter().filter(|bond| !bonds.absent.iter().any(|region| meets(region, bond))).collect())
}

fn scaled(k: bond::Stiffness, factor: f64) -> bond::Stiffness {
    bond::Stiffness {
        normal: factor * k.normal,
        tangential: factor * k.tangential,
        rolling: factor * k.rolling,
        twist: factor * k.twist,
    }
}

/// Multiplies the strength of each bond by a random factor of its distribution, in the order of the
/// bonds' pairs.
fn scatter_strengths<'a>(bonds: impl Iterator<Item = (&'a mut Bond, scene::Scatter)>, seed: u64) {
    // a separate stream: the packing uses the default stream of the seed
    let mut rng = Pcg64::new(u128::from(seed), SCATTER_STREAM);
    let mut share = || loop {
        let share = rng.random::<f64>();
        if share > 0.0 {
            break share;
        }
    };
    for (bond, scatter) in bonds {
        bond.strength *= match scatter {
            scene::Scatter::Weibull { modulus } => (-share().ln()).powf(1.0 / modulus),
            scene::Scatter::Normal { deviation } => loop {
                // Box & Muller 1958
                let normal = (-2.0 * share().ln()).sqrt() * (2.0 * PI * share()).cos();
                let factor = 1.0 + deviation * normal;
                if factor > 0.0 {
                    break factor;
                }
            },
        };
    }
}

/// Stiffness of a bond of mean diameter `a` (m). A bar of length a and width a, either round or of
/// thickness t, has the axial stiffness E A/a, the shear stiffness G A/a and the bending stiffness
/// E I/a; a round bar has the twist stiffness G 2I/a.
fn bond_stiffness<D: Dim>(stiffness: scene::Stiffness, a: f64, thickness: f64) -> bond::Stiffness {
    match stiffness {
        scene::Stiffness::Springs(scene::Springs { normal, tangential, rolling, twist }) => {
            bond::Stiffness { normal, tangential, rolling, twist: twist.unwrap_or_default() }
        }
        scene::Stiffness::Young(scene::Young { modulus, poisson_ratio }) => {
            let (area, second_moment) = match D::N {
                2 => (a * thickness, thickness * a.powi(3) / 12.0),
                _ => (0.25 * PI * a * a, PI * a.powi(4) / 64.0),
            };
            let normal = modulus * area / a;
            let tangential = normal / (2.0 * (1.0 + poisson_ratio));
            let rolling = modulus * second_moment / a;
            bond::Stiffness { normal, tangential, rolling, twist: rolling / (1.0 + poisson_ratio) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::tests::config;
    use dem_core::body::{Grain, Load};
    use dem_core::bond::Rupture;
    use dem_core::dim::{D2, D3Twist};
    use dem_core::world::{Settings, World};
    use std::sync::Arc;

    fn assert_near(found: bond::Stiffness, expected: [f64; 4]) {
        for (found, expected) in [found.normal, found.tangential, found.rolling, found.twist].into_iter().zip(expected)
        {
            assert!((found / expected - 1.0).abs() < 1e-14, "{found} against {expected}");
        }
    }

    fn scattered(scatter: scene::Scatter, count: u32, seed: u64) -> Vec<f64> {
        let grains = (0..count + 1).map(|k| Grain::<D2>::at_rest([f64::from(k), 0.0].into(), 0.5, 1.0)).collect();
        let mut world = World::new(grains, vec![], vec![], Settings::default());
        world.form_bonds(1e-6, |_| 10.0, 0.3);
        scatter_strengths(world.bonds.iter_mut().map(|bond| (bond, scatter)), seed);
        world.bonds.iter().map(|bond| bond.strength).collect()
    }

    /// The largest distance of an empirical distribution from a given one (Kolmogorov & Smirnov).
    fn distance(mut values: Vec<f64>, below: impl Fn(f64) -> f64) -> f64 {
        values.sort_by(f64::total_cmp);
        let count = values.len() as f64;
        let apart = |(k, value): (usize, &f64)| {
            let (low, high, exact) = (k as f64 / count, (k + 1) as f64 / count, below(*value));
            (exact - low).abs().max((high - exact).abs())
        };
        values.iter().enumerate().map(apart).fold(0.0, f64::max)
    }

    /// The load (N) at which a chain of bonds of these strengths breaks, from a run.
    fn pulled_apart(strengths: &[f64]) -> f64 {
        let count = strengths.len();
        let mut grains: Grains<D2> = (0..=count).map(|k| Grain::at_rest([k as f64, 0.0].into(), 0.5, 1.0)).collect();
        grains.fixed[0] = true;
        // 1 N/s on the last grain
        let pull = Load { grain: count, force: [1.0, 0.0].into(), torque: Vect::zero(), factor: Arc::new(|t| t) };
        let settings = Settings { rupture: Rupture::NextEvent { until: 1e3 }, ..Settings::default() };
        let mut world = World::new(grains, vec![], vec![pull], settings);
        world.form_bonds(1e-6, |_| 1.0, 0.3);
        world.bonds.iter_mut().zip(strengths).for_each(|(bond, strength)| bond.strength = *strength);
        let report = world.step().expect("a step");
        assert_eq!(report.breaks.len(), 1);
        world.load_time
    }

    #[test]
    fn weibull_chains_break_as_their_weakest_bonds_which_have_a_weibull_distribution_too() {
        // 1,000 chains of 20 bonds: weakest links of scale σ₀ N^(−1/m)
        let (modulus, links, chains) = (5.0, 20, 1000);
        let strength = |seed: u64| {
            let bonds = scattered(scene::Scatter::Weibull { modulus }, links, seed);
            let (load, weakest) = (pulled_apart(&bonds), bonds.into_iter().fold(f64::INFINITY, f64::min));
            assert!((load / weakest - 1.0).abs() < 1e-6, "{load} N, the weakest bond bears {weakest} N");
            load
        };
        let scale = 10.0 * f64::from(links).powf(-1.0 / modulus);
        let off = distance((0..chains).map(strength).collect(), |s| 1.0 - (-(s / scale).powf(modulus)).exp());
        // a sample of the distribution exceeds this distance with probability 1/1000
        assert!(off < 1.95 / (chains as f64).sqrt(), "{off}");
    }

    #[test]
    fn normal_strengths_have_their_mean_and_deviation() {
        let bonds = scattered(scene::Scatter::Normal { deviation: 0.2 }, 10_000, 3);
        let mean = bonds.iter().sum::<f64>() / bonds.len() as f64;
        let variance = bonds.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / bonds.len() as f64;
        assert!((mean - 10.0).abs() < 0.08 && (variance.sqrt() - 2.0).abs() < 0.06, "{mean} {variance}");
        assert!(bonds.iter().all(|s| *s > 0.0));
        // the same seed gives the same bonds, another seed others
        assert_eq!(bonds, scattered(scene::Scatter::Normal { deviation: 0.2 }, 10_000, 3));
        assert_ne!(bonds, scattered(scene::Scatter::Normal { deviation: 0.2 }, 10_000, 4));
    }

    #[test]
    fn a_run_that_ends_before_its_bonds_form_is_told_so() {
        let why = why_none(&config("staged-biaxial.json", &[])).expect("a scene with bonds");
        assert_eq!(why, "the stage that forms them did not begin");
        assert_eq!(why_none(&config("column.json", &[])), None);
    }

    #[test]
    fn a_bond_is_as_stiff_as_a_bar_of_its_size() {
        let (young, poisson, a, thickness) = (2e9, 0.25, 4e-3, 0.01);
        let shear = young / (2.0 * (1.0 + poisson));
        let bar = scene::Stiffness::Young(scene::Young { modulus: young, poisson_ratio: poisson });
        // round: A = π a²/4, I = π a⁴/64 and the polar J = π a⁴/32
        let round =
            [young * PI * a / 4.0, shear * PI * a / 4.0, young * PI * a.powi(3) / 64.0, shear * PI * a.powi(3) / 32.0];
        assert_near(bond_stiffness::<D3Twist>(bar, a, 1.0), round);
        // a square plate: A = a t, I = t a³/12; no twist in 2D
        let plate = bond_stiffness::<D2>(bar, a, thickness);
        let expected = [young * thickness, shear * thickness, young * thickness * a * a / 12.0];
        assert_near(bond::Stiffness { twist: 1.0, ..plate }, [expected[0], expected[1], expected[2], 1.0]);
        // springs of the scene do not depend on the diameter
        let springs = scene::Springs { normal: 1.0, tangential: 2.0, rolling: 3.0, twist: Some(4.0) };
        assert_near(bond_stiffness::<D3Twist>(scene::Stiffness::Springs(springs), a, 1.0), [1.0, 2.0, 3.0, 4.0]);
    }
}
