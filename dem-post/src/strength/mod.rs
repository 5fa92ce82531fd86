//! Strength against a field of the scene, over many runs: the paper's figure 9, strength against cohesion, and the like for
//! rates, sizes, friction.
//!
//! **Strength** of a run is the load at a step that [`Measure`] names, each as the run's own
//! summary and `stress-strain` define it. The load is that of the load wall or, without a driven
//! wall, the only force on a grain. The measure is 5 % of the bonds broken unless told otherwise:
//! it is an event of the bonds, so it means the same for rigid and elastic bonds, under a
//! prescribed force and a prescribed motion. A strain of 1e-4 may be the solver's own where its
//! tolerance is coarse, and elastic bonds come to it whole; the first break is one weak bond; a
//! peak needs a load that can fall.
//!
//! **Samples.** Runs are grouped by the value of the varied field and by sample ([`scenes`] says how both are found). Runs of
//! one sample are not independent of each other: they are the same grains again. So beside the line through all points, whose
//! standard errors take every run as independent, each sample has a line of its own, and the intervals over the samples are
//! those of the mean of their slopes and intercepts.

pub use files::write;
pub use report::{Options, Report, read};
pub use runs::Measure;

mod files;
pub mod fit;
pub mod report;
pub mod runs;
pub mod scenes;
