//! What can be fitted: a family of models, which differ by the values of named parameters.

use super::range::Range;
use crate::elementary::Elementary;
use crate::model::Brdf;
use crate::random::Random;
use std::ops::Deref;
use std::sync::Arc;

/// A family of models with named parameters. [`StandardFamily`](super::StandardFamily) has those of this
/// crate; one of your own is fitted in the same way:
///
/// ```
/// use gonia_brdf::progress::silent;
/// use gonia_brdf::fit::{FitSettings, ModelFamily, Parameter, Range, ParameterValues, draw, fit};
/// use gonia_brdf::{Brdf, DenseBrdf, Grid, Vec3};
///
/// /// Minnaert's model of dark surfaces: ρ/π (cos θi cos θv)^(k − 1).
/// #[derive(Clone)]
/// struct MinnaertFamily;
///
/// struct Minnaert {
///     albedo: [f64; 3],
///     k: f64,
/// }
///
/// impl Brdf for Minnaert {
///     fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
///         let shape = (light[2] * view[2]).powf(self.k - 1.0) / std::f64::consts::PI;
///         self.albedo.map(|rho| rho * shape)
///     }
/// }
///
/// impl ModelFamily for MinnaertFamily {
///     fn parameters(&self) -> Vec<Parameter> {
///         let mut list = Parameter::colour("albedo", Range::Logarithmic(1e-3, 10.0)).to_vec();
///         list.iter_mut().for_each(|p| p.is_amplitude = true);
///         list.push(Parameter::new("k", Range::Linear(0.5, 2.0)));
///         list
///     }
///
///     fn model(&self, values: &ParameterValues) -> Option<Box<dyn Brdf>> {
///         let (albedo, k) = (values.colour("albedo")?, values.get("k")?);
///         Some(Box::new(Minnaert { albedo, k }))
///     }
/// }
///
/// let truth = Minnaert { albedo: [0.3, 0.2, 0.1], k: 1.3 };
/// let dense = DenseBrdf::tabulate(Grid::with_step_deg(15.0)?, &truth);
/// let settings = FitSettings { cells: 400, starts: 4, ..FitSettings::default() };
/// let found = fit(&draw(&dense, settings.cells, 1), MinnaertFamily, &settings, &silent)?;
/// assert!((found.values.get("k").unwrap() - 1.3).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait ModelFamily: Send + Sync {
    /// Its parameters, in the order of their values.
    fn parameters(&self) -> Vec<Parameter>;

    /// The model of some values. `None` where a parameter is missing.
    fn model(&self, values: &ParameterValues) -> Option<Box<dyn Brdf>>;

    /// Adjusts values that were drawn, each by itself, for a search to start from. As they are unless the
    /// family knows better.
    fn adjust_start(&self, _values: &mut ParameterValues, _random: &mut Random) {}

    /// Of the many lists of values that are the same model, one. As they are unless the family says so.
    fn canonical(&self, values: ParameterValues) -> ParameterValues {
        values
    }

    /// Numbers with the names of the parameters; `None` where they are not as many.
    fn values(&self, numbers: Vec<f64>) -> Option<ParameterValues> {
        ParameterValues::new(&self.parameters(), numbers)
    }
}

/// One parameter of a family.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name, with the lobe's or thread's number and the channel.
    pub name: String,
    /// Its unit, empty for a pure number.
    pub unit: &'static str,
    /// Its bounds.
    pub range: Range,
    /// Whether it grows with the unit of the values: its bounds and starts are in albedos of a white
    /// surface as bright as the cells' mean.
    pub is_amplitude: bool,
    /// Where in its range a search may start.
    pub start: (f64, f64),
}

impl Parameter {
    /// A pure number that may start anywhere in its range.
    pub fn new(name: impl Into<String>, range: Range) -> Self {
        Self {
            name: name.into(),
            unit: "",
            range,
            is_amplitude: false,
            start: (range.at_share(0.0), range.at_share(1.0)),
        }
    }

    /// Three of these, `name_r`, `name_g` and `name_b`.
    pub fn colour(name: &str, range: Range) -> [Self; 3] {
        CHANNELS.map(|channel| Self::new(format!("{name}_{channel}"), range))
    }

    /// A number from 0 to 1.
    pub(super) fn share(name: impl Into<String>, start: (f64, f64)) -> Self {
        Self::new(name, Range::Linear(0.0, 1.0)).starting(start)
    }

    /// An azimuth in degrees whose half turn is the same again.
    pub(super) fn azimuth(name: impl Into<String>) -> Self {
        Self {
            unit: "deg",
            ..Self::new(name, Range::Azimuth).starting((0.0, 180.0))
        }
    }

    /// A factor over all, for models whose numbers mean 1/sr where the values are relative.
    pub(super) fn scale() -> Self {
        Self {
            is_amplitude: true,
            ..Self::new("scale", Range::Logarithmic(1e-4, 1e3)).starting((0.3, 10.0))
        }
    }

    /// The same with other starts.
    #[must_use]
    pub fn starting(self, start: (f64, f64)) -> Self {
        Self { start, ..self }
    }

    /// A value that a search may start from.
    pub(super) fn draw(&self, random: &mut Random) -> f64 {
        let (low, high) = self.start;
        match self.range {
            Range::Logarithmic(..) => random
                .between(low.natural_log(), high.natural_log())
                .exponential(),
            _ => random.between(low, high),
        }
    }
}

const CHANNELS: [&str; 3] = ["r", "g", "b"];

/// Values of a family's parameters, in their order and by their names.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterValues {
    names: Arc<[String]>,
    numbers: Vec<f64>,
}

impl ParameterValues {
    /// Numbers for parameters; `None` where they are not as many.
    pub fn new(parameters: &[Parameter], numbers: Vec<f64>) -> Option<Self> {
        let names = parameters.iter().map(|p| p.name.clone()).collect();
        (parameters.len() == numbers.len()).then_some(Self { names, numbers })
    }

    /// Other numbers with the same names.
    pub(super) fn with(&self, numbers: &[f64]) -> Self {
        Self {
            names: Arc::clone(&self.names),
            numbers: numbers.to_vec(),
        }
    }

    /// The value of a name; `None` where there is no such parameter.
    pub fn get(&self, name: &str) -> Option<f64> {
        let place = self.names.iter().position(|n| n == name)?;
        self.numbers.get(place).copied()
    }

    /// The values of `name_r`, `name_g` and `name_b`.
    pub fn colour(&self, name: &str) -> Option<[f64; 3]> {
        let [r, g, b] = CHANNELS.map(|channel| self.get(&format!("{name}_{channel}")));
        Some([r?, g?, b?])
    }

    /// Changes the value of a name; nothing where there is no such parameter.
    pub fn set(&mut self, name: &str, value: f64) {
        let mut named = self.names.iter().zip(&mut self.numbers);
        if let Some((_, number)) = named.find(|(n, _)| *n == name) {
            *number = value;
        }
    }

    /// Brings an azimuth into 0 .. 180 degrees.
    pub(super) fn half_turn(&mut self, azimuth: &str) {
        if let Some(value) = self.get(azimuth) {
            self.set(azimuth, value.rem_euclid(180.0));
        }
    }

    /// Exchanges the values of two names.
    pub fn swap(&mut self, a: &str, b: &str) {
        if let (Some(at_a), Some(at_b)) = (self.get(a), self.get(b)) {
            self.set(a, at_b);
            self.set(b, at_a);
        }
    }
}

impl Deref for ParameterValues {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.numbers
    }
}
