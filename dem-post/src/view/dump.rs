//! Dumps in the text format of LAMMPS, which OVITO reads: grains with their radii, and the bonds
//! and contacts between grains as pairs of their numbers.

use std::io::Write;

use dem_history::{BondStatus, Bonds, Grains, History};
use dem_output::shortest;

use super::outline::Outline;
use super::report::Report;
use crate::extent::{box_around, range};
use crate::output::{Folder, PostError, Result, WriteError, progress};

/// Writes a file of each kind with all frames.
///
/// # Errors
/// [`PostError::Write`], and those of reading the history.
pub(super) fn write(history: &History, report: &mut Report, folder: &mut Folder, quiet: bool) -> Result<()> {
    let (grains, bonds) = (history.grains()?, history.bonds()?);
    let Report { companions, outline, .. } = report;
    let all = (history.frames() * companions.len()) as u64;
    let bar = progress(all, quiet, "{bar:24} {percent} % written, {eta} left");
    for companion in companions {
        companion.bytes = folder.make(companion.name, |path| {
            let failed = |error: std::io::Error| WriteError { path: path.into(), why: error.to_string() };
            let mut file = std::io::BufWriter::new(std::fs::File::create(path).map_err(failed)?);
            let mut bytes = 0;
            for frame in 0..history.frames() {
                let text = match companion.name {
                    "grains.dump" => grains_of(history, &grains, frame)?,
                    "contacts.dump" => contacts_of(history, &grains, frame, outline)?,
                    _ => bonds_of(history, &grains, &bonds, frame)?,
                };
                file.write_all(text.as_bytes()).map_err(failed)?;
                bytes += text.len() as u64;
                bar.inc(1);
            }
            file.flush().map_err(failed)?;
            Ok::<_, PostError>(bytes)
        })?;
    }
    bar.finish_and_clear();
    Ok(())
}

/// The head of a frame: time, step, number of rows and the box around the grains at `position`.
fn head(history: &History, grains: &Grains, frame: usize, position: &[f64], rows: usize, of: &str) -> String {
    let mut text = format!(
        "ITEM: TIME\n{}\nITEM: TIMESTEP\n{}\nITEM: NUMBER OF {of}\n{rows}\nITEM: BOX BOUNDS ss ss ss\n",
        shortest(history.times()[frame]),
        history.steps()[frame]
    );
    let mut ends = box_around(&grains.radius, position, history.dimension());
    if ends.len() == 2 {
        // disks are drawn as spheres
        let [_, largest] = range(grains.radius.iter().copied());
        ends.push([-largest, largest]);
    }
    ends.iter().for_each(|ends| text += &line(ends));
    text
}

/// Numbers with blanks between them, as a line.
fn line(numbers: &[f64]) -> String {
    let cells: Vec<String> = numbers.iter().map(|number| shortest(*number)).collect();
    cells.join(" ") + "\n"
}

fn grains_of(history: &History, grains: &Grains, frame: usize) -> Result<String> {
    let (state, d, n) = (history.grain_state(frame)?, history.dimension(), grains.radius.len());
    let turning = !state.angular_velocity.is_empty();
    let turns = match d {
        2 => " omegaz angle",
        _ => " omegax omegay omegaz quatw quati quatj quatk",
    };
    let mut text = head(history, grains, frame, &state.position, n, "ATOMS");
    text += "ITEM: ATOMS id type radius mass x y z vx vy vz";
    text += if turning { turns } else { "" };
    text += "\n";
    for grain in 0..n {
        // types are counted from 1
        let kind = grains.material.get(grain).map_or(1, |&material| u32::from(material) + 1);
        text += &format!("{} {kind} ", grains.id[grain]);
        let mut numbers = vec![grains.radius[grain], grains.mass[grain]];
        for vectors in [&state.position, &state.velocity] {
            let vector = &vectors[grain * d..(grain + 1) * d];
            numbers.extend((0..3).map(|k| vector.get(k).copied().unwrap_or(0.0)));
        }
        if turning {
            let row = |values: &[f64], width: usize| values[grain * width..(grain + 1) * width].to_vec();
            numbers.extend(row(&state.angular_velocity, if d == 2 { 1 } else { 3 }));
            numbers.extend(row(&state.orientation, if d == 2 { 1 } else { 4 }));
        }
        text += &line(&numbers);
    }
    Ok(text)
}

/// The bonds that hold.
fn bonds_of(history: &History, grains: &Grains, bonds: &Bonds, frame: usize) -> Result<String> {
    // before a stage forms the bonds there is no status
    let status = history.bond_status(frame)?;
    let intact: Vec<usize> = (0..status.len()).filter(|&bond| status[bond] == BondStatus::Intact).collect();
    let position = history.grain_state(frame)?.position;
    let mut text = head(history, grains, frame, &position, intact.len(), "ENTRIES");
    text += "ITEM: ENTRIES index batom1 batom2 strength\n";
    for bond in intact {
        let [i, j] = bonds.pair[bond].map(|grain| grains.id[grain as usize]);
        text += &format!("{bond} {i} {j} {}\n", shortest(bonds.strength[bond]));
    }
    Ok(text)
}

/// The contacts between two grains: a wall has no number that OVITO knows.
fn contacts_of(history: &History, grains: &Grains, frame: usize, outline: &Outline) -> Result<String> {
    let contacts = history.contacts(frame)?;
    let between: Vec<usize> = (0..contacts.len()).filter(|&c| contacts.pair[c][1] >= 0).collect();
    let position = history.grain_state(frame)?.position;
    let mut text = head(history, grains, frame, &position, between.len(), "ENTRIES");
    text += "ITEM: ENTRIES index patom1 patom2 status gap";
    text += match outline.reaction_rows {
        0 => "\n",
        1 => " normal_force\n",
        _ => " normal_force tangential_force\n",
    };
    for c in between {
        let [i, j] = contacts.pair[c].map(|grain| grains.id[grain as usize]);
        text += &format!("{c} {i} {j} {} ", contacts.status[c] as u8);
        let mut numbers = vec![contacts.gap[c]];
        if outline.reaction_rows > 0 {
            numbers.push(contacts.normal_force(c));
        }
        if outline.reaction_rows > 1 {
            numbers.push(contacts.tangential_force(c));
        }
        text += &line(&numbers);
    }
    Ok(text)
}
