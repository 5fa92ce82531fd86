//! The places of texts in a file. HDF5 up to 1.10 trusts the size and the place of a text in a
//! file; wrong values crash the process. So this module checks both before HDF5 reads the text.
//!
//! Texts lie in heaps ("GCOL", version 1), one after the other. Each has a header of 16 bytes
//! (index and size) and is padded to 8 bytes; index 0 is the free space. A dataset of texts holds
//! for each text its length (u32), the address of its heap (u64) and its index in the heap (u32).
//! Source: HDF5 File Format Specification, version 3, III.E and IV.B.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::FileExt;
use std::path::Path;

/// Bytes at the beginning of a file that contain its heaps: texts are written first.
const HEAD: u64 = 1 << 20;
/// Bytes of a reference to a text in a dataset.
const NAMED: usize = 16;

/// The texts of a file, which stays open: another file may take its path.
pub(super) struct Texts {
    file: File,
    /// Sizes of the texts, bytes, by the address of their heap and their index there.
    sizes: HashMap<(u64, u32), u64>,
}

impl Texts {
    /// Finds the texts of a file.
    ///
    /// # Errors
    /// Those of the operating system; for a text longer than its heap, a message with its place.
    pub fn find(path: &Path) -> io::Result<Result<Self, String>> {
        let (file, mut head) = (File::open(path)?, vec![]);
        (&file).take(HEAD).read_to_end(&mut head)?;
        let number = |at: usize| Some(u64::from_le_bytes(head.get(at..at + 8)?.try_into().ok()?));
        let mut sizes = HashMap::new();
        // HDF5 does not align heaps
        let heaps = head.windows(8).enumerate().filter(|(_, bytes)| *bytes == b"GCOL\x01\0\0\0");
        for (start, _) in heaps {
            let end = number(start + 8).unwrap_or(0).saturating_add(start as u64);
            let mut at = start + 16;
            // less than a header at the end of a heap is unused
            while let Some(size) = number(at + 8).filter(|_| at as u64 + 16 <= end) {
                let index = u32::from(u16::from_le_bytes([head[at], head[at + 1]]));
                let room = if index == 0 { size } else { (size.saturating_add(7) / 8 * 8).saturating_add(16) };
                if room == 0 || room > end - at as u64 {
                    return Ok(Err(format!("the text at byte {at} is longer than the room for texts")));
                }
                sizes.insert((start as u64, index), size);
                at += room as usize;
            }
        }
        Ok(Ok(Self { file, sizes }))
    }

    /// Whether the `count` references from byte `offset` of the file name texts in this list.
    ///
    /// # Errors
    /// Those of the operating system.
    pub fn hold(&self, offset: u64, count: usize) -> io::Result<bool> {
        let mut named = vec![0; NAMED * count];
        self.file.read_exact_at(&mut named, offset)?;
        let is_held = |text: &[u8; NAMED]| {
            let [a, b, c, d, heap @ .., e, f, g, h] = *text;
            let length = u64::from(u32::from_le_bytes([a, b, c, d]));
            let place = (u64::from_le_bytes(heap), u32::from_le_bytes([e, f, g, h]));
            // a text that was never written has no address
            length == 0 || self.sizes.get(&place).is_some_and(|size| length <= *size)
        };
        Ok(named.as_chunks::<NAMED>().0.iter().all(is_held))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A heap of `room` bytes at the start of a file, with one text of 25 bytes, and what follows.
    fn heap(room: u64) -> Vec<u8> {
        let mut file = b"GCOL\x01\0\0\0".to_vec();
        file.extend(room.to_le_bytes());
        file.extend([1, 0, 0, 0, 0, 0, 0, 0]);
        file.extend(25u64.to_le_bytes());
        file.extend([b'x'; 32]);
        file.extend([0xff; 64]);
        file
    }

    /// A file with a heap at byte `start`, and the place of a reference to its text.
    fn referring(start: u64) -> (Vec<u8>, u64) {
        let mut file = vec![0; start as usize];
        file.extend(heap(64));
        let reference = file.len() as u64;
        // length, address, index
        file.extend(25u32.to_le_bytes());
        file.extend(start.to_le_bytes());
        file.extend(1u32.to_le_bytes());
        (file, reference)
    }

    #[test]
    fn a_heap_may_begin_at_any_byte() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("heap");
        for start in 0..9u64 {
            let (file, reference) = referring(start);
            std::fs::write(&path, file).expect("write");
            let texts = Texts::find(&path).expect("read").expect("sound");
            assert!(texts.hold(reference, 1).expect("read"), "at byte {start}");
        }
    }

    #[test]
    fn another_file_at_the_path_changes_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let (path, new) = (folder.path().join("heap"), folder.path().join("new"));
        let (file, reference) = referring(0);
        std::fs::write(&path, file).expect("write");
        let texts = Texts::find(&path).expect("read").expect("sound");
        std::fs::write(&new, referring(8).0).expect("write");
        std::fs::rename(&new, &path).expect("replace");
        assert!(texts.hold(reference, 1).expect("read"));
        let replaced = Texts::find(&path).expect("read").expect("sound");
        assert!(!replaced.hold(reference, 1).expect("read"), "the reference lies elsewhere");
    }

    /// Less than 16 bytes at the end of a heap hold no header, so what follows is not read as one.
    #[test]
    fn the_end_of_a_heap_may_be_too_short_for_a_header() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("heap");
        for (room, sound) in [(64, true), (72, true), (80, false), (56, false)] {
            std::fs::write(&path, heap(room)).expect("write");
            let found = Texts::find(&path).expect("read");
            assert_eq!(found.is_ok(), sound, "{room}");
        }
    }
}
