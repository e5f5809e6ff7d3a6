//! From a capture folder to a dense BRDF, and a value of it.
//!
//! `gonia demo --quick` leaves such a folder: `cargo run --release -p gonia-pipeline --example
//! capture_folder -- gonia-demo`. Without a folder one of 111 poses is rendered first.

use gonia_brdf::Direction;
use gonia_pipeline::{FillOptions, fill, samples_of_folder, silent};
use std::error::Error;
use std::path::Path;

mod rendered_folder;

fn main() -> Result<(), Box<dyn Error>> {
    match std::env::args().nth(1) {
        Some(folder) => measure(folder.as_ref()),
        None => measure(rendered_folder::make()?.path()),
    }
}

// ANCHOR: measure
fn measure(folder: &Path) -> Result<(), Box<dyn Error>> {
    let measured = samples_of_folder(folder, &silent)?.into_sample_set();
    let options = FillOptions::with_step_deg(10.0);
    let filled = fill(measured.samples, measured.scale, &options, &silent)?;
    let light = Direction::from_deg(30.0, 45.0);
    let view = Direction::from_deg(60.0, 225.0);
    let rgb = filled.dense.lookup(light, view);
    println!("f = {rgb:.4?}, {}", filled.dense.scale);
    Ok(())
}
// ANCHOR_END: measure

#[test]
fn a_rendered_folder_is_measured() {
    main().unwrap();
}
