//! Why a run ended.

use super::*;

#[test]
fn a_history_tells_why_its_run_ended_and_copies_keep_it() {
    let (folder, path) = folder();
    let mut writer = write(&path, &bare(), 2);
    assert_eq!(History::open(&path).unwrap().ending().unwrap(), Ending::Open);
    writer.ending(Ending::NoConvergence).unwrap();
    writer.finish().unwrap();
    let history = History::open(&path).unwrap();
    assert_eq!(history.ending().unwrap(), Ending::NoConvergence);
    let packed = folder.path().join("packed.h5");
    copy(&history, &packed, CopyAs::Packed, &mut |_| true).unwrap();
    assert_eq!(History::open(&packed).unwrap().ending().unwrap(), Ending::NoConvergence);
}

#[test]
fn a_file_of_an_earlier_program_does_not_tell_why_its_run_ended() {
    let (_folder, path) = folder();
    write(&path, &bare(), 1).finish().unwrap();
    hdf5::File::open_rw(&path).unwrap().unlink("ending").unwrap();
    assert_eq!(History::open(&path).unwrap().ending().unwrap(), Ending::Open);
}

#[test]
fn an_ending_that_is_none_is_refused() {
    let (_folder, path) = folder();
    write(&path, &bare(), 1).finish().unwrap();
    let file = hdf5::File::open_rw(&path).unwrap();
    file.dataset("ending").unwrap().write_scalar(&crate::ending::EndingCode(77)).unwrap();
    drop(file);
    assert!(matches!(History::open(&path).unwrap().ending(), Err(HistoryError::Damaged { .. })));
}
