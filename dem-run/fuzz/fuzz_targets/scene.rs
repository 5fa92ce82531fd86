//! Any text is a scene or an error, never a panic.
//!
//! The input is a scene, followed by `--set` assignments, each after the byte 0x1e. From the
//! repository's root, for ten minutes, with the scenes in `configs` among the seeds:
//!
//! ```text
//! cd dem-run && mkdir -p fuzz/corpus/scene
//! cargo +nightly fuzz run scene fuzz/corpus/scene fuzz/seeds ../configs -- \
//!     -dict=fuzz/scene.dict -max_total_time=600
//! ```
#![no_main]

use dem_scene::{self as scene, Drive, Scene};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(input) = std::str::from_utf8(data) else { return };
    let mut parts = input.split('\u{1e}');
    let text = parts.next().unwrap_or_default();
    let assignments: Vec<String> = parts.map(String::from).collect();
    match scene::from_text("fuzz", text, &assignments) {
        Ok(scene) => check(&scene),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            for problem in error.problems() {
                assert!(!problem.found.is_empty() && !problem.allowed.is_empty(), "{error}");
            }
        }
    }
});

/// What holds for every scene that was accepted.
fn check(scene: &Scene) {
    assert!(scene::validate(scene).is_empty());
    // written as JSON and read again, it is the same scene
    let json = scene.to_json().expect("a scene that was read is Unicode");
    let again = scene::from_text("again", &json, &[]).expect("a scene that was written is right");
    assert_eq!(&again, scene);
    assert!(scene.time.steps() > 0 && scene.frames() > 1);
    for wall in scene.walls.values() {
        if let Drive::Velocity(function) | Drive::Force(function) = wall.drive() {
            assert!(wall.drive_direction().is_some());
            for t in [0.0, scene.time.step, scene.time.end] {
                assert!(function.at(t).is_finite());
            }
        }
    }
    if let Some(bonds) = &scene.bonds {
        let cohesion = bonds.cohesion(scene.dimension, 1e-3, scene.thickness());
        assert!(cohesion >= 0.0 && cohesion.is_finite());
    }
}
