//! Readers of PEDR files, labels and images: real files, damaged ones, arbitrary bytes.

mod moc_image;
mod pds_archive;
mod pds_labels;
mod pds_pedr;
mod pds_pedr_arbitrary;
