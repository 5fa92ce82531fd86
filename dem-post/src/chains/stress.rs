//! The stress in a grain, and its principal values.

use dem_history::{ContactRows, History};

use crate::extent::volume;
use crate::output::Result;

/// A symmetric 2 × 2 or 3 × 3 tensor, by rows; in 2D the third row and column are zero.
pub type Tensor = [[f64; 3]; 3];

/// Mean stress in each grain from the forces on it (Love 1927, Weber 1966), Pa, positive in
/// compression:
///
/// σ = −(1/V) Σ f ⊗ (p − x)
///
/// over its contacts, with the force f on the grain at the point p, its centre x and its volume V
/// (in 2D the area times `thickness`). Where bonds carry moments, forces alone do not balance the
/// torque: the symmetric part is taken.
pub fn grain_stress(
    contacts: &ContactRows,
    position: &[f64],
    radius: &[f64],
    dimension: usize,
    thickness: f64,
) -> Vec<Tensor> {
    let d = dimension;
    let mut stress = vec![[[0.0; 3]; 3]; radius.len()];
    for c in 0..contacts.len() {
        let force = force(contacts, c, d);
        let point = &contacts.point[c * d..(c + 1) * d];
        for (grain, sign) in [(contacts.pair[c][0], 1.0), (contacts.pair[c][1], -1.0)] {
            // a wall has no stress
            let Ok(grain) = usize::try_from(grain) else {
                continue;
            };
            let arm = |k: usize| if k < d { point[k] - position[grain * d + k] } else { 0.0 };
            let volume = volume(d, radius[grain]) * if d == 2 { thickness } else { 1.0 };
            for (a, row) in stress[grain].iter_mut().enumerate() {
                for (b, entry) in row.iter_mut().enumerate() {
                    *entry -= sign * 0.5 * (force[a] * arm(b) + force[b] * arm(a)) / volume;
                }
            }
        }
    }
    stress
}

/// The force of contact `c` on its first body, N, in the axes of the scene.
fn force(contacts: &ContactRows, c: usize, d: usize) -> [f64; 3] {
    let vector = |all: &[f64]| {
        let mut v = [0.0; 3];
        v[..d].copy_from_slice(&all[c * d..(c + 1) * d]);
        v
    };
    let rows = contacts.reaction_rows();
    let reaction = &contacts.reaction[c * rows..(c + 1) * rows];
    let n = vector(&contacts.normal);
    let mut force = n.map(|x| reaction[0] * x);
    if rows > 1 {
        let t1 = if d == 2 { [-n[1], n[0], 0.0] } else { vector(&contacts.tangent) };
        let t2 = [n[1] * t1[2] - n[2] * t1[1], n[2] * t1[0] - n[0] * t1[2], n[0] * t1[1] - n[1] * t1[0]];
        for k in 0..3 {
            force[k] += reaction[1] * t1[k] + reaction.get(2).map_or(0.0, |r| r * t2[k]);
        }
    }
    force
}

/// The greatest principal value of a symmetric tensor and its unit direction, by Jacobi's
/// rotations.
///
/// For a repeated value the direction is one of the possible ones.
pub fn major(tensor: &Tensor, dimension: usize) -> (f64, [f64; 3]) {
    let (mut a, mut v) = (*tensor, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = 0.5 * (2.0 * a[p][q]).atan2(a[q][q] - a[p][p]);
            let (sin, cos) = theta.sin_cos();
            for row in &mut a {
                (row[p], row[q]) = (cos * row[p] - sin * row[q], sin * row[p] + cos * row[q]);
            }
            for k in 0..3 {
                (a[p][k], a[q][k]) = (cos * a[p][k] - sin * a[q][k], sin * a[p][k] + cos * a[q][k]);
            }
            for row in &mut v {
                (row[p], row[q]) = (cos * row[p] - sin * row[q], sin * row[p] + cos * row[q]);
            }
        }
    }
    // in 2D the third value is no stress of the grain
    let best = (0..dimension).max_by(|&i, &j| a[i][i].total_cmp(&a[j][j])).unwrap_or(0);
    (a[best][best], [v[0][best], v[1][best], v[2][best]])
}

/// The scene's thickness in 2D, m; 1 where it gives none.
///
/// # Errors
/// Those of reading the history.
pub fn thickness(history: &History) -> Result<f64> {
    let scene = history.parameters()?.scene;
    let scene: serde_json::Value = serde_json::from_str(&scene).unwrap_or_default();
    Ok(scene.get("thickness").and_then(serde_json::Value::as_f64).filter(|t| *t > 0.0).unwrap_or(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_pressed_between_two_points_has_the_stress_of_the_textbook() {
        // two forces of 3 N at the ends of a diameter along x: σ_xx = F d / V = 3 · 2 / (π · 0.5)
        let contacts = ContactRows {
            pair: vec![[0, -1], [0, -2]],
            point: vec![-1.0, 0.0, 1.0, 0.0],
            normal: vec![1.0, 0.0, -1.0, 0.0],
            reaction: vec![3.0, 0.0, 3.0, 0.0],
            ..ContactRows::default()
        };
        let stress = grain_stress(&contacts, &[0.0, 0.0], &[1.0], 2, 0.5)[0];
        assert!((stress[0][0] - 6.0 / (0.5 * std::f64::consts::PI)).abs() < 1e-14);
        assert_eq!((stress[0][1], stress[1][1]), (0.0, 0.0));
    }

    #[test]
    fn a_sphere_under_pressure_has_that_pressure() {
        // forces of 2 N inwards at the six poles of a sphere of radius 1: pressure = Σ f r / 3V
        let poles = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let points: Vec<[f64; 3]> = poles.iter().flat_map(|p| [*p, p.map(|x| -x)]).collect();
        let contacts = ContactRows {
            pair: vec![[0, -1]; 6],
            point: points.concat(),
            normal: points.iter().flat_map(|p| p.map(|x| -x)).collect(),
            tangent: points.iter().flat_map(|p| [p[1], p[2], p[0]]).collect(),
            reaction: [2.0, 0.0, 0.0].repeat(6),
            ..ContactRows::default()
        };
        let stress = grain_stress(&contacts, &[0.0; 3], &[1.0], 3, 1.0)[0];
        let pressure = 4.0 / (4.0 / 3.0 * std::f64::consts::PI);
        assert!((0..3).all(|k| (stress[k][k] - pressure).abs() < 1e-14 && stress[k][(k + 1) % 3] == 0.0));
    }

    #[test]
    fn principal_values_of_a_turned_tensor_are_its_own() {
        // values 5, 2, −1 along an orthonormal frame
        let frame =
            [[2.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0], [-2.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0], [1.0 / 3.0, -2.0 / 3.0, 2.0 / 3.0]];
        let mut tensor = [[0.0; 3]; 3];
        for (value, e) in [2.0, 5.0, -1.0].into_iter().zip(frame) {
            for a in 0..3 {
                for b in 0..3 {
                    tensor[a][b] += value * e[a] * e[b];
                }
            }
        }
        let (value, direction) = major(&tensor, 3);
        assert!((value - 5.0).abs() < 1e-12);
        let along: f64 = direction.iter().zip(frame[1]).map(|(a, b)| a * b).sum();
        assert!((along.abs() - 1.0).abs() < 1e-12);
        let (value, direction) = major(&[[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0; 3]], 2);
        assert!((value - 3.0).abs() < 1e-12 && (direction[0] - direction[1]).abs() < 1e-12);
        // all in tension: the zero of the third axis is not among the values in 2D
        assert_eq!(major(&[[-1.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.0; 3]], 2).0, -1.0);
    }
}
