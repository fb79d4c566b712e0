//! Tables and figures of papers, recomputed here beside the paper's own values.

pub mod cpp;
mod cpp_data;
mod cpp_figures;
mod cpp_rows;
