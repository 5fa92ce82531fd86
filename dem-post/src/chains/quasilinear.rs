//! Force chains as lines of grains, after J. F. Peters, M. Muthuswamy, J. Wibowo and A.
//! Tordesillas, *Characterization of force chains in granular material*, Phys. Rev. E 72, 041307
//! (2005).
//!
//! 1. The **load** of a grain is the greatest principal value of its mean stress, positive in
//!    compression ([`super::stress`]); its **direction** is the axis of that value.
//! 2. Only grains whose load exceeds the mean load take part. The mean is over all grains with a
//!    positive load.
//! 3. Two such grains in contact under compression are **linked** if the line between their centres
//!    is within 45° of the directions of both.
//! 4. A **chain** is a line of at least three linked grains.
//!
//! The paper searches from grain to grain. Here each grain has two ends, one on either side of its
//! direction, with at most one link each. Links are accepted in the order of their normal force,
//! the greatest first, if both ends are still free. So chains share no grain and do not depend on
//! the start of a search; at a fork a chain follows the greater force. A closed ring is possible;
//! it is reported as a chain that begins at its first grain.
//!
//! Chains in **tension** are defined alike, with all signs reversed.

use dem_history::ContactRows;
use serde::Serialize;

use super::stress::{Tensor, major};

/// Cosine of the greatest angle between a chain and the direction of a grain: 45°.
const COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Least number of grains.
const LEAST: usize = 3;

/// The sign of the stress in a chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Pressed grains.
    Compression,
    /// Pulled grains.
    Tension,
}

impl Kind {
    /// 1 in compression, −1 in tension.
    pub fn sign(self) -> f64 {
        if self == Self::Compression { 1.0 } else { -1.0 }
    }

    /// Its name.
    pub fn label(self) -> &'static str {
        if self == Self::Compression { "compression" } else { "tension" }
    }
}

/// The chains of one kind at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Chains {
    /// Which.
    pub kind: Kind,
    /// The grains of each chain in order, the longest chain first.
    pub chains: Vec<Vec<usize>>,
    /// Load of each grain, Pa; of either sign.
    pub load: Vec<f64>,
    /// Unit direction of each grain.
    pub direction: Vec<[f64; 3]>,
    /// Mean load of the grains whose load is positive, Pa.
    pub mean: f64,
    /// Share of the links of chains in the sum of normal forces of this kind, walls included.
    pub share: f64,
}

/// A candidate for a link.
struct LinkCandidate {
    grains: [usize; 2],
    /// The end of each grain: 0 against its direction, 1 along it.
    ends: [usize; 2],
    force: f64,
}

/// Finds the chains of one kind among grains with centres `position` (m, N × D) and stresses
/// `stress` (Pa).
pub fn find(kind: Kind, contacts: &ContactRows, position: &[f64], stress: &[Tensor], dimension: usize) -> Chains {
    let signed = |tensor: &Tensor| tensor.map(|row| row.map(|x| kind.sign() * x));
    let (load, direction): (Vec<f64>, Vec<[f64; 3]>) =
        stress.iter().map(|tensor| major(&signed(tensor), dimension)).unzip();
    let loaded: Vec<f64> = load.iter().copied().filter(|&load| load > 0.0).collect();
    let mean = if loaded.is_empty() { 0.0 } else { loaded.iter().sum::<f64>() / loaded.len() as f64 };
    let mut links = vec![];
    let mut all = 0.0;
    for c in 0..contacts.len() {
        let force = kind.sign() * contacts.normal_force(c);
        all += force.max(0.0);
        let [Ok(i), Ok(j)] = contacts.pair[c].map(usize::try_from) else {
            continue;
        };
        if force > 0.0 && load[i] > mean && load[j] > mean {
            links.extend(link([i, j], force, position, &direction, dimension));
        }
    }
    // a stable sort: equal forces keep the order of the contacts
    links.sort_by(|a, b| b.force.total_cmp(&a.force));
    let mut next: Vec<[Option<(usize, f64)>; 2]> = vec![[None; 2]; load.len()];
    for LinkCandidate { grains: [i, j], ends: [a, b], force } in links {
        if next[i][a].is_none() && next[j][b].is_none() {
            (next[i][a], next[j][b]) = (Some((j, force)), Some((i, force)));
        }
    }
    let mut chains = lines(&next);
    chains.retain(|chain| chain.len() >= LEAST);
    // a stable sort: chains of equal length keep the order of their first grains
    chains.sort_by_key(|chain| std::cmp::Reverse(chain.len()));
    let carried: f64 =
        chains.iter().flatten().flat_map(|&grain| next[grain]).flatten().map(|(_, force)| 0.5 * force).sum();
    Chains { kind, chains, load, direction, mean, share: if carried > 0.0 { carried / all } else { 0.0 } }
}

fn link(grains: [usize; 2], force: f64, position: &[f64], direction: &[[f64; 3]], d: usize) -> Option<LinkCandidate> {
    let centre = |grain: usize| &position[grain * d..(grain + 1) * d];
    let branch: Vec<f64> = centre(grains[1]).iter().zip(centre(grains[0])).map(|(b, a)| b - a).collect();
    let length = branch.iter().map(|x| x * x).sum::<f64>().sqrt();
    let along = |grain: usize| branch.iter().zip(direction[grain]).map(|(b, e)| b * e).sum::<f64>() / length;
    let [from, to] = grains.map(along);
    // the branch leaves the first grain and enters the second
    let ends = [usize::from(from > 0.0), usize::from(to < 0.0)];
    (from.abs() >= COSINE && to.abs() >= COSINE).then_some(LinkCandidate { grains, ends, force })
}

/// The lines formed by the links of the grains; a ring is cut open at its first grain.
fn lines(next: &[[Option<(usize, f64)>; 2]]) -> Vec<Vec<usize>> {
    let mut seen = vec![false; next.len()];
    let mut lines = vec![];
    let is_end = |grain: &usize| next[*grain].iter().flatten().count() == 1;
    // open lines first; the remaining ones are rings
    let ends = (0..next.len()).filter(is_end);
    let rest = (0..next.len()).filter(|grain| next[*grain].iter().flatten().count() == 2);
    for start in ends.chain(rest) {
        let mut line = vec![];
        let mut grain = Some(start);
        while let Some(at) = grain.filter(|&at| !seen[at]) {
            seen[at] = true;
            line.push(at);
            grain = next[at].iter().flatten().map(|(other, _)| *other).find(|&other| !seen[other]);
        }
        if !line.is_empty() {
            lines.push(line);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::super::stress::grain_stress;
    use super::*;

    /// Disks of radius 1 at `centres`; forces `(i, j, N)` along the lines between them, and on
    /// walls at the two ends.
    fn chains_of(
        kind: Kind,
        centres: &[[f64; 2]],
        forces: &[(usize, usize, f64)],
        ends: &[(usize, [f64; 2], f64)],
    ) -> Chains {
        let mut contacts = ContactRows::default();
        for &(i, j, force) in forces {
            let (a, b) = (centres[i], centres[j]);
            let length = (a[0] - b[0]).hypot(a[1] - b[1]);
            contacts.pair.push([i as i32, j as i32]);
            contacts.normal.extend([(a[0] - b[0]) / length, (a[1] - b[1]) / length]);
            contacts.point.extend([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]);
            contacts.reaction.extend([force, 0.0]);
        }
        for &(i, normal, force) in ends {
            contacts.pair.push([i as i32, -1]);
            contacts.normal.extend(normal);
            contacts.point.extend([centres[i][0] - normal[0], centres[i][1] - normal[1]]);
            contacts.reaction.extend([force, 0.0]);
        }
        let position = centres.concat();
        let stress = grain_stress(&contacts, &position, &vec![1.0; centres.len()], 2, 1.0);
        find(kind, &contacts, &position, &stress, 2)
    }

    /// A line of five disks, and five nearly unloaded disks beside it, so that the mean is below
    /// the load of the line.
    fn row(turn_after: usize, degrees: f64) -> Vec<[f64; 2]> {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let mut centres = vec![[0.0, 0.0]];
        for k in 1..5 {
            let [x, y]: [f64; 2] = centres[k - 1];
            let way = if k > turn_after { [2.0 * cos, 2.0 * sin] } else { [2.0, 0.0] };
            centres.push([x + way[0], y + way[1]]);
        }
        centres.extend((0..5).map(|k| [50.0 + 9.0 * f64::from(k), 0.0]));
        centres
    }

    fn pressed(turn_after: usize, degrees: f64, force: f64, kind: Kind) -> Chains {
        let centres = row(turn_after, degrees);
        let links: Vec<_> = (0..4).map(|k| (k, k + 1, force)).collect();
        let (sin, cos) = degrees.to_radians().sin_cos();
        let mut ends = vec![(0, [1.0, 0.0], force), (4, [-cos, -sin], force)];
        ends.extend((5..10).map(|grain| (grain, [1.0, 0.0], 0.01 * force)));
        chains_of(kind, &centres, &links, &ends)
    }

    #[test]
    fn a_straight_row_is_one_chain() {
        let found = pressed(9, 0.0, 7.0, Kind::Compression);
        assert_eq!(found.chains, [vec![0, 1, 2, 3, 4]]);
        // four links of six contacts that carry F, and five that carry 0.01 F
        assert!((found.share - 4.0 / 6.05).abs() < 1e-12);
        assert!((found.load[2] - 14.0 / std::f64::consts::PI).abs() < 1e-12);
        assert!(found.direction[2][0].abs() > 1.0 - 1e-12);
        // pressed grains form no chain in tension
        assert!(pressed(9, 0.0, 7.0, Kind::Tension).chains.is_empty());
    }

    #[test]
    fn a_row_that_pulls_is_a_chain_in_tension() {
        assert_eq!(pressed(9, 0.0, -7.0, Kind::Tension).chains, [vec![0, 1, 2, 3, 4]]);
        assert!(pressed(9, 0.0, -7.0, Kind::Compression).chains.is_empty());
    }

    #[test]
    fn a_gentle_bend_goes_on_and_a_sharp_one_breaks() {
        // at the bend the direction lies halfway between the branches: within 45° of both up to a
        // right angle
        for degrees in [30.0, 60.0, 80.0] {
            assert_eq!(pressed(2, degrees, 7.0, Kind::Compression).chains, [vec![0, 1, 2, 3, 4]]);
        }
        // beyond, both branches lie on one side of the direction: one of them is linked, and two
        // grains are too few
        assert_eq!(pressed(2, 100.0, 7.0, Kind::Compression).chains, [vec![0, 1, 2]]);
    }

    #[test]
    fn a_neighbour_at_sixty_degrees_to_the_load_is_not_linked() {
        // a pressed row along x; its last grain leans on one at 60°, whose own load is along that
        // branch
        let s = 3f64.sqrt();
        let centres = [[0.0, 0.0], [2.0, 0.0], [4.0, 0.0], [5.0, s], [6.0, 2.0 * s], [50.0, 0.0]];
        let forces = [(0, 1, 10.0), (1, 2, 10.0), (2, 3, 4.0), (3, 4, 4.0)];
        let ends = [(0, [1.0, 0.0], 10.0), (2, [-1.0, 0.0], 10.0), (4, [-0.5, -0.5 * s], 4.0), (5, [1.0, 0.0], 0.1)];
        let found = chains_of(Kind::Compression, &centres, &forces, &ends);
        assert_eq!(found.chains, [vec![0, 1, 2]]);
    }

    #[test]
    fn a_fork_follows_the_greater_force() {
        // from grain 2 two branches at ±30°, the upper one stronger; the lower one is a line of its
        // own
        let (c, s) = (3f64.sqrt(), 1.0);
        let centres = [
            [0.0, 0.0],
            [2.0, 0.0],
            [4.0, 0.0],
            [4.0 + c, s],
            [4.0 + 2.0 * c, 2.0 * s],
            [4.0 + c, -s],
            [4.0 + 2.0 * c, -2.0 * s],
            [50.0, 0.0],
        ];
        let forces = [(0, 1, 10.0), (1, 2, 10.0), (2, 3, 6.0), (3, 4, 6.0), (2, 5, 5.5), (5, 6, 5.5)];
        let ends = [
            (0, [1.0, 0.0], 10.0),
            (4, [-c / 2.0, -0.5], 6.0),
            (6, [-c / 2.0, 0.5], 5.5),
            (7, [1.0, 0.0], 0.1),
            (7, [-1.0, 0.0], 0.1),
        ];
        let found = chains_of(Kind::Compression, &centres, &forces, &ends);
        assert_eq!(found.chains.iter().flatten().filter(|&&grain| grain == 2).count(), 1);
        assert!(found.chains[0].starts_with(&[0, 1, 2]) || found.chains[0].ends_with(&[2, 1, 0]));
        assert!(!found.chains[0].contains(&5));
    }

    #[test]
    fn no_force_is_no_chain() {
        let found = chains_of(Kind::Compression, &[[0.0, 0.0], [2.0, 0.0]], &[], &[]);
        assert!(found.chains.is_empty());
        assert_eq!((found.mean, found.share), (0.0, 0.0));
    }
}
