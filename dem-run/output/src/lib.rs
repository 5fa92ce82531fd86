//! Output of results: tables on stdout, files in one folder, each replaced atomically.

pub mod command_line;
mod error;
mod folder;
pub mod lock;
mod owner;
mod print;
pub mod replace;
mod text;

pub use error::{Result, WriteError};
pub use folder::{Folder, Picture, Print, Printed, default_folder};
pub use owner::Source;
pub use print::{escaped, in_shell, print, print_json, print_line, print_result};
pub use text::{Cell, Text, cell, counted, facts, hex, listed, number, plain, quantity, short, shortest, size};
