//! The commands end to end, as a user runs them: release builds, scenes from `configs/`, files in a
//! folder of their own.

mod accuracy;
mod bending;
mod cement;
mod collapse;
mod common;
mod compression;
mod elastic;
mod fclib;
mod fclib_global;
mod interrupt;
mod laboratory;
mod limit;
mod loads;
mod materials;
mod membrane;
mod next_event;
mod pack;
mod packings;
mod plates;
mod resume;
mod solves;
mod specimens;
mod stages;
mod sweep;
mod teaching;
mod wrong_history;
mod wrong_scene;
