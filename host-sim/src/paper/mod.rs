//! What the papers measured, and the same measured here.

pub mod cpp;
mod cpp_data;
mod cpp_figures;
mod cpp_rows;
