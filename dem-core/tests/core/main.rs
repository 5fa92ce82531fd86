//! Worlds and problems against closed forms, conservation laws and independent solvers. They are
//! one program, since generic code is compiled anew for each program.

mod assembled;
mod certificate;
mod closed_forms;
mod clusters;
mod common;
mod cone;
mod conservation;
mod detection;
mod determinism;
mod elastic;
mod golden;
mod lemke;
mod limit_load;
mod maps;
mod measures;
mod membrane;
mod newton;
mod next_event;
mod oracle;
mod plates;
mod residual;
mod rupture;
mod spheres;
mod stability;
mod state;
mod stiff_bonds;
mod stiff_limit;
mod turning;
mod walls;
