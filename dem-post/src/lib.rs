//! Analyses of histories: cracks and fragments, acoustic emission, single bonds, force chains,
//! velocities, fabric, stress and strain; picture series, comparisons of two runs, strength and
//! failure envelope of many, and reports; companions for viewers.
//!
//! Each analysis is a module with a [`analysis::Analysis`], and an entry of [`ANALYSES`]. Its
//! functions read a [`dem_history::History`] into a report, and write the report as CSV, SVG and
//! PNG. Reports do not depend on files or drawings.

use analysis::Entry;

// the analyses
pub mod chains;
pub mod compare;
pub mod cracks;
pub mod emission;
pub mod envelope;
pub mod fabric;
pub mod film;
pub mod frames;
pub mod info;
pub mod pack;
pub mod report;
pub mod strength;
pub mod stress_strain;
pub mod velocities;
pub mod view;
pub mod why;

// their common parts
pub mod analysis;
pub mod check;
pub mod cli;
pub mod clock;
pub mod collapse;
pub mod extent;
pub mod fragments;
pub mod map;
pub mod moments;
pub mod options;
pub mod output;
pub mod section;
pub mod tensor;
pub mod title;

/// All analyses, in the order in which `--help` lists their commands.
pub const ANALYSES: &[Entry] = &[
    Entry::of::<info::Command>(),
    Entry::of::<cracks::Command>(),
    Entry::of::<why::Command>(),
    Entry::of::<emission::Command>(),
    Entry::of::<chains::Command>(),
    Entry::of::<fabric::Command>(),
    Entry::of::<velocities::Command>(),
    Entry::of::<frames::Command>(),
    Entry::of::<film::Command>(),
    Entry::of::<compare::Command>(),
    Entry::of::<report::Command>(),
    Entry::of::<strength::Command>(),
    Entry::of::<envelope::Command>(),
    Entry::of::<view::Command>(),
    Entry::of::<pack::Command>(),
    Entry::of::<stress_strain::Command>(),
];
