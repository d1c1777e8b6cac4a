//! The fence around CSPICE, against real kernels.

mod spice_kernels;
mod spice_select;
mod spice_truth;
mod spice_write;
