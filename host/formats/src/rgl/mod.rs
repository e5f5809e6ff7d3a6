//! Measured materials of RGL (Dupuy and Jakob 2018), `.bsdf`: what Mitsuba's `measured` reads.
//!
//! For each direction of the light (P azimuths, T polar angles) f·cosθv stands on a square of R × R
//! places. A place u of the half vector m is (√(2θm/π), (φm + π)/2π); the density `vndf` over u says where
//! places lie close: s = its running integral at u, and f·cosθv = rgb(s)·ndf(u)/(4·sigma(u of the light)).
//! Written here, sigma is ¼, so that `rgb` is f·cosθv over `ndf`, a shape that all lights share or 1, and vndf is 1 (s = u) or
//! densest where the values bend most. `luminance` is the density over s by which a renderer chooses directions.

mod density;
mod read;
mod shape;
mod tensor_file;
mod warp;
mod write;

use crate::export::format::{ExportFormat, Holds, How, Meaning, Resolution};
use crate::format::{Content, ForeignContent, ForeignFormat, Format};
use gonia_rig::Scale;

/// The format.
pub(super) static FORMAT: Format = Format {
    name: "RGL, Mitsuba's measured",
    endings: &["bsdf"],
    magic: tensor_file::MAGIC,
    content: Content::Foreign(ForeignFormat {
        name: "RGL .bsdf",
        content: ForeignContent::Brdf {
            scale: Some(Scale::Absolute),
            read: |path| Ok(Box::new(read::read(path)?)),
        },
    }),
};

/// How it is exported.
pub(super) static EXPORT: ExportFormat = ExportFormat {
    name: "rgl",
    title: "RGL .bsdf",
    ending: "bsdf",
    readers: "Mitsuba 3 (`measured`), Tekari; `gonia import`",
    means: Meaning::Absolute,
    holds: Holds::Colours,
    angles: "lights every 4° and 10° in azimuth; half vectors on a square, denser about the normal",
    provenance: Some("the field `description`"),
    is_folder: false,
    resolution: Some(Resolution {
        default: 32,
        least: 8,
        most: 128,
        of: "places of the half vector along each side of a square",
    }),
    step_deg: |_| 4.0,
    how: How::Brdf {
        write: |path, file, settings| {
            write::write(path, file, settings)?;
            Ok(Vec::new())
        },
        read: |path| Ok(Box::new(read::read(path)?)),
    },
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::format::ExportSettings;
    use gonia_brdf::direction::Vec3;
    use gonia_brdf::{Brdf, DenseBrdf, Direction, Elementary, Grid};
    use gonia_rig::DenseFile;
    use std::collections::BTreeMap;

    const SETTINGS: ExportSettings = ExportSettings {
        resolution: 32,
        is_one_value: false,
    };

    /// Not the same with light and view both turned by 180°, nor mirrored.
    struct Lopsided(f64);

    impl Brdf for Lopsided {
        fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
            let lobe = |v: Vec3| 1.0 + 0.4 * v[0] + 0.3 * v[1] + 0.3 * v[0] * v[1];
            let half: f64 = (0..3).map(|i| (light[i] + view[i]).powi(2)).sum();
            let shine = (-self.0 * (1.0 - (light[2] + view[2]) / half.sqrt())).exponential();
            let both = lobe(light) * lobe(view);
            [0.1 * both + shine, 0.2 * both + shine, 0.3 * both + shine]
        }
    }

    /// Quantiles of |ln| of a file against its function, or against its table.
    fn errors(path: &std::path::Path, file: &DenseFile, model: Option<&Lopsided>) -> [f64; 2] {
        let read = read::read(path).unwrap();
        let mut errors = Vec::new();
        for k in 0..4000 {
            let angle = |by: f64, range: f64| (f64::from(k) * by).fract() * range;
            let light = Direction::from_deg(angle(0.618_034, 75.0), angle(0.754_878, 360.0));
            let mut view = Direction::from_deg(angle(0.569_84, 75.0), angle(0.438_58, 360.0));
            // Every other one near the mirror's direction.
            if k % 2 == 0 {
                let near = |by: f64| 12.0 * (angle(by, 1.0) - 0.5);
                view = Direction::from_deg(
                    (light.theta_deg() + near(0.71)).abs(),
                    light.phi_deg() + 180.0 + near(0.37),
                );
            }
            let table = file.brdf.lookup(light, view).map(f64::from);
            let [light, view] = [light, view].map(Direction::to_vec3);
            let wanted = model.map_or(table, |model| model.eval(light, view));
            let found = read.eval(light, view);
            errors.extend((0..3).map(|c| (found[c] / wanted[c]).natural_log().abs()));
        }
        errors.sort_by(f64::total_cmp);
        [0.5, 0.99].map(|share| errors[(share * errors.len() as f64) as usize])
    }

    #[test]
    fn a_shape_and_places_by_curvature_make_a_small_file_nearer() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("sharp.bsdf");
        let table = |step_deg, sharpness| DenseFile {
            brdf: DenseBrdf::tabulate(Grid::with_step_deg(step_deg).unwrap(), &Lopsided(sharpness)),
            scale: Scale::Absolute,
            provenance: BTreeMap::new(),
        };
        let (sharp, soft) = (table(3.0, 400.0), table(4.0, 10.0));
        let function = Lopsided(10.0);
        // The table of the sharp one is another function between its nodes.
        for (file, model, side, gains) in [
            (&sharp, None, 12, [0.8, 0.8]),
            (&sharp, None, 16, [0.8, 0.9]),
            (&soft, None, 16, [1.05, 0.75]),
            (&soft, Some(&function), 16, [1.05, 0.9]),
        ] {
            let even = write::Material::new(file, side, &shape::Shape::flat(), true).unwrap();
            even.write(&path).unwrap();
            let flat = errors(&path, file, model);
            let settings = ExportSettings {
                resolution: side,
                ..SETTINGS
            };
            write::write(&path, file, &settings).unwrap();
            let shaped = errors(&path, file, model);
            for k in 0..2 {
                assert!(
                    shaped[k] <= gains[k] * flat[k],
                    "{side}: {flat:?} {shaped:?}"
                );
            }
        }
    }

    #[test]
    fn what_is_written_is_read_back_the_right_way_round() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lopsided.bsdf");
        for (sharpness, limits) in [(30.0, [0.005, 0.05]), (200.0, [0.005, 0.05])] {
            let model = Lopsided(sharpness);
            let brdf = DenseBrdf::tabulate(Grid::with_step_deg(4.0).unwrap(), &model);
            let file = DenseFile {
                brdf,
                scale: Scale::Absolute,
                provenance: BTreeMap::from([("material".to_owned(), "lopsided".to_owned())]),
            };
            write::write(&path, &file, &SETTINGS).unwrap();
            let read = read::read(&path).unwrap();
            let mut errors = Vec::new();
            for k in 0..2000 {
                let angle = |by: f64, range: f64| (f64::from(k) * by).fract() * range;
                let light = Direction::from_deg(angle(0.618_034, 75.0), angle(0.754_878, 360.0));
                let view = Direction::from_deg(angle(0.569_84, 75.0), angle(0.438_58, 360.0));
                let wanted = file.brdf.lookup(light, view);
                let found = read.eval(light.to_vec3(), view.to_vec3());
                for c in 0..3 {
                    errors.push((found[c] / f64::from(wanted[c])).natural_log().abs());
                }
            }
            errors.sort_by(f64::total_cmp);
            let quantile = |share: f64| errors[(share * errors.len() as f64) as usize];
            // Turned or mirrored it would be off by tens of per cent everywhere.
            assert!(quantile(0.5) < limits[0], "{}", quantile(0.5));
            assert!(quantile(0.99) < limits[1], "{}", quantile(0.99));
        }
    }
}
