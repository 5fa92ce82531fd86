//! Analyses of histories.
