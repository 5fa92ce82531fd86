//! Problems of FCLIB over the velocities of bodies (M, H, f, w), and matrices that are not quite
//! symmetric.

use crate::common::Folder;
use dem_core::problem::assembled::{Assembled, BlockMatrix, ContactRows, Parts};
use dem_run::fclib::Problem;
use hdf5::{File, Group, H5Type};
use std::path::Path;

/// Row, column, value.
type Entry = (usize, usize, f64);

/// M v = H r + f, u = Hᵀ v + w.
#[derive(Clone, Default)]
struct Global {
    /// Rows of a contact: 2 in the plane, 3 in space, 5 with rolling friction.
    size: usize,
    unknowns: usize,
    mass: Vec<Entry>,
    h: Vec<Entry>,
    f: Vec<f64>,
    contacts: usize,
}

/// A number between −1 and 1.
fn scatter(k: usize) -> f64 {
    (12.9898 * (k + 1) as f64).sin()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = a.iter().map(|a| a * a).sum::<f64>().sqrt();
    a.map(|a| a / length)
}

impl Global {
    /// A block of `count` bodies of radius 1 that lie on each other and beside each other, on a
    /// floor, and have masses and inertia tensors of their own. The plane is that of x and z.
    fn block(size: usize, count: [usize; 3]) -> Self {
        let [nx, ny, nz] = count;
        let own = if size == 2 { 3 } else { 6 };
        let unknowns = nx * ny * nz * own;
        let mut global = Self { size, unknowns, f: vec![0.0; unknowns], ..Self::default() };
        let number = |x: usize, y: usize, z: usize| x + nx * (y + ny * z);
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    let body = number(x, y, z);
                    global.add_body(body, own);
                    global.add_contact([Some(body), (z > 0).then(|| number(x, y, z - 1))], [0.0, 0.0, 1.0]);
                    if x > 0 {
                        global.add_contact([Some(body), Some(number(x - 1, y, z))], [1.0, 0.0, 0.0]);
                    }
                    if y > 0 {
                        global.add_contact([Some(body), Some(number(x, y - 1, z))], [0.0, 1.0, 0.0]);
                    }
                }
            }
        }
        global
    }

    /// A body under gravity, thrown a little.
    fn add_body(&mut self, body: usize, own: usize) {
        let (first, mass) = (body * own, 1.0 + 0.5 * scatter(body));
        let place = own / 2;
        for k in 0..own {
            let of_spin = if own == 3 { k == 2 } else { k >= place };
            let value = if of_spin { mass * (0.4 + 0.05 * scatter(7 * body + k)) } else { mass };
            self.mass.push((first + k, first + k, value));
            self.f[first + k] = 0.1 * scatter(11 * body + 3 * k);
        }
        // products of inertia; in the plane the centre of mass lies beside that of the body
        let coupled = if own == 3 { vec![(0, 2)] } else { vec![(3, 4), (3, 5), (4, 5)] };
        for (i, j) in coupled {
            let value = 0.1 * mass * scatter(5 * body + i + j);
            self.mass.extend([(first + i, first + j, value), (first + j, first + i, value)]);
        }
        self.f[first + if own == 3 { 1 } else { 2 }] -= mass;
    }

    /// A contact of a body with another or with the floor; the normal, which is turned a little,
    /// points to the first.
    fn add_contact(&mut self, bodies: [Option<usize>; 2], normal: [f64; 3]) {
        let contact = self.contacts;
        let turn = |k: usize| 0.2 * scatter(3 * contact + k);
        if self.size == 2 {
            let n = unit([normal[0] + turn(0), 0.0, normal[2] + turn(2)]);
            for (body, sign) in bodies.into_iter().zip([1.0, -1.0]) {
                let Some(body) = body else { continue };
                // of n and t, at −n from the first centre and at n from the second
                for (row, d) in [[n[0], n[2], 0.0], [-n[2], n[0], -sign]].into_iter().enumerate() {
                    for (k, value) in d.into_iter().enumerate() {
                        self.h.push((3 * body + k, 2 * contact + row, sign * value));
                    }
                }
            }
        } else {
            let n = unit([normal[0] + turn(0), normal[1] + turn(1), normal[2] + turn(2)]);
            let t = unit(cross(n, [normal[1], normal[2], normal[0]]));
            let axes = [n, t, cross(n, t)];
            for (body, sign) in bodies.into_iter().zip([1.0, -1.0]) {
                let Some(body) = body else { continue };
                let arm = n.map(|n| -sign * n);
                for row in 0..self.size {
                    let (push, turn) = match row {
                        0..3 => (axes[row], cross(arm, axes[row])),
                        _ => ([0.0; 3], axes[row - 2]),
                    };
                    for (k, value) in push.into_iter().chain(turn).enumerate().filter(|(_, value)| *value != 0.0) {
                        self.h.push((6 * body + k, self.size * contact + row, sign * value));
                    }
                }
            }
        }
        self.contacts += 1;
    }

    fn group(&self) -> &'static str {
        if self.size == 5 { "fclib_global_rolling" } else { "fclib_global" }
    }

    /// w, C × `size`: some contacts are still open.
    fn w(&self) -> Vec<f64> {
        let opening = |k: usize| if k.is_multiple_of(self.size) { 0.05 * (1.0 + scatter(k)) } else { 0.0 };
        (0..self.contacts * self.size).map(opening).collect()
    }

    /// Writes it: M as triplets, H by columns.
    fn write(&self, path: &Path) {
        let file = File::create(path).expect("create");
        let group = file.create_group(self.group()).expect("group");
        put(&group, "spacedim", &[self.size as i32]);
        let m = group.create_group("M").expect("M");
        sizes(&m, self.unknowns, self.unknowns, self.mass.len() as i32);
        put(&m, "i", &numbers(&self.mass, |e| e.0));
        put(&m, "p", &numbers(&self.mass, |e| e.1));
        put(&m, "x", &self.mass.iter().map(|e| e.2).collect::<Vec<_>>());
        let (h, columns) = (group.create_group("H").expect("H"), self.contacts * self.size);
        let mut entries = self.h.clone();
        entries.sort_by_key(|e| (e.1, e.0));
        sizes(&h, self.unknowns, columns, -1);
        let starts: Vec<i32> = (0..=columns).map(|k| entries.partition_point(|e| e.1 < k) as i32).collect();
        put(&h, "p", &starts);
        put(&h, "i", &numbers(&entries, |e| e.0));
        put(&h, "x", &entries.iter().map(|e| e.2).collect::<Vec<_>>());
        let vectors = group.create_group("vectors").expect("vectors");
        put(&vectors, "f", &self.f);
        put(&vectors, "w", &self.w());
        put(&vectors, "mu", &vec![0.4; self.contacts]);
        if self.size == 5 {
            put(&vectors, "mu_r", &vec![0.1; self.contacts]);
        }
    }

    /// The same over the contacts alone, from full matrices.
    fn local(&self) -> Assembled {
        let rows = self.contacts * self.size;
        let mut m = vec![vec![0.0; self.unknowns]; self.unknowns];
        self.mass.iter().for_each(|(row, column, value)| m[*row][*column] += value);
        let mut right = vec![vec![0.0; rows + 1]; self.unknowns];
        self.h.iter().for_each(|(row, column, value)| right[*row][*column] += value);
        self.f.iter().enumerate().for_each(|(row, f)| right[row][rows] = *f);
        eliminate(&mut m, &mut right);
        let (mut entries, mut q) = (Vec::new(), self.w());
        for (row, column, value) in &self.h {
            q[*column] += value * right[*row][rows];
            let products = right[*row][..rows].iter().enumerate().filter(|(_, x)| **x != 0.0);
            entries.extend(products.map(|(other, x)| (*column, other, value * x)));
        }
        let contacts = self.contacts;
        let moments = if self.size == 5 { 2 } else { 0 };
        Assembled::new(Parts {
            rows: ContactRows { tangents: self.size.min(3) - 1, moments },
            matrix: BlockMatrix::from_entries(contacts, self.size, &entries),
            q,
            mu: vec![0.4; contacts],
            nu: vec![if moments > 0 { 0.1 } else { 0.0 }; contacts],
            xi: vec![0.0; contacts],
            associated: vec![false; contacts],
            shift: vec![0.0; contacts],
            applied: 0.0,
        })
        .expect("a problem")
    }
}

/// right ← m⁻¹ right, by Gauss–Jordan.
fn eliminate(m: &mut [Vec<f64>], right: &mut [Vec<f64>]) {
    for k in 0..m.len() {
        let (pivot, line, values) = (m[k][k], m[k].clone(), right[k].clone());
        for row in (0..m.len()).filter(|row| *row != k && m[*row][k] != 0.0).collect::<Vec<_>>() {
            let factor = m[row][k] / pivot;
            m[row].iter_mut().zip(&line).for_each(|(x, l)| *x -= factor * l);
            right[row].iter_mut().zip(&values).for_each(|(x, l)| *x -= factor * l);
        }
        right[k].iter_mut().for_each(|x| *x /= pivot);
        m[k].iter_mut().for_each(|x| *x /= pivot);
    }
}

fn numbers(entries: &[Entry], pick: fn(&Entry) -> usize) -> Vec<i32> {
    entries.iter().map(|e| pick(e) as i32).collect()
}

fn put<T: H5Type>(group: &Group, name: &str, values: &[T]) {
    group.new_dataset_builder().with_data(values).create(name).expect(name);
}

fn sizes(group: &Group, m: usize, n: usize, nz: i32) {
    for (name, value) in [("m", m as i32), ("n", n as i32), ("nz", nz)] {
        put(group, name, &[value]);
    }
}

fn largest(x: impl Iterator<Item = f64>) -> f64 {
    x.fold(0.0, |most, x| most.max(x.abs()))
}

#[test]
fn a_global_problem_is_its_local_one() {
    for (size, count) in [(2, [5, 1, 4]), (3, [3, 3, 3]), (5, [3, 2, 3])] {
        let here = Folder::new();
        let global = Global::block(size, count);
        global.write(&here.path("a.hdf5"));
        let (found, local) = (Problem::read(&here.path("a.hdf5")).expect("read"), global.local());
        assert_eq!(found.warnings, [""; 0]);
        let (parts, expected) = (found.assembled.parts(), local.parts());
        assert_eq!((parts.rows, &parts.mu, &parts.nu), (expected.rows, &expected.mu, &expected.nu));
        assert!(largest(parts.q.iter().zip(&expected.q).map(|(a, b)| a - b)) <= 1e-12);
        let negative = |(row, column, w): Entry| (row, column, -w);
        let both = parts.matrix.entries().into_iter().chain(expected.matrix.entries().into_iter().map(negative));
        let difference = BlockMatrix::from_entries(global.contacts, size, &both.collect::<Vec<_>>()).entries();
        assert!(largest(difference.into_iter().map(|e| e.2)) <= 1e-12, "rows: {size}");
        let problem = Problem { assembled: local.clone(), ..found.clone() };
        problem.write(&here.path("b.hdf5")).expect("write");
        for name in ["a.hdf5", "b.hdf5"] {
            let solve = ["solve", name, "--solver", "interior", "--json", "--force", "-o", "c.hdf5"];
            let answer = here.dem_run(&solve).json();
            assert_eq!((&answer["converged"], &answer["contacts"]), (&true.into(), &global.contacts.into()));
            // the solution of each solves the other
            for problem in [&found.assembled, &local] {
                let mut at = problem.clone();
                at.r = Problem::read(&here.path("c.hdf5")).expect("read").solution.expect("a solution");
                assert!(at.residual() <= 1.1e-8, "{name}, rows: {size}: {:e}", at.residual());
            }
        }
    }
}

#[test]
fn a_thousand_contacts_are_solved_in_a_second() {
    let here = Folder::new();
    let global = Global::block(3, [8, 8, 6]);
    assert!(global.contacts >= 1_000);
    global.write(&here.path("a.hdf5"));
    let answer = here.dem_run(&["solve", "a.hdf5", "--solver", "interior", "--json"]).json();
    assert!(answer["cpu_time"].as_f64().expect("a time") <= 1.0, "{answer}");
}

/// A small global problem with changed datasets is refused with these words.
fn refused(change: impl FnOnce(&mut Global, &mut Vec<Entry>), file: impl FnOnce(&Group), parts: &[&str]) {
    let here = Folder::new();
    let mut global = Global::block(3, [2, 1, 1]);
    let mut more = Vec::new();
    change(&mut global, &mut more);
    global.mass.extend(more);
    global.write(&here.path("a.hdf5"));
    let opened = File::open_rw(here.path("a.hdf5")).expect("open");
    file(&opened.group(global.group()).expect("group"));
    opened.close().expect("close");
    let outcome = here.dem_run(&["solve", "a.hdf5"]).fails(4, &[&["a.hdf5"], parts].concat());
    assert_eq!(outcome.stdout, "");
}

#[test]
fn wrong_global_problems_are_refused() {
    let same = |_: &mut Global, _: &mut Vec<Entry>| {};
    // the second body without mass along z, the first with an inertia tensor that is not symmetric
    let massless = |global: &mut Global, _: &mut Vec<Entry>| global.mass.retain(|e| (e.0, e.1) != (8, 8));
    refused(massless, |_| {}, &["/fclib_global", "not positive definite", "rows 8 to 8"]);
    let skew = |_: &mut Global, more: &mut Vec<Entry>| more.push((3, 4, 0.1));
    refused(skew, |_| {}, &["/fclib_global", "M is not symmetric", "row 4 and column 3"]);
    refused(|global, _| global.mass[0].2 = f64::NAN, |_| {}, &["/fclib_global/M/x", "NaN at index 0", "finite"]);
    refused(|global, _| global.f.truncate(11), |_| {}, &["/fclib_global/vectors/f", "11 values instead of 12"]);
    let joint = |group: &Group| drop(group.create_group("G").expect("G"));
    refused(same, joint, &["/fclib_global/G", "equality constraints"]);
    let again = |place: &'static str, value: i32| {
        move |group: &Group| {
            group.unlink(place).expect("unlink");
            put(group, place, &[value]);
        }
    };
    refused(same, again("H/m", 13), &["/fclib_global/H/m", "it is 13, but M has 12 rows"]);
    refused(same, again("H/n", 10), &["/fclib_global/H/n", "multiple of 3"]);
    refused(same, again("M/n", 11), &["/fclib_global/M/n", "M must be square"]);
    refused(same, again("spacedim", 5), &["/fclib_global/vectors/mu_r", "missing"]);
    let outside = |global: &mut Global, _: &mut Vec<Entry>| global.mass[0].1 = 12;
    refused(outside, |_| {}, &["/fclib_global/M/p", "it is 12 at index 0", "from 0 to 11"]);
}

#[test]
fn a_nearly_symmetric_matrix_is_made_symmetric() {
    let here = Folder::new();
    let mut global = Global::block(3, [2, 1, 2]);
    global.mass.push((3, 4, 1e-5));
    global.write(&here.path("a.hdf5"));
    let outcome = here.dem_run(&["solve", "a.hdf5", "--solver", "interior"]).succeeds();
    assert!(outcome.stderr.contains("warning: a.hdf5: M was made symmetric"), "{}", outcome.stderr);
    let local = Problem::read(&here.path("a.hdf5")).expect("read");
    assert_eq!(local.warnings.len(), 1);
    local.write(&here.path("b.hdf5")).expect("write");
    let change = |by: f64| {
        let file = File::open_rw(here.path("b.hdf5")).expect("open");
        let x = file.dataset("fclib_local/W/x").expect("x");
        let mut values = x.read_raw::<f64>().expect("values");
        // of row 1 in column 0, whose mirror stays
        values[1] += by * largest(values.iter().copied());
        x.write_raw(&values).expect("write");
    };
    change(1e-3);
    let solve = ["solve", "b.hdf5", "--solver", "interior", "-o", "c.hdf5"];
    let outcome = here.dem_run(&solve).succeeds();
    for part in ["warning: b.hdf5: W was made symmetric", "5.0e-4 of the largest"] {
        assert!(outcome.stderr.contains(part), "{part} in\n{}", outcome.stderr);
    }
    // what is written is symmetric
    assert_eq!(Problem::read(&here.path("c.hdf5")).expect("read").warnings, [""; 0]);
    change(2e-3);
    here.dem_run(&["solve", "b.hdf5"]).fails(4, &["b.hdf5, /fclib_local/W", "not symmetric", "1.5e-3", "at most 1e-3"]);
}
