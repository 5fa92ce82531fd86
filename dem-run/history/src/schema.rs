//! Names and chunk sizes of the layout; the layout itself and its version are in `lib.rs`.

/// The program's name as `/h5md/creator` records it.
pub(super) const CREATOR: &str = "dem-run";

/// The observable that is an enumeration: the method that solved each step.
pub const ROUTE: &str = "solver_route";
/// The observable that is NaN in a step whose solves do not report it.
pub const LOAD_ERROR: &str = "solver_load_error";
/// The observable added in version 4; before, the load error held either quantity.
pub const FALSE_ACCELERATION: &str = "false_acceleration";

/// Paths in the file.
pub(super) mod path {
    pub const CHECKPOINT: &str = "checkpoint";
    pub const COMMIT: &str = "commit";
    pub const COMMIT_CONTACTS: &str = "commit_rows/contacts";
    pub const COMMIT_EVENTS: &str = "commit_rows/events";
    pub const COMMIT_STEPS: &str = "commit_rows/steps";
    pub const GRAINS: &str = "particles/grains";
    pub const MATERIALS: &str = "materials/name";
    pub const WALLS: &str = "walls";
    pub const CONTACTS: &str = "contacts";
    pub const BONDS: &str = "bonds";
    pub const ENDING: &str = "ending";
    pub const FORMED: &str = "bonds/formed";
    pub const RUPTURE: &str = "events/rupture";
    pub const OBSERVABLES: &str = "observables";
    pub const PARAMETERS: &str = "parameters";
    pub const SCENE: &str = "parameters/scene";
    pub const EARLIER_SCENES: &str = "parameters/earlier_scenes";
}

/// Bytes across one row of a chunk, about 500 doubles.
const CHUNK_ROW: usize = 4000;
/// Bytes of a chunk, about 16 such rows.
const CHUNK: usize = 16 * CHUNK_ROW;

/// The chunk of a dataset that grows by whole frames: `[rows, first extents of one frame…]`.
///
/// A frame of a large sample is split so that 16 frames fill a chunk; a chunk of a small sample
/// holds more frames.
pub(super) fn frame_chunk(item: usize, row: &[usize]) -> Vec<usize> {
    let inner: usize = row.iter().skip(1).product::<usize>().max(1);
    let across = row.first().map_or(1, |&n| n.min((CHUNK_ROW / (inner * item)).max(1)));
    let rows = (CHUNK / (across * inner * item)).clamp(16, 256);
    let mut chunk = vec![rows];
    chunk.extend(row);
    if let Some(first) = chunk.get_mut(1) {
        *first = across;
    }
    chunk
}

/// The chunk of a dataset that grows by about `rows` rows every 16 frames.
pub(super) fn row_chunk(rows: usize, item: usize, row: &[usize]) -> Vec<usize> {
    let width: usize = row.iter().product::<usize>().max(1) * item;
    let mut chunk = vec![rows.clamp(64, (4 * CHUNK / width).max(64))];
    chunk.extend(row);
    chunk
}

/// Slots and bytes of the chunk cache of each dataset, for `grains` grains. The cache holds exactly
/// the chunks to which a frame is appended. A smaller cache would evict and reload partly filled
/// chunks at every frame; a larger one is slower, because every append and every flush scans the
/// whole cache. (This is a setting of the file: single-writer mode ignores settings of datasets.)
pub(super) fn chunk_cache(grains: usize, dimension: usize) -> (usize, usize) {
    // positions (2D) or quaternions (3D) are the widest
    let chunk = frame_chunk(8, &[grains, if dimension == 2 { 2 } else { 4 }]);
    let band = grains.div_ceil(chunk[1]);
    let bytes = 8 * band * chunk.iter().product::<usize>();
    (2 * band + 1, bytes.max(8 * CHUNK))
}
