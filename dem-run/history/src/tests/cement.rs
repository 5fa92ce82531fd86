//! Histories whose bonds form in a stage.

use super::*;

/// The layout of [`full`] before its bonds form, and the bonds that form after step 10.
fn later() -> (Layout, Bonds) {
    let l = full(2);
    let bonds = Bonds { formed: Some(10), ..l.bonds };
    (Layout { bonds: Bonds { formed: Some(NOT_FORMED), ..Bonds::default() }, ..full(2) }, bonds)
}

/// Writes frame `k`: up to step 10 without bonds, then with those of [`full`].
fn frame(writer: &mut Writer, k: usize) {
    let s = sample(&full(2), k);
    let mut contacts = s.contacts;
    let bonds = if k > 1 { s.bonds } else { vec![] };
    if bonds.is_empty() {
        contacts.bond.iter_mut().for_each(|bond| *bond = -1);
    }
    let (step, time) = (10 * k as i64, 0.1 * k as f64);
    writer.frame(&Frame { step, time, grains: s.grains, walls: s.walls, contacts, bonds }).unwrap();
}

/// States of the bonds in each frame.
fn states(h: &History) -> Vec<Vec<BondStatus>> {
    (0..h.frames()).map(|k| h.bond_status(k).unwrap()).collect()
}

#[test]
fn bonds_that_form_later_are_read_from_then_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.h5");
    let (l, bonds) = later();
    let mut writer = Writer::create(&path, &l, false).unwrap();
    frame(&mut writer, 0);
    frame(&mut writer, 1);
    // a run that goes on: no bonds yet
    let h = History::open(&path).unwrap();
    assert_eq!((h.layout().unwrap().bonds, states(&h)), (l.bonds.clone(), vec![vec![]; 2]));
    writer.bonds_formed(&bonds).unwrap();
    frame(&mut writer, 2);
    writer.rupture(&rupture(3)).unwrap();
    frame(&mut writer, 3);
    let checkpoint = Checkpoint { step: 10, reals: vec![1.0], counts: vec![2] };
    writer.checkpoint(&checkpoint).unwrap();
    assert!(writer.bonds_formed(&bonds).is_err(), "bonds form once");
    writer.finish().unwrap();
    let expected = vec![vec![], vec![], sample(&full(2), 2).bonds, sample(&full(2), 3).bonds];
    let h = History::open(&path).unwrap();
    assert_eq!((h.bonds().unwrap(), states(&h)), (bonds.clone(), expected.clone()));
    assert_eq!(h.ruptures().unwrap(), [rupture(3)]);

    let axis = |path: &Path| hdf5::File::open(path).unwrap().dataset("bond").unwrap().shape();
    assert_eq!(axis(&path), [0]);
    // packed, and continued from before or after the bonds formed, whatever came later
    let packed = folder.path().join("b.h5");
    copy(&h, &packed, CopyAs::Packed, &mut |_| true).unwrap();
    assert_eq!(states(&History::open(&packed).unwrap()), expected);
    for frames in [1, 2, 3] {
        let kept = h.complete_at(frames).unwrap();
        let formed = frames > 2;
        let layout = Layout { bonds: if formed { bonds.clone() } else { l.bonds.clone() }, ..l.clone() };
        let again = folder.path().join(format!("{frames}.h5"));
        let mut writer = Writer::go_on(&again, &layout, &h, kept, &checkpoint, &mut |_| true).unwrap();
        (frames..2).for_each(|k| frame(&mut writer, k));
        if !formed {
            writer.bonds_formed(&bonds).unwrap();
            frame(&mut writer, 2);
        }
        writer.rupture(&rupture(3)).unwrap();
        frame(&mut writer, 3);
        writer.finish().unwrap();
        assert_eq!(axis(&again), [0]);
        let again = History::open(&again).unwrap();
        assert_eq!((again.bonds().unwrap(), states(&again)), (bonds.clone(), expected.clone()), "after {frames}");
        assert_eq!(again.ruptures().unwrap(), [rupture(3)]);
        assert_eq!(again.contacts(3).unwrap(), h.contacts(3).unwrap());
    }
}
