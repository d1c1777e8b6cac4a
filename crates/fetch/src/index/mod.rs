//! Indexes of archives: coverage and checksums of kernels, listings of folders.

mod checksums;
mod kernels;
mod listing;

pub use checksums::{Checksums, checksums};
pub use kernels::{KernelRow, kernel_rows};
pub(crate) use listing::addresses;
pub use listing::{Listed, listing};
