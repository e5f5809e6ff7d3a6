//! A model of one's own, fitted to a dense BRDF: Minnaert's, for dark and dusty surfaces.

use gonia_brdf::Elementary;
use gonia_brdf::fit::{FitSettings, ModelFamily, Parameter, ParameterValues, Range};
use gonia_brdf::{Brdf, DenseBrdf, Grid, Vec3};
use gonia_pipeline::fit::{cells_of_dense, fit_model};
use gonia_pipeline::silent;
use gonia_rig::{DenseFile, Scale};
use std::collections::BTreeMap;
use std::error::Error;
use std::fmt;

// ANCHOR: model
/// f = ρ/π (cos θi cos θv)^(k − 1).
struct Minnaert {
    albedo: [f64; 3],
    k: f64,
}

impl Brdf for Minnaert {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let shape = (light[2] * view[2]).power(self.k - 1.0) / std::f64::consts::PI;
        self.albedo.map(|rho| rho * shape)
    }
}

/// What is fitted: the names, ranges and meaning of its parameters.
struct MinnaertFamily;

impl ModelFamily for MinnaertFamily {
    fn parameters(&self) -> Vec<Parameter> {
        let mut list = Parameter::colour("albedo", Range::Logarithmic(1e-3, 10.0)).to_vec();
        list.iter_mut().for_each(|p| p.is_amplitude = true);
        list.push(Parameter::new("k", Range::Linear(0.5, 2.0)));
        list
    }

    fn model(&self, values: &ParameterValues) -> Option<Box<dyn Brdf>> {
        let (albedo, k) = (values.colour("albedo")?, values.get("k")?);
        Some(Box::new(Minnaert { albedo, k }))
    }
}

impl fmt::Display for MinnaertFamily {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("minnaert")
    }
}
// ANCHOR_END: model

// ANCHOR: fit
fn main() -> Result<(), Box<dyn Error>> {
    // A measured BRDF comes from gonia_formats::dense::read_dense.
    let truth = Minnaert {
        albedo: [0.3, 0.2, 0.1],
        k: 1.3,
    };
    let measured = DenseFile {
        brdf: DenseBrdf::tabulate(Grid::with_step_deg(15.0)?, &truth),
        scale: Scale::Absolute,
        provenance: BTreeMap::new(),
    };
    let settings = FitSettings {
        cells: 400,
        starts: 4,
        ..FitSettings::default()
    };
    let cells = cells_of_dense(&measured.brdf, &settings);
    let result = fit_model(
        &measured,
        "measured",
        &cells,
        MinnaertFamily,
        &settings,
        &silent,
    )?;
    for p in &result.note.parameters {
        println!(
            "{} = {:.4} ± {:.1e}",
            p.name,
            p.value,
            p.uncertainty.unwrap_or(f64::NAN)
        );
    }
    Ok(())
}
// ANCHOR_END: fit

#[test]
fn a_model_of_ones_own_is_fitted() {
    main().unwrap();
}
