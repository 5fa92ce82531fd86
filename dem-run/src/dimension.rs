//! Selects the type for the dimension of a scene; no other code does.

/// Evaluates an expression with `$D` as the dimension of the scene; in 3D, `$D` has a twist row if
/// bonds resist twist.
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
