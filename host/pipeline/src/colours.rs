//! The colours of a dense BRDF of any channels: for pictures, for ΔE, and for formats that hold R, G and B.

use gonia_brdf::DenseBrdf;
use gonia_render::SpectrumColours;
use gonia_rig::{Channels, DenseChannels, DenseFile, Remark};
use rayon::prelude::*;
use std::path::Path;

/// More of the light than this beyond the bands is remarked on, as a share.
const BEYOND: f64 = 0.01;

/// A colour that sRGB does not hold is moved to where its darkest component is this share of its luminance.
const LEAST: f32 = 1e-4;

/// A dense BRDF as linear sRGB, and what is to be said of that: colours as they are, one value as a grey, bands by
/// the CIE 1931 standard observer under D65. `None` where a plane is not of the grid's size.
pub fn colours_of(file: DenseChannels, path: &Path) -> Option<(DenseFile, Vec<Remark>)> {
    let remark = |what: String, remedy: &str| Remark::new(path.display(), what, remedy);
    match &file.channels {
        Channels::Rgb | Channels::Single => Some((file.into_rgb()?, Vec::new())),
        Channels::Bands(wavelengths) => {
            let colours = SpectrumColours::new(wavelengths);
            let n = file.grid.n_cells();
            if file.planes.iter().any(|plane| plane.len() != n) {
                return None;
            }
            let of_cell = |cell: usize| {
                let rgb = colours.rgb(file.planes.iter().map(|plane| plane[cell]));
                within_srgb(rgb)
            };
            let cells: Vec<([f32; 3], bool)> = (0..n).into_par_iter().map(of_cell).collect();
            let moved = cells.iter().filter(|(_, moved)| *moved).count();
            let plane = |c: usize| cells.iter().map(|(rgb, _)| rgb[c]).collect();
            let brdf = DenseBrdf::new(file.grid, [0, 1, 2].map(plane))?;
            let mut remarks = Vec::new();
            if let [one] = wavelengths[..] {
                remarks.push(remark(
                    format!("one band ({one}nm) has no colour, and is shown as a grey"),
                    "give bands from 400nm to 700nm for colours",
                ));
            } else if colours.beyond() > BEYOND {
                remarks.push(remark(
                    format!(
                        "{:.1} % of white light, as the eye weighs it, lies beyond its {}: the nearest band stands for it",
                        100.0 * colours.beyond(),
                        file.channels
                    ),
                    "give bands from 400nm to 700nm for true colours",
                ));
            }
            if moved > 0 {
                remarks.push(remark(
                    format!(
                        "{:.1} % of the cells have colours that sRGB does not hold: they are shown less saturated",
                        100.0 * moved as f64 / n as f64
                    ),
                    "take the bands themselves for what must be exact",
                ));
            }
            let dense = DenseFile {
                brdf,
                scale: file.scale,
                provenance: file.provenance,
            };
            Some((dense, remarks))
        }
    }
}

/// A colour that sRGB holds, of the same luminance, and whether that is another one.
fn within_srgb(rgb: [f32; 3]) -> ([f32; 3], bool) {
    let grey = gonia_render::color::luminance(rgb);
    let least = rgb.iter().copied().fold(f32::INFINITY, f32::min);
    let wanted = LEAST * grey;
    if least >= wanted || grey <= 0.0 {
        return (rgb, false);
    }
    let share = (grey - wanted) / (grey - least);
    (rgb.map(|v| grey + share * (v - grey)), true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Grid;
    use gonia_rig::Scale;
    use std::collections::BTreeMap;

    fn of(channels: Channels, values: &[f32]) -> (DenseFile, Vec<Remark>) {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let file = DenseChannels {
            channels,
            grid,
            planes: values.iter().map(|v| vec![*v; grid.n_cells()]).collect(),
            scale: Scale::Absolute,
            provenance: BTreeMap::new(),
        };
        colours_of(file, Path::new("d.exr")).unwrap()
    }

    #[test]
    fn one_value_is_a_grey_and_colours_stay_as_they_are() {
        let (grey, said) = of(Channels::Single, &[0.2]);
        assert_eq!((grey.brdf.at(3, 4), said.len()), ([0.2; 3], 0));
        let (rgb, said) = of(Channels::Rgb, &[0.1, 0.2, 0.3]);
        assert_eq!((rgb.brdf.at(3, 4), said.len()), ([0.1, 0.2, 0.3], 0));
    }

    #[test]
    fn bands_are_seen_by_the_observer_and_what_srgb_does_not_hold_is_told() {
        let (channels, _) =
            Channels::bands(&[400.0, 450.0, 500.0, 550.0, 600.0, 650.0, 700.0]).unwrap();
        let (white, said) = of(channels.clone(), &[0.3; 7]);
        assert!(white.brdf.at(0, 0).iter().all(|v| (v - 0.3).abs() < 1e-5));
        assert!(said.is_empty(), "{said:?}");
        let (cyan, said) = of(channels, &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        let [r, g, b] = cyan.brdf.at(0, 0);
        assert!(r > 0.0 && r < 0.01 * g && b < g, "{r} {g} {b}");
        assert!(
            said[0].to_string().contains("100.0 % of the cells"),
            "{said:?}"
        );
        let (_, said) = of(Channels::Bands(vec![532.0]), &[0.3]);
        assert!(
            said[0]
                .to_string()
                .contains("one band (532nm) has no colour")
        );
        let (_, said) = of(Channels::Bands(vec![500.0, 600.0]), &[0.3, 0.3]);
        assert!(said[0].to_string().contains("lies beyond its 500nm, 600nm"));
    }
}
