//! A dense BRDF of any channels where colours are wanted.

use crate::remarks;
use anyhow::{Result, anyhow};
use gonia_formats::dense::read_dense_channels;
use gonia_pipeline::colours_of;
use gonia_rig::{DenseChannels, DenseFile};
use std::path::Path;

/// Reads a dense BRDF as colours: one value as a grey, bands by the standard observer. What is to be said of that is
/// printed.
pub fn read_colours(path: &Path) -> Result<DenseFile> {
    colours(read_dense_channels(path)?, path)
}

/// [`read_colours`] of one that was read.
pub fn colours(file: DenseChannels, path: &Path) -> Result<DenseFile> {
    let (dense, said) = colours_of(file, path).ok_or_else(|| {
        anyhow!(
            "{}: its planes differ in size; make it again",
            path.display()
        )
    })?;
    remarks::print(&said);
    Ok(dense)
}
