//! The state of a world as plain numbers, and the world restored from them.
//!
//! The state does not include what the scene defines: shapes and drives of walls, loads, settings.
//! Nor does it include the list of candidate pairs: any list that is valid for a step gives the
//! same contacts.

use super::motion::{Midpoint, Turn};
use super::touch::StoredTouch;
use super::{Ledger, Settings, TouchStatus, World};
use crate::body::{Grains, Load, Wall};
use crate::bond::{Bond, BondStatus, Stiffness};
use crate::contact::Local;
use crate::dim::Dim;
use crate::saved::{Mismatch, Reader, Saved};

/// Code of "none" in place of the index of a bond or a wall.
const NONE: u64 = u64::MAX;

const BONDS: [BondStatus; 5] =
    [BondStatus::Intact, BondStatus::Tension, BondStatus::Shear, BondStatus::Rolling, BondStatus::Twist];
const TOUCHES: [TouchStatus; 4] = [TouchStatus::Open, TouchStatus::Stick, TouchStatus::Slip, TouchStatus::Bonded];

/// The value with the next code, which is its index in `all`.
fn coded<T: Copy>(all: &[T], from: &mut Reader) -> Result<T, Mismatch> {
    all.get(from.count()?).copied().ok_or(Mismatch)
}

fn code<T: PartialEq>(all: &[T], value: &T) -> usize {
    all.iter().position(|v| v == value).unwrap_or(all.len())
}

impl<D: Dim> Grains<D> {
    /// Write the grains.
    pub fn save(&self, to: &mut Saved) {
        to.count(self.len());
        to.vectors(&self.position);
        to.vectors(&self.velocity);
        to.vectors(&self.spin);
        to.vectors(&self.orientation);
        for column in [&self.radius, &self.mass, &self.inertia] {
            to.reals.extend_from_slice(column);
        }
        self.fixed.iter().for_each(|fixed| to.flag(*fixed));
    }

    /// The grains that [`Grains::save`] wrote.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn restored(from: &mut Reader) -> Result<Self, Mismatch> {
        let n = from.number_of()?;
        Ok(Self {
            position: from.vectors(n)?,
            velocity: from.vectors(n)?,
            spin: from.vectors(n)?,
            orientation: from.vectors(n)?,
            radius: from.reals(n)?.to_vec(),
            mass: from.reals(n)?.to_vec(),
            inertia: from.reals(n)?.to_vec(),
            fixed: (0..n).map(|_| from.flag()).collect::<Result<_, _>>()?,
            material: Vec::new(),
        })
    }
}

impl<D: Dim> World<D> {
    /// Write everything that changes from step to step; the grains come first.
    pub fn save(&self, to: &mut Saved) {
        self.grains.save(to);
        if self.settings.material_friction.is_some() {
            (0..self.grains.len()).for_each(|k| to.count(self.grains.material_of(k)));
        }
        to.count(self.steps as usize);
        to.real(self.time);
        to.real(self.load_time);
        to.real(self.reference_volume());
        to.vectors(&self.reference);
        to.count(self.walls.len());
        for wall in &self.walls {
            to.vectors(&[wall.position, wall.velocity, wall.reaction, wall.reaction_at_limit]);
            to.real(wall.applied);
        }
        to.count(self.held.len());
        self.held.iter().for_each(|wall| to.counts.push(wall.map_or(NONE, u64::from)));
        to.count(self.bonds.len());
        self.bonds.iter().for_each(|bond| save_bond(bond, to));
        to.vectors(&self.mid.grains);
        to.vectors(&self.mid.walls);
        to.real(self.last_part);
        to.count(self.turns.len());
        self.turns.iter().for_each(|turn| to.vectors(&[turn.bias, turn.owed]));
        to.count(self.stored.len());
        self.stored.iter().for_each(|stored| save_touch(stored, to));
        let l = &self.ledger;
        to.reals.extend([l.kinetic, l.external_work, l.impact, l.friction, l.bonds]);
        to.reals.extend([l.elastic, l.damping, l.fracture, l.remainder]);
        self.solver.save(to);
    }

    /// The world that [`World::save`] wrote: `grains` are already read, `from` holds the rest.
    /// `walls`, `loads` and `settings` are those of the scene; positions and velocities of the
    /// walls are restored.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn restored(
        mut grains: Grains<D>,
        walls: Vec<Wall<D>>,
        loads: Vec<Load<D>>,
        settings: Settings<D>,
        from: &mut Reader,
    ) -> Result<Self, Mismatch> {
        if let Some(table) = &settings.material_friction {
            let material = |_| {
                let place = from.count()?;
                u8::try_from(place).ok().filter(|_| place < table.count).ok_or(Mismatch)
            };
            grains.material = (0..grains.len()).map(material).collect::<Result<_, _>>()?;
        }
        // the grains that walls hold are saved: others may be near them by now
        let mut world = Self::holding(Vec::new(), grains, walls, loads, settings);
        let n = world.grains.len();
        world.steps = from.count()? as u64;
        (world.time, world.load_time) = (from.real()?, from.real()?);
        // the reference volume, which follows from the positions at time zero
        from.real()?;
        world.refer_to(from.vectors(n)?);
        if from.count()? != world.walls.len() {
            return Err(Mismatch);
        }
        for wall in &mut world.walls {
            (wall.position, wall.velocity) = (from.vector()?, from.vector()?);
            (wall.reaction, wall.reaction_at_limit) = (from.vector()?, from.vector()?);
            wall.applied = from.real()?;
        }
        world.held =
            (0..from.number_of()?).map(|_| restored_holder(world.walls.len(), from)).collect::<Result<_, _>>()?;
        let bonds: Vec<Bond> = (0..from.number_of()?).map(|_| restored_bond(n, from)).collect::<Result<_, _>>()?;
        world.bonds = bonds.into();
        let (bodies, bonds) = (n + world.walls.len(), world.bonds.len());
        world.mid = Midpoint { grains: from.vectors(n)?, walls: from.vectors(bodies - n)? };
        world.last_part = from.real()?;
        world.turns = (0..from.number_of()?)
            .map(|_| Ok(Turn { bias: from.vector()?, owed: from.vector()? }))
            .collect::<Result<_, _>>()?;
        world.stored = (0..from.number_of()?).map(|_| restored_touch(bodies, bonds, from)).collect::<Result<_, _>>()?;
        let mut next = || from.real();
        world.ledger = Ledger {
            kinetic: next()?,
            external_work: next()?,
            impact: next()?,
            friction: next()?,
            bonds: next()?,
            elastic: next()?,
            damping: next()?,
            fracture: next()?,
            remainder: next()?,
        };
        world.solver.restore(from)?;
        Ok(world)
    }
}

fn save_pair(pair: [u32; 2], to: &mut Saved) {
    pair.iter().for_each(|k| to.count(*k as usize));
}

fn restored_pair(bodies: usize, from: &mut Reader) -> Result<[u32; 2], Mismatch> {
    let pair = [from.count()?, from.count()?];
    if pair.iter().all(|k| *k < bodies) { Ok(pair.map(|k| k as u32)) } else { Err(Mismatch) }
}

fn restored_holder(walls: usize, from: &mut Reader) -> Result<Option<u32>, Mismatch> {
    match from.count()? {
        none if none as u64 == NONE => Ok(None),
        wall if wall < walls => Ok(Some(wall as u32)),
        _ => Err(Mismatch),
    }
}

fn save_bond(bond: &Bond, to: &mut Saved) {
    save_pair(bond.pair, to);
    to.reals.extend([bond.rest_gap, bond.mean_diameter, bond.strength, bond.shear, bond.rolling, bond.twist]);
    to.flag(bond.stiffness.is_some());
    if let Some(Stiffness { normal, tangential, rolling, twist }) = bond.stiffness {
        to.reals.extend([normal, tangential, rolling, twist]);
    }
    to.count(code(&BONDS, &bond.status));
}

fn restored_bond(grains: usize, from: &mut Reader) -> Result<Bond, Mismatch> {
    let pair = restored_pair(grains, from)?;
    let (rest_gap, mean_diameter, strength) = (from.real()?, from.real()?, from.real()?);
    let (shear, rolling, twist) = (from.real()?, from.real()?, from.real()?);
    let stiffness = match from.flag()? {
        true => {
            let (normal, tangential) = (from.real()?, from.real()?);
            Some(Stiffness { normal, tangential, rolling: from.real()?, twist: from.real()? })
        }
        false => None,
    };
    let status = coded(&BONDS, from)?;
    Ok(Bond { pair, rest_gap, mean_diameter, strength, shear, rolling, twist, stiffness, status })
}

fn save_touch<D: Dim>(stored: &StoredTouch<D>, to: &mut Saved) {
    save_pair(stored.pair, to);
    to.vector(&stored.tangents);
    to.counts.push(stored.bond().map_or(NONE, u64::from));
    to.real(stored.reaction.n);
    to.vector(&stored.reaction.t);
    to.vector(&stored.reaction.m);
    to.real(stored.yielded);
    to.real(f64::from(stored.left));
    to.count(code(&TOUCHES, &stored.status));
}

fn restored_touch<D: Dim>(bodies: usize, bonds: usize, from: &mut Reader) -> Result<StoredTouch<D>, Mismatch> {
    let pair = restored_pair(bodies, from)?;
    let tangents = from.vector()?;
    let bond = match from.count()? {
        none if none as u64 == NONE => None,
        bond if bond < bonds => Some(bond as u32),
        _ => return Err(Mismatch),
    };
    let reaction = Local { n: from.real()?, t: from.vector()?, m: from.vector()? };
    let (yielded, left) = (from.real()?, from.real()? as f32);
    let status = coded(&TOUCHES, from)?;
    Ok(StoredTouch { tangents, reaction, yielded, left, status, ..StoredTouch::new(pair, bond) })
}
