//! Elastic laws, one file each, and the verdict on their constants.

pub mod mooney_rivlin;

pub use mooney_rivlin::MooneyRivlin;
