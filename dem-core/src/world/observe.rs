//! Measures of a world: kinetic energy, momentum, mean stress and strain.

use super::{Momentum, Touch, World};
use crate::dim::{Dim, Vect};
use nalgebra::{DMatrix, SymmetricEigen};

/// Share of the spread of the grains over all directions below which they have no extent in one.
const FLAT: f64 = 1e-12;

impl<D: Dim> World<D> {
    /// Kinetic energy of grains and force-driven walls (J).
    pub fn kinetic_energy(&self) -> f64 {
        let g = &self.grains;
        let mut sum = 0.0;
        for k in (0..g.len()).filter(|k| !g.fixed[*k]) {
            sum += g.mass[k] * g.velocity[k].dot(&g.velocity[k]) + g.inertia[k] * g.spin[k].dot(&g.spin[k]);
        }
        for wall in &self.walls {
            if let Some((_, mass)) = wall.free_direction() {
                let velocity = wall.driven_part(wall.velocity);
                sum += mass * velocity.dot(&velocity);
            }
        }
        0.5 * sum
    }

    /// Linear and angular momentum of the grains.
    pub fn momentum(&self) -> Momentum<D> {
        let g = &self.grains;
        let mut sum = Momentum { linear: D::Vector::zero(), angular: D::Spin::zero() };
        for k in (0..g.len()).filter(|k| !g.fixed[*k]) {
            let linear = g.velocity[k] * g.mass[k];
            sum.linear += linear;
            sum.angular += D::torque(g.position[k], linear) + g.spin[k] * g.inertia[k];
        }
        sum
    }

    /// Mean stress σ = (1/V) Σ ℓ ⊗ f over the contacts of the last step, or of the last part of it
    /// (Pa, D × D row by row; compression positive), after Love and Weber. ℓ joins the centres, or
    /// at a wall the contact point to the centre, or under a membrane the point of the grain where
    /// its push acts to the centre; V is the box around the sample at time zero. A wall that holds
    /// a grain exerts on it the opposite of what its contacts do.
    pub fn stress(&self) -> Vec<f64> {
        let mut sum = vec![0.0; D::N * D::N];
        let mut add = |branch: D::Vector, force: D::Vector| {
            for row in 0..D::N {
                for col in 0..D::N {
                    sum[row * D::N + col] += branch[row] * force[col];
                }
            }
        };
        let mut on_held = vec![D::Vector::zero(); self.held.len()];
        for touch in self.touches() {
            let force = D::compose(&touch.frame, touch.reaction.n, touch.reaction.t);
            add(self.branch(&touch), force);
            for (k, force) in touch.pair.into_iter().zip([force, -force]) {
                if let Some(sum) = on_held.get_mut(k as usize) {
                    *sum += force;
                }
            }
        }
        for (k, (wall, force)) in self.held.iter().zip(on_held).enumerate() {
            let Some(wall) = wall else { continue };
            let (gap, normal, _) = self.geometry(&self.mid, [k as u32, self.grains.len() as u32 + wall]);
            add(normal * (self.grains.radius[k] + 0.5 * gap), -force);
        }
        let pressure = self.membrane.as_ref().map_or(0.0, |membrane| membrane.applied);
        for (grain, force) in self.membrane_forces(pressure) {
            let size = force.norm();
            for row in (0..D::N).filter(|_| size > 0.0) {
                for col in 0..D::N {
                    sum[row * D::N + col] += self.grains.radius[grain] / size * force[row] * force[col];
                }
            }
        }
        let volume = self.reference_volume();
        sum.iter_mut().for_each(|s| *s /= volume);
        sum
    }

    /// Contacts of the last accepted step, or of the last part of it, sorted by pair, with their
    /// reactions. Gaps and points are those of mid-step, with the present radii and shapes of the
    /// bodies.
    pub fn touches(&self) -> impl ExactSizeIterator<Item = Touch<D>> {
        self.stored.iter().map(|stored| self.touch(&self.mid, stored))
    }

    fn branch(&self, touch: &Touch<D>) -> D::Vector {
        let [i, j] = touch.pair.map(|k| k as usize);
        let radius = self.grains.radius[i] + self.grains.radius.get(j).map_or(-0.5 * touch.gap, |r| *r);
        D::normal(&touch.frame) * (radius + touch.gap)
    }

    /// Strain of the sample: the displacement gradient E of the affine fit u ≈ a + E x to the
    /// displacements of all grains since time zero (–, D × D row by row; elongation positive). It
    /// is zero across a direction in which the grains have no extent: a row, or a layer of grains.
    pub fn strain(&self) -> Vec<f64> {
        let n = self.grains.len() as f64;
        let mean =
            |points: &mut dyn Iterator<Item = D::Vector>| points.fold(D::Vector::zero(), |a, b| a + b) * (1.0 / n);
        let centre = mean(&mut self.reference.iter().copied());
        let moved = |k: usize| self.grains.position[k] - self.reference[k];
        let drift = mean(&mut (0..self.grains.len()).map(moved));
        // normal equations E S = U, S = Σ x xᵀ, U = Σ u xᵀ
        let mut s = DMatrix::<f64>::zeros(D::N, D::N);
        let mut u = DMatrix::<f64>::zeros(D::N, D::N);
        for k in 0..self.grains.len() {
            let (x, d) = (self.reference[k] - centre, moved(k) - drift);
            for row in 0..D::N {
                for col in 0..D::N {
                    s[(row, col)] += x[row] * x[col];
                    u[(row, col)] += d[row] * x[col];
                }
            }
        }
        let spread = s.trace();
        // S is symmetric: E = (S⁻¹ Uᵀ)ᵀ, whose column-major storage of the transpose is E row by
        // row
        match s.clone().cholesky() {
            Some(factor) if factor.l().diagonal().iter().all(|d| d * d > FLAT * spread) => {
                factor.solve(&u.transpose()).as_slice().to_vec()
            }
            // the least gradient of those that fit
            _ => {
                let SymmetricEigen { eigenvalues, eigenvectors } = s.symmetric_eigen();
                let kept = eigenvalues.map(|value| if value > FLAT * spread { 1.0 / value } else { 0.0 });
                let inverse = &eigenvectors * DMatrix::from_diagonal(&kept) * eigenvectors.transpose();
                (inverse * u.transpose()).as_slice().to_vec()
            }
        }
    }
}
