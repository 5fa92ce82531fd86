//! Packings that runs share: a folder with one file for each packing.
//!
//! The name of a file is the digest of the values that determine its packing. The file is a table
//! of grains as `sample.file` reads it, below four comments:
//!
//! ```text
//! # SHA-256 of the lines below: 9f86…
//! # packing 2c26…
//! # solid fraction 0.8237…
//! # unsettled none               or the displacement of the last step, in mean radii
//! x,y,radius
//! ```
//!
//! A file without these lines, of another packing, or whose content does not have its digest is not
//! used: the sample is packed again and the file replaced.

use crate::error::RunError;
use crate::output::{hex, lock, replace};
use crate::prepare::{METHOD, Packing, PrepareError, Watch, pack};
use crate::sample_file;
use crate::scene::{RandomSample, open_regular};
use dem_core::dim::Dim;
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;
use std::time::Duration;

/// Start of the first line of a file.
const SUM: &str = "# SHA-256 of the lines below: ";

/// Interval between two attempts to lock a packing that another process makes.
const PAUSE: Duration = Duration::from_millis(20);

/// The random packing of `sample` and `seed`: read from the folder, or packed and written there.
/// Processes that need the same packing at the same time wait for the first of them.
///
/// # Errors
/// The errors of [`pack`]; [`RunError::File`] for a folder or file that cannot be written.
pub fn obtain<D: Dim>(folder: &Path, sample: &RandomSample, seed: u64, watch: Watch) -> Result<Packing<D>, RunError> {
    let name = name::<D>(sample, seed)?;
    let path = folder.join(format!("{name}.csv"));
    if let Some(packing) = read(&path, &name) {
        return Ok(packing);
    }
    fs::create_dir_all(folder).map_err(|error| refused(folder, "cannot be created", error))?;
    let lock = path.with_extension("lock");
    let _held = claim(&lock, &mut *watch)?;
    // another process may have packed it in the meantime
    let packing = read(&path, &name).map_or_else(
        || {
            let packing = pack::<D>(sample, seed, watch)?;
            write(&path, &name, &packing)?;
            Ok(packing)
        },
        Ok,
    );
    // whoever then locks a new file reads the packing first, if there is one
    let _ = fs::remove_file(lock);
    packing
}

/// Digest of the values that determine a packing.
fn name<D: Dim>(sample: &RandomSample, seed: u64) -> serde_json::Result<String> {
    Ok(hex(&Sha256::digest(serde_json::to_vec(&(METHOD, D::N, seed, sample))?)))
}

/// The packing `name` in a file; none if the file is missing, damaged, or of another packing.
fn read<D: Dim>(path: &Path, name: &str) -> Option<Packing<D>> {
    let mut text = String::new();
    open_regular(path).ok()?.read_to_string(&mut text).ok()?;
    let (sum, content) = text.strip_prefix(SUM)?.split_once('\n')?;
    if sum != hex(&Sha256::digest(content)) {
        return None;
    }
    let content = content.strip_prefix("# packing ")?.strip_prefix(name)?;
    let (solid_fraction, content) = content.strip_prefix("\n# solid fraction ")?.split_once('\n')?;
    let (unsettled, table) = content.strip_prefix("# unsettled ")?.split_once('\n')?;
    Some(Packing {
        balls: sample_file::read_text::<D>(path, table).ok()?,
        solid_fraction: solid_fraction.parse().ok()?,
        unsettled: if unsettled == "none" { None } else { Some(unsettled.parse().ok()?) },
    })
}

/// Writes a packing; a reader finds the whole file or none.
fn write<D: Dim>(path: &Path, name: &str, packing: &Packing<D>) -> Result<(), RunError> {
    let unsettled = packing.unsettled.map_or("none".into(), |moved| moved.to_string());
    let fraction = packing.solid_fraction;
    let mut content = format!("# packing {name}\n# solid fraction {fraction}\n# unsettled {unsettled}\n").into_bytes();
    sample_file::write_to::<D>(packing.balls.iter().copied(), (&[], &[]), &mut content)?;
    let sum = format!("{SUM}{}\n", hex(&Sha256::digest(&content)));
    let file = [sum.into_bytes(), content].concat();
    replace::write(path, &file).map_err(|error| refused(path, "cannot be written", error))
}

/// Waits for the lock of a packing. The lock is released when its process ends, also by a crash.
fn claim(path: &Path, watch: Watch) -> Result<File, RunError> {
    let failed = |error| refused(path, "cannot be locked", error);
    let file = lock::open(path).map_err(failed)?;
    // on a file system without locks each process packs, and the last file stays
    while !lock::try_lock(&file).map_err(failed)? {
        if !watch(0.0) {
            return Err(PrepareError::Interrupted.into());
        }
        std::thread::sleep(PAUSE);
    }
    Ok(file)
}

fn refused(path: &Path, doing: &'static str, error: std::io::Error) -> RunError {
    RunError::File { path: path.into(), doing, source: error.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Compaction, Cut, Diameters, Preparation, Section, UniformRange};
    use dem_core::dim::{D2, D3, D3Twist, Vect};
    use std::cell::Cell;

    fn sample() -> RandomSample {
        RandomSample {
            count: 12,
            diameter: Diameters::Uniform(UniformRange { min: 1e-3, max: 3e-3 }),
            section: Section::Rectangle,
            width: 8e-3,
            depth: None,
            preparation: Preparation::Compaction(Compaction { solid_fraction: 0.1 }),
            cut: None,
        }
    }

    /// The packing of seed 3 by way of a folder, and whether it was packed.
    fn obtained<D: Dim>(folder: &Path) -> (Vec<u64>, bool) {
        let packed = Cell::new(false);
        let packing = obtain::<D>(folder, &sample(), 3, &mut |_| {
            packed.set(true);
            true
        });
        (bits(&packing.expect("a packing")), packed.get())
    }

    fn bits<D: Dim>(packing: &Packing<D>) -> Vec<u64> {
        let balls = packing.balls.iter().flat_map(|(x, r)| x.as_slice().iter().chain([r]).copied().collect::<Vec<_>>());
        balls.chain([packing.solid_fraction]).chain(packing.unsettled).map(f64::to_bits).collect()
    }

    fn files(folder: &Path) -> Vec<std::path::PathBuf> {
        fs::read_dir(folder).expect("folder").map(|entry| entry.expect("entry").path()).collect()
    }

    fn comes_back<D: Dim>() {
        let folder = tempfile::tempdir().expect("folder");
        let folder = folder.path().join("new");
        let packed = pack::<D>(&sample(), 3, &mut |_| true).expect("a packing");
        assert_eq!(obtained::<D>(&folder), (bits(&packed), true));
        assert_eq!(obtained::<D>(&folder), (bits(&packed), false));
        let [file] = &files(&folder)[..] else { panic!("one file: {:?}", files(&folder)) };
        assert_eq!(sample_file::read::<D>(file, &[]).expect("a sample file").balls, packed.balls);
        // how far a packing still moved comes back too
        let moving = Packing { unsettled: Some(1.0 / 3.0), ..packed };
        write(file, "another", &moving).expect("written");
        assert_eq!(read::<D>(file, "another").map(|packing| bits(&packing)), Some(bits(&moving)));
        assert!(read::<D>(file, "a").is_none() && read::<D>(file, "other").is_none());
    }

    #[test]
    fn a_packing_comes_back_to_the_bit_and_is_made_once() {
        comes_back::<D2>();
        comes_back::<D3>();
    }

    #[test]
    fn a_damaged_file_is_made_again() {
        let folder = tempfile::tempdir().expect("folder");
        let (good, _) = obtained::<D2>(folder.path());
        let [file] = &files(folder.path())[..] else { panic!("one file") };
        let whole = fs::read(file).expect("read");
        let digit = whole.iter().rposition(|byte| *byte == b'1').expect("a digit");
        let mut altered = whole.clone();
        altered[digit] = b'2';
        let middle = whole.len() / 2;
        for damaged in [&b""[..], &whole[..middle], &altered, b"x,y,radius\n0,0,1\n", b"\xff\xfe"] {
            fs::write(file, damaged).expect("write");
            assert_eq!(obtained::<D2>(folder.path()), (good.clone(), true));
            assert_eq!(fs::read(file).expect("read"), whole);
        }
    }

    #[test]
    fn processes_that_need_one_packing_make_it_once() {
        let folder = tempfile::tempdir().expect("folder");
        let packed: Vec<(Vec<u64>, bool)> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..6)
                .map(|_| {
                    scope.spawn(|| {
                        // one that waits is told 0 each time; one that packs gets beyond
                        let packed = Cell::new(false);
                        let packing = obtain::<D2>(folder.path(), &sample(), 3, &mut |done| {
                            packed.set(packed.get() || done > 0.0);
                            true
                        });
                        (bits(&packing.expect("a packing")), packed.get())
                    })
                })
                .collect();
            threads.into_iter().map(|thread| thread.join().expect("a thread")).collect()
        });
        assert!(packed.iter().all(|(bits, _)| *bits == packed[0].0));
        assert_eq!(packed.iter().filter(|(_, packed)| *packed).count(), 1);
        assert_eq!(files(folder.path()).len(), 1, "no lock is left");
    }

    #[test]
    fn a_packing_that_fails_leaves_no_lock() {
        let folder = tempfile::tempdir().expect("folder");
        let failed = obtain::<D2>(folder.path(), &sample(), 3, &mut |_| false);
        assert!(failed.is_err());
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }

    #[test]
    fn who_waits_can_be_interrupted() {
        let folder = tempfile::tempdir().expect("folder");
        let lock = folder.path().join("a.lock");
        let _held = claim(&lock, &mut |_| true).expect("a lock");
        let waiting = claim(&lock, &mut |_| false).expect_err("locked");
        assert!(matches!(waiting, RunError::Interrupted(_)), "{waiting}");
    }

    #[test]
    fn the_name_is_of_all_that_determines_a_packing() {
        let plain = sample();
        let others = [
            RandomSample { count: 13, ..plain.clone() },
            RandomSample { diameter: Diameters::Constant(2e-3), ..plain.clone() },
            RandomSample { section: Section::Circle, ..plain.clone() },
            RandomSample { width: 9e-3, ..plain.clone() },
            RandomSample { depth: Some(8e-3), ..plain.clone() },
            RandomSample { preparation: Preparation::Compaction(Compaction { solid_fraction: 0.2 }), ..plain.clone() },
            RandomSample { cut: Some(Cut::Circle(5e-3)), ..plain.clone() },
        ];
        let mut names: Vec<String> = others.iter().map(|other| name::<D3>(other, 3).expect("a name")).collect();
        names.extend([name::<D3>(&plain, 3), name::<D3>(&plain, 4), name::<D2>(&plain, 3)].map(|n| n.expect("a name")));
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
        // bonds that resist twist do not change a packing
        assert_eq!(name::<D3>(&plain, 3).expect("a name"), name::<D3Twist>(&plain, 3).expect("a name"));
        let [plain, twist] = [
            bits(&pack::<D3>(&plain, 3, &mut |_| true).expect("a packing")),
            bits(&pack::<D3Twist>(&plain, 3, &mut |_| true).expect("a packing")),
        ];
        assert_eq!(plain, twist);
    }
}
