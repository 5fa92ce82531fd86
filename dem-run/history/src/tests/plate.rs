//! Plates: walls with sides.

use super::*;

/// The layout of [`full`] with a plate.
fn with_plate(dimension: usize) -> Layout {
    let mut l = full(dimension);
    let (side, width) = if dimension == 2 { ([1.0, 0.0, 0.0], 0.0) } else { ([0.0, 0.0, 1.0], 0.75) };
    let normal = [0.0, 1.0, 0.0];
    l.walls.push(Wall {
        name: "plate".into(),
        kind: WallKind::Plate,
        normal,
        side,
        length: 0.25,
        width,
        ..Wall::default()
    });
    l
}

#[test]
fn the_sides_of_a_plate_are_read_as_written() {
    for dimension in [2, 3] {
        let (_folder, path) = folder();
        let l = with_plate(dimension);
        write(&path, &l, 3).finish().unwrap();
        check(&path, &l, 3);
    }
}

#[test]
fn a_history_without_plates_has_no_sides() {
    let present = |l: &Layout| {
        let (_folder, path) = folder();
        write(&path, l, 1).finish().unwrap();
        let walls = hdf5::File::open(&path).unwrap().group("walls").unwrap();
        ["side", "length", "width"].map(|name| walls.link_exists(name))
    };
    assert_eq!(present(&full(3)), [false; 3]);
    assert_eq!(present(&with_plate(2)), [true, true, false]);
    assert_eq!(present(&with_plate(3)), [true; 3]);
}
