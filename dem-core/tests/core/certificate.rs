//! Verdicts on problems that were not solved, against closed forms.

use crate::common::{force_driven, grain, newton, settings, world};
use dem_core::body::{Drive, Grain, Shape, Wall};
use dem_core::bond::Stiffness;
use dem_core::contact::{BondFlow, LocalSolve};
use dem_core::dim::{D2, D3, D3Twist, Dim, Vect};
use dem_core::problem::ContactProblem;
use dem_core::problem::assembled::{Assembled, BlockMatrix, ContactRows, Parts};
use dem_core::saved::{Mismatch, Reader, Saved};
use dem_core::solver::certificate::{Verdict, verdict, verdict_of_assembled};
use dem_core::solver::{
    ContactSolver, GaussSeidelSettings, Route, SolveReport, SolveStatus, SolverSettings, Staged, StagedSettings,
    Stages, Work,
};
use dem_core::world::{Settings, StepError, World};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::sync::Arc;

/// Radius of the grains (m), speed of the driven walls (m/s), time step (s).
const R: f64 = 0.01;
const SPEED: f64 = 0.1;
const STEP: f64 = 1e-3;

/// A vector with these first components, the others zero.
fn at<D: Dim>(x: &[f64]) -> D::Vector {
    let mut v = D::Vector::zero();
    x.iter().enumerate().for_each(|(k, x)| v[k] = *x);
    v
}

fn set<D: Dim>() -> Settings<D> {
    Settings { solver: SolverSettings::Staged(newton(1e-8, 1e-6, 1e-4)), ..settings(STEP) }
}

fn plane<D: Dim>(normal: &[f64], position: &[f64]) -> Wall<D> {
    Wall::fixed(Shape::Plane { normal: at::<D>(normal) }, at::<D>(position), 0.3)
}

/// The same wall, driven in this direction at [`SPEED`].
fn driven<D: Dim>(normal: &[f64], position: &[f64], direction: &[f64]) -> Wall<D> {
    let drive = Drive::Velocity { direction: at::<D>(direction), speed: Arc::new(|_| SPEED) };
    Wall { drive, ..plane(normal, position) }
}

/// Grains in a row along x.
fn row<D: Dim>(count: usize) -> Vec<Grain<D>> {
    (0..count).map(|k| grain::<D>(&[&[R * (2 * k + 1) as f64][..], &vec![0.0; D::N - 1]].concat(), R)).collect()
}

/// A row of grains between a fixed wall and an approaching one.
fn squeezed<D: Dim>(count: usize) -> World<D> {
    let press = driven(&[-1.0], &[2.0 * R * count as f64], &[-1.0]);
    world(row(count), vec![plane(&[1.0], &[]), press], set())
}

/// The verdict on the first step. From the matrix alone the verdict may be weaker, undecided
/// instead of guaranteed, because the matrix does not contain the motion of the bodies.
fn of<D: Dim>(w: &mut World<D>) -> Verdict<usize> {
    let problem = w.contact_problem();
    let found = verdict(&problem);
    let by_the_matrix = verdict_of_assembled(&Assembled::of(&problem));
    assert!(
        by_the_matrix == found || found == Verdict::Guaranteed && by_the_matrix == Verdict::Undecided,
        "{by_the_matrix:?}"
    );
    found
}

fn fails<D: Dim>(w: &mut World<D>) -> Verdict<u32> {
    w.step().expect_err("no solution").verdict().cloned().expect("a verdict")
}

#[test]
fn a_grain_between_walls_that_close_has_no_solution() {
    fn case<D: Dim>() {
        for count in [1, 2, 5] {
            let mut w = squeezed::<D>(count);
            assert_eq!(of(&mut w), Verdict::NoSolution((0..=count).collect()));
            // gravity along the walls and spinning grains change nothing
            w.settings.gravity = Some(at::<D>(&[0.0, -9.81]));
            w.grains.spin[0][0] = 3.0;
            w.grains.velocity.fill(at::<D>(&[0.0, -2.0]));
            assert_eq!(of(&mut w), Verdict::NoSolution((0..=count).collect()));
            assert_eq!(fails(&mut w), Verdict::NoSolution((0..count as u32 + 2).collect()));
        }
    }
    case::<D2>();
    case::<D3>();
}

/// The approaching wall has a gap to the grain, a part of its displacement in the step. The rest of
/// the displacement has no room: one of the two contacts closes by half of the rest or more. The
/// reactions only balance each other, so the power that they leave is that of the rest, against
/// which they act, not that of the whole displacement.
#[test]
fn walls_jam_a_grain_by_the_way_beyond_its_gap() {
    fn case<D: Dim>() {
        let way = STEP * SPEED;
        for part in [0.0, 0.5, 0.8, 1.2] {
            let mut w = squeezed::<D>(1);
            w.walls[1].position[0] += part * way;
            let outcome = w.step();
            if part > 1.0 {
                assert!(outcome.is_ok(), "{part}");
                continue;
            }
            let Err(StepError::Yielded { violation, .. }) = outcome else { panic!("{part}: {outcome:?}") };
            assert_eq!(violation.jammed, Some(vec![1, 2]), "{part}");
            assert!(!violation.accumulated);
            let lacking = (1.0 - part) * way / R;
            assert!(
                (0.499 * lacking..1.001 * lacking).contains(&violation.share),
                "{part}: {:e} of {lacking:e}",
                violation.share
            );
        }
    }
    case::<D2>();
    case::<D3>();
}

#[test]
fn a_bonded_row_between_walls_that_close_has_no_solution() {
    fn case<D: Dim>(flow: BondFlow) {
        let mut w = squeezed::<D>(3);
        w.settings.bond_flow = flow;
        w.form_bonds(1e-6, |_| 1.0, 0.3);
        w.limit_twist(0.02);
        assert_eq!(of(&mut w), Verdict::NoSolution(vec![0, 1, 2, 3]));
        assert_eq!(fails(&mut w), Verdict::NoSolution(vec![0, 1, 2, 3, 4]));
    }
    for flow in [BondFlow::Associated, BondFlow::Bipotential] {
        case::<D2>(flow);
        case::<D3>(flow);
        case::<D3Twist>(flow);
    }
}

/// A rigid bond and an elastic one in a row: the elastic one deforms.
#[test]
fn an_elastic_bond_gives_way() {
    fn case<D: Dim>(known: &Verdict<usize>) {
        let mut w = squeezed::<D>(2);
        w.form_bonds(1e-6, |_| 1e3, 0.3);
        w.make_bonds_elastic(|a| Stiffness {
            normal: 1e6,
            tangential: 4e5,
            rolling: 1e6 * a * a / 12.0,
            twist: 1e6 * a * a / 16.0,
        });
        assert_eq!(verdict(&w.contact_problem()), *known);
        // the matrix adds the compliance to the inverse masses
        assert!(!matches!(verdict_of_assembled(&Assembled::of(&w.contact_problem())), Verdict::NoSolution(_)));
        w.step().expect("a solution");
    }
    case::<D2>(&Verdict::Guaranteed);
    case::<D3>(&Verdict::Undecided);
}

/// A force-driven wall gives way, however heavy it is.
#[test]
fn a_heavy_wall_gives_way() {
    for mass in [1.0, 1e3, 1e6, 1e9] {
        let mut w = squeezed::<D2>(1);
        w.walls[0] = force_driven(at::<D2>(&[1.0]), at::<D2>(&[]), mass, 0.0);
        assert!(!matches!(verdict(&w.contact_problem()), Verdict::NoSolution(_)), "{mass}");
        // heavier still, round-off moves the light grain
        assert!(mass > 1e6 || w.step().is_ok(), "{mass}");
    }
}

/// A wedge of half-angle α with tan α < μ, one plate of which slides along itself towards the edge.
/// Impulses that hold the grain there at the friction limit balance each other and resist the
/// motion, so a solution is not guaranteed. Without a load zero reactions are a solution; under a
/// load no solution is found.
#[test]
fn a_plate_that_slides_along_itself_is_undecided() {
    let (s, c) = 0.1f64.sin_cos();
    for gravity in [None, Some(at::<D2>(&[0.0, -9.81]))] {
        let walls = vec![plane(&[c, s], &[]), driven(&[-c, s], &[], &[-s, -c])];
        let mut w = world::<D2>(vec![grain(&[0.0, R / s], R)], walls, set());
        w.settings.gravity = gravity;
        assert_eq!(of(&mut w), Verdict::Undecided);
        match gravity {
            None => assert_eq!(w.step().expect("a solution").residual, 0.0),
            Some(_) => assert_eq!(fails(&mut w), Verdict::Undecided),
        }
    }
}

/// The plates of that wedge close on the grain, which can only move outwards. For μ > tan α the
/// friction, which acts inwards, exceeds the outward push. For smaller μ the grain is pushed out.
#[test]
fn a_pip_between_closing_plates_is_undecided() {
    for (angle, found) in [(0.1f64, Verdict::Undecided), (0.6, Verdict::Guaranteed)] {
        let (s, c) = angle.sin_cos();
        let walls = vec![driven(&[c, s], &[], &[c, s]), driven(&[-c, s], &[], &[-c, s])];
        let mut w = world::<D2>(vec![grain(&[0.0, R / s], R)], walls, set());
        assert_eq!(of(&mut w), found, "{angle}");
        match (w.step(), found) {
            (Ok(_), found) => assert_eq!(found, Verdict::Guaranteed),
            (Err(StepError::NotAccepted { verdict, .. }), found) => {
                assert_eq!((verdict, found), (Verdict::Undecided, Verdict::Undecided))
            }
            (Err(StepError::Yielded { violation, .. }), found) => {
                assert_eq!((violation.verdict, found), (Verdict::Undecided, Verdict::Undecided))
            }
            (Err(error), _) => panic!("{error}"),
        }
    }
}

#[test]
fn a_solution_is_guaranteed_where_nothing_is_made_to_close() {
    // in 2D with walls at rest, or with room
    let mut still = squeezed::<D2>(2);
    still.walls[1].drive = Drive::Fixed;
    still.settings.gravity = Some(at::<D2>(&[-9.81, -9.81]));
    assert_eq!(of(&mut still), Verdict::Guaranteed);
    let mut pushed = world::<D2>(row(2), vec![driven(&[-1.0], &[4.0 * R], &[-1.0])], set());
    assert_eq!(of(&mut pushed), Verdict::Guaranteed);
    // in 3D this is not proved
    let mut still = squeezed::<D3>(2);
    still.walls[1].drive = Drive::Fixed;
    assert_eq!(of(&mut still), Verdict::Undecided);
}

/// A solver that stops too early fails, and the verdict attributes the failure to the solver: a
/// solution is guaranteed.
#[test]
fn a_failure_of_the_solver_is_said_to_be_one() {
    let mut set = set::<D2>();
    let (local, tolerance, accept) = (LocalSolve::Exact, 1e-12, 1e-12);
    set.solver =
        SolverSettings::GaussSeidel(GaussSeidelSettings { local, tolerance, accept, max_sweeps: 1, acceleration: 0 });
    let mut w = world::<D2>(row(5), vec![plane(&[1.0], &[])], set);
    w.grains.velocity[4] = at::<D2>(&[-0.1, 0.0]);
    assert_eq!(fails(&mut w), Verdict::Guaranteed);
}

/// Small random problems of low rank: no solved problem gets the verdict of no solution, and each
/// verdict occurs.
#[test]
fn no_verdict_contradicts_a_solution() {
    let mut rng = Pcg64::seed_from_u64(5);
    let mut any = || 2.0 * rng.random::<f64>() - 1.0;
    let mut counts = [0; 3];
    for trial in 0..300 {
        let (contacts, rank) = (4, 2 + trial % 4);
        let size = 2 * contacts;
        let h: Vec<f64> = (0..size * rank).map(|_| any()).collect();
        let w = |i: usize, j: usize| (0..rank).map(|k| h[i * rank + k] * h[j * rank + k]).sum::<f64>();
        let entries: Vec<_> = (0..size * size).map(|k| (k / size, k % size, w(k / size, k % size))).collect();
        let parts = Parts {
            rows: ContactRows { tangents: 1, moments: 0 },
            matrix: BlockMatrix::from_entries(contacts, 2, &entries),
            q: (0..size).map(|_| any()).collect(),
            mu: vec![0.3; contacts],
            nu: vec![0.0; contacts],
            xi: vec![0.0; contacts],
            associated: (0..contacts).map(|c| trial % 3 == 0 && c == 0).collect(),
            shift: vec![0.0; contacts],
            applied: 0.0,
        };
        let mut problem = Assembled::new(parts).unwrap();
        let found = verdict_of_assembled(&problem);
        let settings = StagedSettings { stages: Stages::Interior, ..newton(1e-9, 1e-9, f64::INFINITY) };
        let report = Staged::new(settings).solve_assembled(&mut problem);
        let solved = report.status == SolveStatus::Converged && problem.velocity_error() < 1e-6;
        match found {
            Verdict::NoSolution(_) => {
                counts[0] += 1;
                assert!(!solved, "{trial}: {:e}", problem.velocity_error());
            }
            Verdict::Guaranteed => {
                counts[1] += 1;
                assert!(solved, "{trial}: {:e} {:e}", report.residual, problem.velocity_error());
            }
            Verdict::Undecided => counts[2] += 1,
        }
    }
    assert!(counts.iter().all(|count| *count >= 10), "{counts:?}");
}

/// A bonded row between walls that hold its ends and slide: by the associated flow a bond that
/// slips opens, for which the walls leave no room. The residual is small beside ever larger
/// reactions, but the velocity error is not. In a fast slide a bond may yield as well.
#[test]
fn bonds_sheared_between_walls_that_cannot_part_have_no_solution() {
    fn case<D: Dim>(slow: bool) {
        let walls = [plane(&[1.0], &[]), driven(&[-1.0], &[6.0 * R], &[0.0, 1.0])];
        let held = walls.map(|wall| Wall { grip: Some(1e-3 * R), ..wall });
        let mut w = world(row::<D>(3), held.to_vec(), set());
        if slow {
            w.walls[1].drive = Drive::Velocity { direction: at::<D>(&[0.0, 1.0]), speed: Arc::new(|_| 1e-3 * SPEED) };
        }
        w.settings.solver = SolverSettings::Staged(newton(1e-8, 1e-6, 1e-5));
        w.form_bonds(1e-6, |_| 10.0, 0.3);
        let error = w.step().expect_err("no solution");
        match &error {
            StepError::NotAccepted { velocity_error: Some(error), .. } => assert!(*error > 1e-3, "{error}"),
            error => assert!(!slow && matches!(error, StepError::Yielded { .. }), "{error}"),
        }
        assert_eq!(error.verdict(), Some(&Verdict::NoSolution(vec![0, 1, 2])));
    }
    for slow in [false, true] {
        case::<D2>(slow);
        case::<D3>(slow);
    }
}

/// Takes the free velocities for the solution.
struct Idle;

impl<D: Dim> ContactSolver<D> for Idle {
    fn solve(&mut self, _: &mut ContactProblem<D>) -> SolveReport {
        let (status, route) = (SolveStatus::Converged, Route::Sweeps);
        SolveReport { status, route, work: Work::default(), residual: 0.0, load_error: None }
    }

    fn snapshot(&self) -> Box<dyn ContactSolver<D>> {
        Box::new(Self)
    }

    fn save(&self, _: &mut Saved) {}

    fn restore(&mut self, _: &mut Reader) -> Result<(), Mismatch> {
        Ok(())
    }
}

/// A rigid bond below its limit yields by its elongation, its slip and its rolling in one step, and
/// by the sum of its elongation over many.
#[test]
fn a_rigid_bond_yields_in_each_of_its_rows() {
    fn case<D: Dim>(row: usize) {
        // the sum is that along the normal
        for (share, steps) in [(2e-4, 1), (0.3e-4, 40)].into_iter().take(if row == 0 { 2 } else { 1 }) {
            let mut pair = self::row::<D>(2);
            pair[0].fixed = true;
            let speed = share * R / STEP;
            if row < 2 {
                pair[1].velocity[row] = speed;
            } else {
                // the last axis: rolling, not twist
                pair[1].spin[D::Spin::LEN - 1] = speed / R;
            }
            let mut w = world(pair, vec![], set());
            w.form_bonds(1e-6, |_| 10.0, 0.3);
            w.use_solver(Box::new(Idle));
            let failed = (0..steps).find_map(|_| w.step().err());
            let Some(StepError::Yielded { violation, .. }) = failed else { panic!("{row} {share}: {failed:?}") };
            assert_eq!((violation.pair, violation.accumulated), ([0, 1], steps > 1));
        }
    }
    for row in 0..3 {
        case::<D2>(row);
        case::<D3>(row);
        case::<D3Twist>(row);
    }
}
