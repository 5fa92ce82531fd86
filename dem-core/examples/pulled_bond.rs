//! Two bonded spheres are pulled apart by a force that grows with time: the bond carries it without
//! moving and breaks where the force reaches its strength of 10 N.
//!
//! `cargo run --release -p dem-core --example pulled_bond`

use dem_core::prelude::*;
use std::sync::Arc;

fn main() -> Result<(), StepError> {
    let (radius, density) = (1e-3, 2500.0);
    let mut held = Grain::<D3>::at_rest([0.0, 0.0, 0.0].into(), radius, density);
    held.fixed = true;
    let pulled = Grain::at_rest([2.0 * radius, 0.0, 0.0].into(), radius, density);
    // 100 N/s along x
    let (force, torque) = ([1.0, 0.0, 0.0].into(), Vect::zero());
    let load = Load { grain: 1, force, torque, factor: Arc::new(|t| 100.0 * t) };
    let settings = Settings { step: 1e-4, ..Settings::default() };
    let mut world = World::new([held, pulled].into_iter().collect(), vec![], vec![load], settings);
    // pairs nearer than a thousandth of their mean diameter, 10 N each, friction 0.3
    world.form_bonds(1e-3, |_mean_diameter| 10.0, 0.3);

    while world.bonds[0].status == BondStatus::Intact {
        let report = world.step()?;
        for broken in &report.breaks {
            println!(
                "t = {:.4} s: the bond breaks in {:?} under {:.3} N",
                report.time, broken.mode, -broken.reaction.n
            );
        }
    }
    // the load of a step is taken at mid-step
    assert!((world.time - 0.1).abs() <= 1.5e-4);
    Ok(())
}
