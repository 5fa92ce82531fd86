//! Symmetric tensors of a sample: principal values, mean and deviator.

use nalgebra::{Matrix2, Matrix3};

/// The principal values of the symmetric part of a D × D tensor, row by row, the greatest first.
pub fn principal(tensor: &[f64], dimension: usize) -> Vec<f64> {
    let mut values: Vec<f64> = if dimension == 2 {
        let tensor = Matrix2::from_row_slice(tensor);
        (0.5 * (tensor + tensor.transpose())).symmetric_eigenvalues().iter().copied().collect()
    } else {
        let tensor = Matrix3::from_row_slice(tensor);
        (0.5 * (tensor + tensor.transpose())).symmetric_eigenvalues().iter().copied().collect()
    };
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

/// Mean p and deviator q of principal stresses: in 3D p = (σ₁ + σ₂ + σ₃)/3 and
/// q = √(½ [(σ₁ − σ₂)² + (σ₂ − σ₃)² + (σ₃ − σ₁)²]); in 2D p = (σ₁ + σ₂)/2 and q = (σ₁ − σ₂)/2, so
/// that sin φ = q/p where a cohesionless sample slips.
pub fn mean_and_deviator(principal: &[f64]) -> [f64; 2] {
    let mean = principal.iter().sum::<f64>() / principal.len() as f64;
    let deviator = match principal {
        [major, minor] => 0.5 * (major - minor),
        values => (0.5 * (0..3).map(|k| (values[k] - values[(k + 1) % 3]).powi(2)).sum::<f64>()).sqrt(),
    };
    [mean, deviator]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: &[f64], known: &[f64]) {
        assert_eq!(found.len(), known.len());
        assert!(found.iter().zip(known).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} is not {known:?}");
    }

    #[test]
    fn principal_values_are_those_of_the_turned_frame() {
        // σ = mean ± radius of the circle, with the mean of the two shear components
        close(&principal(&[5.0, 4.0, 2.0, -3.0], 2), &[6.0, -4.0]);
        // values 5, 2, −1 along the rows of a rotation
        let frame = Matrix3::new(2.0, 2.0, 1.0, -2.0, 1.0, 2.0, 1.0, -2.0, 2.0) / 3.0;
        let tensor = frame.transpose() * Matrix3::from_diagonal(&nalgebra::Vector3::new(2.0, 5.0, -1.0)) * frame;
        close(&principal(tensor.as_slice(), 3), &[5.0, 2.0, -1.0]);
    }

    #[test]
    fn deviators_are_those_of_the_textbook() {
        close(&mean_and_deviator(&[3.0, 1.0]), &[2.0, 1.0]);
        // triaxial compression: q = σ₁ − σ₃
        close(&mean_and_deviator(&[7.0, 1.0, 1.0]), &[3.0, 6.0]);
        // pure shear τ: q = √3 τ
        close(&mean_and_deviator(&[2.0, 0.0, -2.0]), &[0.0, 12f64.sqrt()]);
    }
}
