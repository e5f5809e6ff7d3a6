//! Samples of an analytic material as the paper's plan sees it, and the truth, as files for
//! `gonia fill`, `gonia chart` and bench/baselines.
//!
//! `cargo run --release -p gonia-pipeline --example analytic -- MATERIAL DIR` (matte, broad, fabric, sharp,
//! sharper) writes `DIR/MATERIAL.npy` and `DIR/MATERIAL-truth.exr`.

// The benches use all of it.
#[allow(dead_code)]
#[path = "../../brdf/benches/plan/mod.rs"]
mod plan;

use anyhow::{Context, Result};
use gonia_brdf::{DenseBrdf, Grid};
use gonia_formats::dense::write_dense;
use gonia_formats::samples::write_samples;
use gonia_rig::{DenseFile, Scale};
use std::collections::BTreeMap;
use std::path::Path;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().context("which material?")?;
    let folder = arguments.next().context("into which folder?")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let model = plan::material(&name);
    write_samples(&folder.join(format!("{name}.npy")), &plan::measure(&*model))?;
    let noise = format!("analytic, {} % noise", 100.0 * plan::NOISE);
    write_dense(
        &folder.join(format!("{name}-truth.exr")),
        DenseFile {
            brdf: DenseBrdf::tabulate(Grid::PAPER, &*model),
            scale: Scale::Absolute,
            provenance: BTreeMap::from([("material".into(), format!("{name}, {noise}"))]),
        },
    )?;
    Ok(())
}
