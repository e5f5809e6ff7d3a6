//! Samples in BiRD's format, each with the standard uncertainty that is known of it.

use crate::budget::{Equation, Part, Shape, Slant, budget_in, places, shape};
use crate::error::Error;
use crate::provenance::{Provenance, SCALE_ASSUMED, scale_assumed};
use gonia_brdf::{Bins, Direction, Grid};
use gonia_formats::checksum;
use gonia_formats::export::{BirdFile, Point};
use gonia_rig::{Budget, DenseChannels, Remark, SampleValues, Scale};
use rayon::prelude::*;
use std::path::Path;

/// Samples that are exported.
pub struct SamplesExport<'a> {
    /// The samples.
    pub samples: SampleValues,
    /// Whether their values are 1/sr.
    pub scale: Scale,
    /// What their file says of them, the uncertainties of their rig among that.
    pub provenance: Provenance,
    /// The file that they were read from, for messages.
    pub path: &'a Path,
    /// What was filled from them: its slopes say what the uncertainty of directions comes to.
    pub dense: Option<&'a DenseChannels>,
    /// Takes relative values for 1/sr after multiplying them.
    pub scale_by: Option<f64>,
}

/// What became of them.
#[derive(Clone, Debug)]
pub struct ExportedSamples {
    /// Values that were written, a channel of a sample each.
    pub values: usize,
    /// Whether they have uncertainties.
    pub with_uncertainties: bool,
    /// What is to be said of them.
    pub remarks: Vec<Remark>,
}

/// Writes samples as BiRD's JSON: of each sample and channel the value and, where something is known of it, the combined
/// standard uncertainty (k = 1): the scatter of samples that share a cell of 2°, reference, lamp and camera by the
/// measurement equation, and directions by that and the dense BRDF's slopes.
///
/// # Errors
/// The samples are relative, and no `scale_by` is given; the dense BRDF has other channels; what the samples say of their rig
/// cannot be read; the file cannot be written.
pub fn export_samples(source: SamplesExport<'_>, path: &Path) -> Result<ExportedSamples, Error> {
    let SamplesExport {
        mut samples,
        scale,
        mut provenance,
        path: of,
        dense,
        scale_by,
    } = source;
    let factor = match (scale_by, scale) {
        (Some(factor), Scale::Relative) => {
            provenance.insert(SCALE_ASSUMED.into(), scale_assumed(factor));
            factor
        }
        (_, Scale::Absolute) => 1.0,
        (None, Scale::Relative) => {
            let format = "BiRD JSON";
            return Err(Error::RelativeExport { format });
        }
    };
    if let Some(dense) = dense.filter(|dense| dense.channels != *samples.channels()) {
        return Err(Error::Option {
            option: "--dense",
            found: format!("with the channels {}", dense.channels),
            remedy: format!(
                "the samples have {}: give the dense BRDF that was filled from them",
                samples.channels()
            ),
        });
    }
    samples.keep_sound();
    let known = Known {
        noise_variance: noise_variance(&samples),
        budget: budget_in(&provenance)?,
        dense,
    };
    let mut points = points(&samples, factor, &known);
    let all = points.len();
    points.retain(|point| point.value >= 0.0);
    let negative = all - points.len();
    let file = BirdFile {
        points,
        has_uncertainties: known.is_something(),
        channels: samples.channels(),
        provenance: &provenance,
        checksum: checksum::of_samples(&samples),
        what: "Measured samples",
    };
    let (values, with_uncertainties) = (file.points.len(), file.has_uncertainties);
    let mut remarks = file.write(path)?;
    if negative > 0 {
        let text =
            format_args!("{negative} values are below zero, which BiRD does not hold: left out");
        let remedy = "mind that the mean of what is left is too high where it is dark";
        remarks.push(Remark::new(of.display(), text, remedy));
    }
    remarks.extend(known.remarks(of));
    Ok(ExportedSamples {
        values,
        with_uncertainties,
        remarks,
    })
}

/// What is known of the samples' uncertainty.
struct Known<'a> {
    /// Of the logarithm of one sample.
    noise_variance: Option<f32>,
    budget: Option<Budget>,
    dense: Option<&'a DenseChannels>,
}

impl Known<'_> {
    fn is_something(&self) -> bool {
        self.noise_variance.is_some() || self.budget.is_some()
    }

    /// What the uncertainties do not hold.
    fn remarks(&self, of: &Path) -> Vec<Remark> {
        let without = |what: &str, remedy: &str| {
            let text = format_args!("the uncertainties do not hold {what}");
            Remark::new(of.display(), text, remedy)
        };
        let mut remarks = Vec::new();
        if self.noise_variance.is_none() {
            remarks.push(without(
                "noise: no cell of 2 degrees holds enough samples to tell it",
                "measure some directions several times",
            ));
        }
        if self.budget.is_none() {
            remarks.push(without(
                "reference, lamp, camera and directions: the samples' note says nothing of their rig",
                "export samples that gonia process wrote",
            ));
        } else if self.dense.is_none() {
            remarks.push(without(
                "directions, which need the slopes of the BRDF",
                "give what was filled from the samples (--dense DENSE.exr)",
            ));
        }
        remarks
    }

    /// Standard uncertainties of a sample's values, as shares of them, a channel each.
    fn shares(&self, light: Direction, view: Direction, values: &[f64]) -> Vec<f64> {
        let noise = f64::from(self.noise_variance.unwrap_or(0.0));
        let Some(budget) = &self.budget else {
            return vec![noise.sqrt(); values.len()];
        };
        let equation = Equation::new(budget);
        let (at_light, at_view) = (Slant::of(light), Slant::of(view));
        let around = self
            .dense
            .map(|dense| places(light, view).map(|(light, view)| dense.lookup(light, view)));
        let share = |(channel, value): (usize, &f64)| {
            let shape = around.as_ref().map_or(
                Shape {
                    value: *value,
                    surround: *value,
                    ..Shape::default()
                },
                |around| {
                    let of_place = |values: &Vec<f32>| values.get(channel).copied().unwrap_or(0.0);
                    shape(&around.each_ref().map(|values| f64::from(of_place(values))))
                },
            );
            let effects = equation.at(&at_light, &at_view, &shape);
            let [scale, direction] = [Part::Scale, Part::Direction].map(|part| effects.u(part));
            (noise + scale * scale + direction * direction).sqrt()
        };
        values.iter().enumerate().map(share).collect()
    }
}

/// Every value as a point, channel by channel of a sample.
fn points(samples: &SampleValues, factor: f64, known: &Known<'_>) -> Vec<Point> {
    let n = samples.channels().count();
    let planes: Vec<_> = (0..n).map(|c| samples.of_channels([c])).collect();
    let of_sample = |k: usize| {
        let of = &planes[0][k];
        let light = Direction::from_deg(of.theta_i_deg.into(), of.phi_i_deg.into());
        let view = Direction::from_deg(of.theta_v_deg.into(), of.phi_v_deg.into());
        let values: Vec<f64> = planes
            .iter()
            .map(|plane| f64::from(plane[k].rgb[0]))
            .collect();
        let shares = known
            .is_something()
            .then(|| known.shares(light, view, &values));
        let point = |channel: usize| Point {
            light,
            view,
            channel,
            value: factor * values[channel],
            uncertainty: shares
                .as_ref()
                .map(|shares| factor * values[channel] * shares[channel]),
        };
        (0..n).map(point).collect::<Vec<Point>>()
    };
    (0..samples.len())
        .into_par_iter()
        .flat_map_iter(of_sample)
        .collect()
}

/// Variance of the logarithm of one sample, by those that share a cell of the paper's grid.
fn noise_variance(samples: &SampleValues) -> Option<f32> {
    let n = samples.channels().count();
    let three = samples.three([0, n / 2, n - 1]);
    Bins::new(Grid::PAPER, &three).noise_variance()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::budget::fixture::uncertain_of;
    use gonia_brdf::model::{Brdf, Ggx};
    use gonia_brdf::{DenseBrdf, Elementary, Sample};
    use gonia_formats::export::{How, export_format};
    use gonia_rig::{Channels, DenseFile, Input};

    fn read(path: &Path) -> Vec<Point> {
        let How::Points { read, .. } = export_format(path, None).unwrap().how else {
            panic!("no points");
        };
        read(path).unwrap()
    }

    #[test]
    fn each_sample_has_its_own_uncertainty_of_noise_scale_and_direction() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("samples.json");
        let model = Ggx {
            diffuse: [0.1, 0.2, 0.3],
            specular: [1.0; 3],
            f0: 0.5,
            alpha_x: 0.1,
            alpha_y: 0.1,
            azimuth_deg: 0.0,
        };
        let at = Direction::from_deg;
        // On the flank of the highlight, and where the BRDF is flat; each five times, 2 % apart.
        let pairs = [
            (at(30.0, 0.0), at(42.0, 180.0)),
            (at(10.0, 0.0), at(60.0, 90.0)),
        ];
        let samples: Vec<Sample> = pairs
            .iter()
            .flat_map(|(light, view)| (0..5).map(move |k| (*light, *view, f64::from(k))))
            .map(|(light, view, k)| {
                let values = model.eval(light.to_vec3(), view.to_vec3());
                let noise = 1.0 + 0.02 * (k - 2.0);
                Sample::new(light, view, values.map(|v| (noise * v) as f32))
            })
            .collect();
        let budget = uncertain_of(&[(Input::Reference, 0.01), (Input::ViewDirection, 0.3)]);
        let provenance = Provenance::from([("uncertainties".to_owned(), budget.to_string())]);
        let table = DenseFile {
            brdf: DenseBrdf::tabulate(Grid::PAPER, &model),
            scale: Scale::Absolute,
            provenance: Provenance::new(),
        };
        let table = DenseChannels::from(table);
        let export = |dense| {
            let source = SamplesExport {
                samples: samples.clone().into(),
                scale: Scale::Relative,
                provenance: provenance.clone(),
                path: Path::new("samples.npy"),
                dense,
                scale_by: Some(2.0),
            };
            let exported = export_samples(source, &path).unwrap();
            assert_eq!((exported.values, exported.with_uncertainties), (30, true));
            let points = read(&path);
            let share = |k: usize| points[k].uncertainty.unwrap() / points[k].value;
            // The second channel of the middle sample of either pair.
            let wanted = f64::from(samples[2].rgb[1]);
            assert!((points[7].value / (2.0 * wanted) - 1.0).abs() < 1e-5);
            ([share(7), share(22)], exported.remarks.len())
        };
        let ([flank, flat], said) = export(None);
        assert!((flank / flat - 1.0).abs() < 1e-3, "{flank} {flat}");
        // Noise of about 0.02 about the median, and the reference.
        assert!(flank > 0.02 && flank < 0.06, "{flank}");
        let ([steep, still_flat], said_with) = export(Some(&table));
        assert_eq!(said, said_with + 1);
        let log = |deg: f64| {
            let [light, view] = [at(30.0, 0.0), at(deg, 180.0)].map(Direction::to_vec3);
            model.eval(light, view)[1].natural_log()
        };
        // Of the view's 0.3 degrees, on the flank; across it nothing changes.
        let wanted = 0.3 * (log(43.0) - log(41.0)).abs() / 2.0;
        let found = (steep * steep - flank * flank).sqrt();
        assert!((found / wanted - 1.0).abs() < 0.1, "{found} {wanted}");
        assert!(
            (still_flat / flat - 1.0).abs() < 0.05,
            "{still_flat} {flat}"
        );
    }

    #[test]
    fn what_is_not_known_is_said_and_relative_values_need_a_factor() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("samples.json");
        let at = |deg| Direction::from_deg(deg, 0.0);
        let samples = vec![
            Sample::new(at(10.0), at(20.0), [0.1, 0.2, -0.3]),
            Sample::new(at(30.0), at(40.0), [0.4, 0.5, 0.6]),
        ];
        let source = |scale, dense| SamplesExport {
            samples: samples.clone().into(),
            scale,
            provenance: Provenance::new(),
            path: Path::new("samples.npy"),
            dense,
            scale_by: None,
        };
        let error = export_samples(source(Scale::Relative, None), &path).unwrap_err();
        assert!(error.to_string().contains("--assume-scale"), "{error}");
        let grey = DenseChannels {
            channels: Channels::Single,
            grid: Grid::with_step_deg(30.0).unwrap(),
            planes: Vec::new(),
            scale: Scale::Absolute,
            provenance: Provenance::new(),
        };
        let error = export_samples(source(Scale::Absolute, Some(&grey)), &path).unwrap_err();
        assert!(
            error.to_string().starts_with("--dense with the channels Y"),
            "{error}"
        );
        assert!(!path.exists());
        let exported = export_samples(source(Scale::Absolute, None), &path).unwrap();
        assert_eq!((exported.values, exported.with_uncertainties), (5, false));
        let said: Vec<String> = exported.remarks.iter().map(ToString::to_string).collect();
        for word in [
            "1 values are below zero",
            "do not hold noise",
            "nothing of their rig",
        ] {
            assert!(
                said.iter().any(|said| said.contains(word)),
                "{word}: {said:?}"
            );
        }
        assert!(read(&path).iter().all(|point| point.uncertainty.is_none()));
    }
}
