//! Analyses of histories: cracks and fragments, force chains, velocities, stress and strain; picture series,
//! comparisons of two runs, strength over many, and reports; companions for viewers.
//!
//! Each analysis has a module with a function that reads a [`dem_history::History`] and returns a report, and a
//! function that writes the report as CSV, SVG and PNG. Reports know nothing of files or drawings.

pub mod chains;
pub mod check;
pub mod cli;
pub mod collapse;
pub mod compare;
pub mod cracks;
pub mod fragments;
pub mod frames;
pub mod info;
pub mod map;
pub mod moments;
pub mod output;
pub mod pack;
pub mod report;
pub mod strength;
pub mod stress_strain;
pub mod velocities;
pub mod view;

use dem_drawing as plot;
use dem_output::row;
