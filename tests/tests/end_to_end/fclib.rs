//! Problems in FCLIB's format: written by `dem-run export`, solved by `dem-run solve`, and the
//! collection in `problems`.

use crate::common::{Folder, SMALL, problems, run};
use dem_core::contact::LocalSolve;
use dem_core::problem::assembled::Assembled;
use dem_core::solver::assembled::gauss_seidel;
use dem_core::solver::{GaussSeidelSettings, SolveStatus, Staged, StagedSettings, Stages, Start, StiffnessRatio};
use dem_run::fclib::Problem;
use hdf5::File;
use serde_json::{Value, json};
use std::path::Path;

/// A history of cemented grains under a plate, and the problem of its step 300.
fn exported() -> Folder {
    let here = Folder::new();
    let newton = ["--set", r#"solver.kind={"newton":{}}"#, "--set", "solver.tolerance=1e-9", "--set", "time.end=0.04"];
    here.run_config("compression.json", &[&SMALL[..], &newton, &["-o", "a.h5", "--quiet"]].concat());
    let outcome = here.dem_run(&["export", "a.h5", "--step", "300", "-o", "a.hdf5", "--quiet"]).succeeds();
    assert!(outcome.stdout.contains("dem-run solve a.hdf5"), "{}", outcome.stdout);
    assert_eq!(outcome.stderr, "");
    here
}

#[test]
fn an_exported_problem_is_solved_by_both_solvers() {
    let here = exported();
    let problem = Problem::read(&here.path("a.hdf5")).expect("read");
    let mut at = problem.assembled.clone();
    at.r = problem.solution.expect("a solution");
    // the scene's solver solved it, by a residual of its own that should be the same
    assert!(at.residual() <= 2e-9, "{:e}", at.residual());
    for solver in ["interior", "newton", "gauss-seidel"] {
        let answer = here.dem_run(&["solve", "a.hdf5", "--solver", solver, "--json", "--force", "-o", "b.hdf5"]).json();
        assert_eq!((&answer["converged"], &answer["rows"]), (&true.into(), &3.into()));
        assert!(answer["residual"].as_f64().expect("residual") <= 1e-8);
        let written = Problem::read(&here.path("b.hdf5")).expect("read");
        assert_eq!(written.assembled, problem.assembled, "the problem itself");
        let mut at = written.assembled;
        at.r = written.solution.expect("a solution");
        assert!(at.residual() <= 1e-8);
    }
    let outcome = here.dem_run(&["solve", "a.hdf5", "--solver", "newton"]).succeeds();
    for part in ["status", "solved by the interior-point method", "residual", "Siconos's error", "CPU time"] {
        assert!(outcome.stdout.contains(part), "{part} in\n{}", outcome.stdout);
    }
    // the same file, byte for byte, however many threads
    let again = ["export", "a.h5", "--step", "300", "-o", "c.hdf5", "--quiet", "--threads", "1"];
    here.dem_run(&again).succeeds();
    assert_eq!(here.read("a.hdf5"), here.read("c.hdf5"));
}

/// A triangle of bonded disks whose load has gone again: cohesion alone gives velocities, which
/// cancel to round-off.
#[test]
fn a_problem_in_which_nothing_acts_any_more_is_solved() {
    let here = Folder::new();
    let grains: Vec<Value> = [[0.0, 0.0], [4e-3, 0.0], [2e-3, 0.0034641016151377543]]
        .iter()
        .map(|x| json!({ "center": x, "radius": 2e-3 }))
        .collect();
    let pulse = json!({ "table": [[0, 0], [0.005, 1], [0.01, 0]] });
    let scene = json!({
        "dimension": 2, "thickness": 0.01, "sample": { "grains": grains },
        "materials": { "density": 2500, "friction": { "grain_grain": 0.3, "grain_wall": 0.2 } },
        "bonds": { "strength": 10, "gap_tolerance": 1e-3 },
        "grains": { "fixed": [0], "loads": [{ "grain": 2, "force": [1, 0.3], "time": pulse }] },
        "time": { "step": 1e-4, "end": 0.011 }, "output": { "every_steps": 10 }
    });
    here.write("scene.json", scene.to_string());
    run(&here, "scene.json", &[]);
    here.dem_run(&["export", "a.h5", "--step", "102", "-o", "a.hdf5", "--quiet"]).succeeds();
    for solver in ["interior", "gauss-seidel"] {
        let answer = here.dem_run(&["solve", "a.hdf5", "--solver", solver, "--json", "--force", "-o", "b.hdf5"]).json();
        assert_eq!(answer["converged"], json!(true), "{answer}");
    }
}

#[test]
fn what_is_not_reached_is_exit_3_and_writes_nothing() {
    let here = exported();
    let few = ["solve", "a.hdf5", "--tolerance", "1e-14", "--max-iterations", "3", "-o", "b.hdf5"];
    let outcome = here.dem_run(&few).fails(3, &["a.hdf5", "residual", "--max-iterations", "--tolerance"]);
    assert!(outcome.stdout.contains("not solved"), "{}", outcome.stdout);
    assert_eq!(here.names(), ["a.h5", "a.hdf5"]);
}

/// Writes W anew: its kind, p, i and x.
fn store(path: &Path, nz: i32, p: &[i32], i: &[i32], x: &[f64]) {
    let file = File::open_rw(path).expect("open");
    let group = file.group("fclib_local/W").expect("W");
    for name in ["nz", "p", "i", "x", "nzmax"] {
        group.unlink(name).expect("unlink");
    }
    group.new_dataset_builder().with_data(&[nz]).create("nz").expect("nz");
    group.new_dataset_builder().with_data(&[x.len() as i32]).create("nzmax").expect("nzmax");
    group.new_dataset_builder().with_data(p).create("p").expect("p");
    group.new_dataset_builder().with_data(i).create("i").expect("i");
    group.new_dataset_builder().with_data(x).create("x").expect("x");
}

#[test]
fn triplets_columns_and_rows_are_one_matrix() {
    let here = Folder::new();
    let original = problems().join("sheared-before.hdf5");
    let expected = Problem::read(&original).expect("read").assembled;
    let entries = expected.parts().matrix.entries();
    let starts = |line: fn(&(usize, usize, f64)) -> usize| -> Vec<i32> {
        (0..=expected.r.len()).map(|k| entries.iter().filter(|e| line(e) < k).count() as i32).collect()
    };
    let numbers = |list: &[(usize, usize, f64)], pick: fn(&(usize, usize, f64)) -> usize| -> Vec<i32> {
        list.iter().map(|e| pick(e) as i32).collect()
    };
    let values = |list: &[(usize, usize, f64)]| -> Vec<f64> { list.iter().map(|e| e.2).collect() };
    let mut by_column = entries.clone();
    by_column.sort_by_key(|e| (e.1, e.0));
    // triplets in any order, one of them in two halves, with room behind the last
    let mut shuffled = entries.clone();
    shuffled.reverse();
    shuffled[0].2 *= 0.5;
    shuffled.push(shuffled[0]);
    let count = shuffled.len() as i32;
    let room = [values(&shuffled), vec![0.0; 3]].concat();
    for (nz, p, i, x) in [
        (-2, starts(|e| e.0), numbers(&entries, |e| e.1), values(&entries)),
        (-1, starts(|e| e.1), numbers(&by_column, |e| e.0), values(&by_column)),
        (count, numbers(&shuffled, |e| e.1), numbers(&shuffled, |e| e.0), room),
    ] {
        std::fs::copy(&original, here.path("a.hdf5")).expect("copy");
        store(&here.path("a.hdf5"), nz, &p, &i, &x);
        let found = Problem::read(&here.path("a.hdf5")).expect("read").assembled;
        assert_eq!(found, expected, "nz = {nz}");
    }
}

/// The problem `sheared-before` with one dataset replaced, refused with these words.
fn refused<T: hdf5::H5Type>(place: &str, values: Option<&[T]>, parts: &[&str]) {
    let here = Folder::new();
    std::fs::copy(problems().join("sheared-before.hdf5"), here.path("a.hdf5")).expect("copy");
    let file = File::open_rw(here.path("a.hdf5")).expect("open");
    file.unlink(place).expect("unlink");
    if let Some(values) = values {
        file.new_dataset_builder().with_data(values).create(place).expect("create");
    }
    file.close().expect("close");
    let outcome = here.dem_run(&["solve", "a.hdf5"]).fails(4, &[&["a.hdf5", place], parts].concat());
    assert_eq!(outcome.stdout, "");
}

#[test]
fn wrong_datasets_are_named() {
    refused::<i32>("fclib_local/spacedim", None, &["missing"]);
    refused("fclib_local/spacedim", Some(&[2i32]), &["it is 2", "3, 5 or 6"]);
    refused("fclib_local/spacedim", Some(&[3i32, 3]), &["2 values instead of 1"]);
    refused("fclib_local/W/n", Some(&[101i32]), &["it is 101", "W must be square"]);
    refused("fclib_local/W/nz", Some(&[-3i32]), &["it is -3", "by columns"]);
    refused("fclib_local/W/x", Some(&[1.0f64]), &["1 values, but"]);
    refused("fclib_local/W/p", Some(&[0i32, 2]), &["2 values instead of"]);
    refused("fclib_local/vectors/q", Some(&[f64::NAN; 102]), &["NaN", "finite"]);
    refused("fclib_local/vectors/mu", Some(&[-1.0f64; 34]), &["-1", "not below zero"]);
    refused("fclib_local/vectors/mu_r", Some(&[0.1f64; 3]), &["3 values instead of 34"]);
    refused("cohesive_dem/associated", Some(&[2i32; 34]), &["it is 2", "from 0 to 1"]);
}

#[test]
fn wrong_files_are_refused() {
    let here = Folder::new();
    here.dem_run(&["solve", "a.hdf5"]).fails(4, &["a.hdf5", "cannot read"]);
    here.write("a.hdf5", "step,time\n0,0\n");
    here.dem_run(&["solve", "a.hdf5"]).fails(4, &["a.hdf5", "HDF5", "dem-run export"]);
    let whole = std::fs::read(problems().join("heap.hdf5")).expect("read");
    for cut in [40, 800, whole.len() / 2, whole.len() - 8] {
        here.write("a.hdf5", &whole[..cut]);
        here.dem_run(&["solve", "a.hdf5"]).fails(4, &["a.hdf5"]);
    }
    std::fs::remove_file(here.path("a.hdf5")).expect("remove");
    File::create(here.path("a.hdf5")).and_then(|file| file.create_group("fclib_global")).expect("create");
    here.dem_run(&["solve", "a.hdf5"]).fails(4, &["a.hdf5", "/fclib_global/spacedim", "missing"]);
    here.dem_run(&["solve", "a.hdf5", "--tolerance", "0"]).fails(2, &["--tolerance", "above zero"]);
    here.dem_run(&["solve", "a.hdf5", "--solver", "magic"]).fails(2, &["magic", "gauss-seidel", "interior"]);
    here.dem_run(&["solve", "a.hdf5", "-o", "a.hdf5", "--force"]).fails(4, &["overwrite", "another file"]);
}

#[test]
fn wrong_exports_are_refused() {
    let here = Folder::new();
    here.dem_run(&["export", "a.h5", "--step", "1", "-o", "a.hdf5"]).fails(4, &["a.h5", "does not exist"]);
    here.run_config("two-grains.json", &["-o", "a.h5", "--quiet"]);
    here.dem_run(&["solve", "a.h5"]).fails(4, &["a.h5", "history", "dem-run export"]);
    here.dem_run(&["export", "a.h5", "--step", "0", "-o", "a.hdf5"]).fails(2, &["--step", "at least 1"]);
    here.dem_run(&["export", "a.h5", "--step", "1501", "-o", "a.hdf5"]).fails(2, &["no step", "1501", "1 to 1002"]);
    // the bond broke in step 1001, and nothing touches any more
    here.dem_run(&["export", "a.h5", "--step", "1002", "-o", "a.hdf5", "-q"]).fails(2, &["no contacts", "1002"]);
    here.dem_run(&["export", "a.h5", "--step", "9", "-o", "a.h5", "--force"]).fails(4, &["overwrite", "another file"]);
    here.dem_run(&["export", "a.h5", "--step", "9", "-o", "no/a.hdf5"]).fails(4, &["no folder no"]);
    assert_eq!(here.names(), ["a.h5"]);
    here.dem_run(&["export", "a.h5", "--step", "9", "-o", "a.hdf5", "-q"]).succeeds();
    here.dem_run(&["export", "a.h5", "--step", "9", "-o", "a.hdf5", "-q"]).fails(4, &["exists", "--force"]);
}

const TOLERANCE: f64 = 1e-8;

fn staged(tolerance: f64) -> StagedSettings {
    StagedSettings {
        stages: Stages::Interior,
        tolerance,
        accept: tolerance,
        load_tolerance: f64::INFINITY,
        start: Start::StiffLimit,
        stiffness: StiffnessRatio { tangential: 1.0, rolling: 1.0 / 12.0 },
        max_iterations: 300,
    }
}

fn interior_point(problem: &mut Assembled) -> SolveStatus {
    Staged::new(staged(TOLERANCE)).solve_assembled(problem).status
}

fn swept(problem: &mut Assembled, local: LocalSolve, acceleration: usize) -> SolveStatus {
    let (tolerance, max_sweeps) = (TOLERANCE, 100_000);
    let settings = GaussSeidelSettings { local, tolerance, accept: tolerance, max_sweeps, acceleration };
    gauss_seidel(problem, &settings).status
}

fn largest(x: impl Iterator<Item = f64>) -> f64 {
    x.fold(0.0, |most, x| most.max(x.abs()))
}

/// Largest difference of the relative velocities, over the largest that there would be without
/// reactions.
fn velocities_apart(a: &Assembled, b: &Assembled) -> f64 {
    let mut free = a.clone();
    free.r.fill(0.0);
    let rows = a.parts().rows.count();
    a.parts().shift.iter().enumerate().for_each(|(c, shift)| free.r[c * rows] = *shift);
    let difference = largest(a.velocities().into_iter().zip(b.velocities()).map(|(a, b)| a - b));
    difference / largest(free.velocities().into_iter())
}

/// Whether a solver cannot solve a problem: in the steps of a collapse 100,000 sweeps come to 6e-7.
fn beyond(name: &str, solver: &str) -> bool {
    ["sheared-collapse", "cube-collapse"].contains(&name) && solver != "interior"
}

#[test]
fn the_collection_is_solved_by_every_solver() {
    let mut names: Vec<_> =
        std::fs::read_dir(problems()).expect("problems").map(|e| e.expect("entry").path()).collect();
    names.retain(|path| path.extension().is_some_and(|e| e == "hdf5"));
    names.sort();
    assert_eq!(names.len(), 13);
    for path in names {
        let name = path.file_stem().expect("name").to_str().expect("UTF-8");
        assert!(path.metadata().expect("metadata").len() <= 50_000, "{name} is too large");
        let problem = Problem::read(&path).expect("read");
        let mut start = problem.assembled;
        start.r.fill(0.0);
        let mut found: Vec<Assembled> = Vec::new();
        for solver in ["interior", "exact", "predictor-corrector", "accelerated"] {
            let mut at = start.clone();
            let status = match solver {
                "interior" => interior_point(&mut at),
                "exact" => swept(&mut at, LocalSolve::Exact, 0),
                "accelerated" => swept(&mut at, LocalSolve::Exact, 8),
                _ => swept(&mut at, LocalSolve::PredictorCorrector, 0),
            };
            let residual = at.residual();
            let bound = if beyond(name, solver) { 1e-6 } else { TOLERANCE };
            assert!(residual <= bound, "{name}, {solver}: {status:?} with {residual:e}");
            assert_eq!(status == SolveStatus::Converged, residual <= TOLERANCE, "{name}, {solver}");
            found.push(at);
        }
        for at in &found[1..] {
            // unique where every flow is associated
            if start.parts().associated.iter().all(|flag| *flag) {
                let distance = velocities_apart(&found[0], at);
                assert!(distance <= 2e-6, "{name}: {distance:e}");
            }
            // unique where W has full rank
            if name == "two-grains" {
                let distance = largest(at.r.iter().zip(&found[0].r).map(|(a, b)| a - b));
                assert!(distance <= 1e-5 * largest(at.r.iter().copied()), "{name}: {distance:e}");
            }
        }
    }
}

/// The path of these problems folds: one step of `compression` and one of `brazilian-3d`, after
/// their collapse.
#[test]
fn folds_of_the_path_are_followed() {
    for (name, most) in [("compression", 100), ("brazilian-3d", 300)] {
        let path = problems().join(format!("folds/{name}.hdf5"));
        let mut at = Problem::read(&path).expect("read").assembled;
        let settings = StagedSettings { max_iterations: most, ..staged(TOLERANCE) };
        let report = Staged::new(settings).solve_assembled(&mut at);
        assert_eq!(report.status, SolveStatus::Converged, "{name}: {:e}", at.residual());
        assert_eq!(report.work.sweeps, 0, "{name}");
    }
}
