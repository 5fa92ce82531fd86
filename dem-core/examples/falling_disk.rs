//! A disk falls from 10 cm on a floor, bounces with a restitution of 0.5 and comes to rest: height
//! and energy over time.
//!
//! `cargo run --release -p dem-core --example falling_disk`

use dem_core::prelude::*;

fn main() -> Result<(), StepError> {
    let disk = Grain::at_rest([0.0, 0.11].into(), 0.01, 25.0);
    let floor = Wall::fixed(Shape::Plane { normal: [0.0, 1.0].into() }, [0.0, 0.0].into(), 0.5);
    let settings = Settings {
        step: 1e-3,
        gravity: Some([0.0, -9.81].into()),
        restitution: Some(Restitution { grain_grain: 0.0, grain_wall: 0.5, threshold_speed: 0.01 }),
        ..Settings::default()
    };
    let mut world = World::<D2>::new([disk].into_iter().collect(), vec![floor], vec![], settings);
    println!("time (s)  height (m)  kinetic (J)  lost in impacts (J)  force on the floor (N)");
    for step in 1..=500 {
        world.step()?;
        if step % 20 == 0 {
            let (height, ledger) = (world.grains.position[0][1], world.ledger);
            let force = world.walls[0].reaction[1];
            println!(
                "{:8.3}  {height:10.5}  {:11.3e}  {:19.3e}  {force:22.4}",
                world.time, ledger.kinetic, ledger.impact
            );
        }
    }
    // at rest the floor carries the weight of the disk
    let weight = world.grains.mass[0] * 9.81;
    assert!((world.walls[0].reaction[1] / weight + 1.0).abs() < 1e-6);
    Ok(())
}
