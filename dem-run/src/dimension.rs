//! From the dimension of a scene to a type: the only place that chooses one.

/// Evaluate an expression with `$D` as the dimension of the scene, in 3D with a row for twist where
/// its bonds resist it.
#[macro_export]
macro_rules! in_dimension {
    ($scene:expr, $D:ident => $body:expr) => {
        match ($scene.dimension, $scene.twists()) {
            (2, _) => {
                type $D = dem_core::dim::D2;
                $body
            }
            (_, true) => {
                type $D = dem_core::dim::D3Twist;
                $body
            }
            (_, false) => {
                type $D = dem_core::dim::D3;
                $body
            }
        }
    };
}
