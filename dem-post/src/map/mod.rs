//! Maps of the sample: grains, walls, contacts and bonds, several moments side by side on one
//! scale.

pub use draw::{draw, draw_part, draw_view};
pub use eye::Perspective;
pub use legend::Key;
pub use material::Materials;
pub use panel::{Arrow, Link, Panel, Patch};
pub use sample::{Sample, View};
pub use scale::{Colour, Ramp, Scale};

mod arrow;
mod boxes;
mod draw;
mod eye;
mod frame;
mod legend;
mod material;
mod outline;
mod panel;
mod sample;
mod scale;
mod wall;
