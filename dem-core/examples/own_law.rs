//! A user-defined contact law: adhesion without friction, r_n ≥ −c ⊥ u_n ≥ 0, in a chain of three
//! spheres that hangs from a fixed one. The example has its own sweeps, since a
//! [`World`](dem_core::world::World) knows the laws of its kinds alone.
//!
//! `cargo run --release -p dem-core --example own_law`

use dem_core::contact::{Block, Cone, Law, Local, LocalSolve};
use dem_core::dim::{D3, Dim, V0, Vect};
use dem_core::problem::{Contact, Link, Node, Nodes};

/// Adhesion that carries up to an impulse of `adhesion` (N s) in tension.
#[derive(Clone, Copy)]
struct Adhesive {
    /// Inverse of the normal entry of the local Delassus block (kg).
    inverse: f64,
    adhesion: f64,
}

impl Adhesive {
    fn new(block: Block, adhesion: f64) -> Self {
        Self { inverse: 1.0 / block.n, adhesion }
    }
}

impl Law for Adhesive {
    // a normal row and nothing else
    type T = V0;
    type B = V0;
    type Axes<D: Dim> = D::Vector;

    /// The r_n at which u_n vanishes, but not below the limit of the adhesion.
    fn improve(&self, _: LocalSolve, r: Local<V0, V0>, u: Local<V0, V0>) -> Local<V0, V0> {
        Local { n: (r.n - self.inverse * u.n).max(-self.adhesion), ..r }
    }

    fn natural_map(&self, r: Local<V0, V0>, u: Local<V0, V0>) -> Local<V0, V0> {
        r - self.improve(LocalSolve::Exact, r, u)
    }

    fn gamma(&self) -> f64 {
        self.inverse
    }

    /// No friction: a ray.
    fn cone(&self) -> Cone {
        Cone { mu: 0.0, nu: 0.0, xi: 0.0 }
    }

    fn shift(&self) -> f64 {
        self.adhesion
    }
}

fn main() {
    // four spheres of 1 kg, the uppermost fixed; a step of 10 ms under gravity leaves each with v_f
    // = −g h
    let (step, gravity, mass) = (0.01, 9.81, 1.0);
    let weight = mass * gravity * step;
    let sphere = |k: usize| Node::<D3> {
        velocity: [0.0, 0.0, if k == 0 { 0.0 } else { -gravity * step }].into(),
        spin: Vect::zero(),
        inverse_mass: if k == 0 { 0.0 } else { 1.0 / mass },
        inverse_inertia: 0.0,
    };
    let up = D3::frame([0.0, 0.0, 1.0].into());
    for (adhesion, falls) in [(3.5 * weight, 0), (2.5 * weight, 3)] {
        let mut nodes = Nodes { all: (0..4).map(sphere).collect(), grains: 4, drives: vec![], slides: vec![] };
        let contact = |k: u32| {
            let link = Link::<D3>::new([k, k + 1], up);
            let law = Adhesive::new(nodes.block(&link, Default::default()), adhesion);
            Contact { link: Link::new(link.nodes, up), law, r: Local::zero() }
        };
        let mut chain: Vec<Contact<D3, Adhesive>> = (0..3).map(contact).collect();
        for _ in 0..1000 {
            for c in &mut chain {
                let u = nodes.relative_velocity(&c.link, c.law.arms());
                let r = c.law.improve(LocalSolve::Exact, c.r, u);
                nodes.apply(&c.link, c.law.arms(), r - c.r);
                c.r = r;
            }
        }
        let fall = nodes.all.iter().filter(|node| node.velocity[2] < -1e-9).count();
        println!(
            "adhesion {adhesion:.3} N s: forces {:?}, {fall} fall",
            chain.iter().map(|c| c.r.n).collect::<Vec<_>>()
        );
        assert_eq!(fall, falls);
    }
}
