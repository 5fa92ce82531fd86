//! States from which runs resume, and files that another program overwrote meanwhile.

use super::*;

/// Another program that empties or overwrites the file leaves its name and its inode.
#[test]
fn a_file_that_was_emptied_or_overwritten_is_noticed() {
    for content in [vec![], vec![7; 5000], b"\x89HDF\r\n\x1a\n".to_vec()] {
        let (_folder, path) = folder();
        let layout = full(2);
        let mut writer = write(&path, &layout, 2);
        let file = fs::OpenOptions::new().write(true).truncate(true).open(&path).unwrap();
        std::os::unix::fs::FileExt::write_all_at(&file, &content, 0).unwrap();
        let Sample { grains, walls, contacts, bonds } = sample(&layout, 2);
        let frame = Frame { step: 20, time: 0.2, grains, walls, contacts, bonds };
        assert!(matches!(writer.frame(&frame), Err(HistoryError::Gone { .. })));
    }
}

/// A run that is resumed from a state between two frames has rows beyond its last frame.
#[test]
fn a_state_beyond_the_last_frame_has_its_rows() {
    let (folder, path) = folder();
    let layout = full(2);
    let width: usize = layout.observables.iter().map(Observable::width).sum();
    let mut writer = Writer::create(&path, &layout, false).unwrap();
    let observe = |writer: &mut Writer, steps: std::ops::RangeInclusive<i64>| {
        steps.for_each(|step| writer.observe(step, 0.01 * step as f64, &numbers(width, step as f64)).unwrap());
    };
    write_frame(&mut writer, &layout, 0);
    observe(&mut writer, 1..=10);
    write_frame(&mut writer, &layout, 1);
    observe(&mut writer, 11..=14);
    for step in [12, 16] {
        writer.rupture(&Rupture { step, ..rupture(1) }).unwrap();
    }
    let state = |step| Checkpoint { step, reals: vec![0.5; 3], counts: vec![step as u64; 2] };
    writer.checkpoint(&state(14)).unwrap();
    writer.checkpoint(&state(16)).unwrap();
    writer.finish().unwrap();
    let history = History::open(&path).unwrap();
    let complete = history.complete().unwrap();
    assert_eq!((complete.steps, complete.events), (10, 0));
    assert_eq!(history.complete_to(10).unwrap(), Some(complete));
    assert_eq!(history.complete_to(14).unwrap(), Some(RowCounts { steps: 14, events: 1, ..complete }));
    assert_eq!(history.complete_to(15).unwrap(), None);
    // the newest state lacks its steps
    assert_eq!(history.checkpoint().unwrap(), Some(state(14)));
    let copied = folder.path().join("copy.h5");
    copy(&history, &copied, CopyAs::Packed, &mut |_| true).unwrap();
    let copied = History::open(&copied).unwrap();
    assert_eq!((copied.complete().unwrap(), copied.checkpoint().unwrap()), (complete, Some(state(14))));
    assert_eq!(copied.complete_to(14).unwrap(), history.complete_to(14).unwrap());
}

#[test]
fn of_two_checkpoints_the_newest_whole_one_counts() {
    let (_folder, path) = folder();
    let layout = full(2);
    let mut writer = write(&path, &layout, 4);
    let checkpoint = |step| Checkpoint { step, reals: numbers(50, step as f64), counts: vec![step as u64; 9] };
    for step in [0, 10, 20, 30] {
        writer.checkpoint(&checkpoint(step)).unwrap();
    }
    writer.finish().unwrap();
    let newest = || History::open(&path).unwrap().checkpoint().unwrap();
    assert_eq!(newest(), Some(checkpoint(30)));
    // a checkpoint that was being written when the run was killed
    let file = hdf5::File::open_rw(&path).unwrap();
    file.dataset("checkpoint/reals_1").unwrap().write_slice(&[7.5], 3..4).unwrap();
    drop(file);
    assert_eq!(newest(), Some(checkpoint(20)));
    let file = hdf5::File::open_rw(&path).unwrap();
    file.dataset("checkpoint/counts_0").unwrap().write_slice(&[1u64], 8..9).unwrap();
    drop(file);
    assert_eq!(newest(), None);
}
