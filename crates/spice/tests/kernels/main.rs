//! The interface to CSPICE, tested with real kernels.

mod spice_kernels;
mod spice_select;
mod spice_truth;
mod spice_write;
