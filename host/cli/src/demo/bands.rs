//! The simulated material in bands.
//!
//! The simulated camera has three channels, which a band's value is a mixture of: its spectrum is linear between
//! the wavelengths of blue, green and red. The noise of a band is that of the samples.

use gonia_brdf::{Brdf, DenseBrdf, Grid, Sample};
use gonia_rig::{ChannelSamples, Channels, DenseChannels, Scale};
use std::collections::BTreeMap;

/// The first and the last band, nanometres.
const RANGE_NM: [f64; 2] = [400.0, 700.0];
/// Where the spectrum has the values of red, green and blue, nanometres.
const RGB_NM: [f64; 3] = [620.0, 540.0, 450.0];

/// Wavelengths of so many bands, evenly spread over the visible.
pub fn wavelengths(bands: usize) -> Vec<f64> {
    let [from, to] = RANGE_NM;
    match bands {
        1 => vec![0.5 * (from + to)],
        // To a tenth of a nanometre, as their names say.
        _ => (0..bands)
            .map(|k| from + (to - from) * k as f64 / (bands - 1) as f64)
            .map(|w| (10.0 * w).round() / 10.0)
            .collect(),
    }
}

/// The value at a wavelength of a spectrum whose red, green and blue are known.
fn mixed(rgb: [f32; 3], wavelength: f64) -> f32 {
    let [red, green, blue] = RGB_NM;
    let between = |from: f64, to: f64| ((wavelength - from) / (to - from)).clamp(0.0, 1.0) as f32;
    let (of_green, of_red) = (between(blue, green), between(green, red));
    let [r, g, b] = rgb;
    b + of_green * (g - b) + of_red * (r - g)
}

/// Samples of colours in bands.
pub fn samples(samples: &[Sample], wavelengths: &[f64]) -> ChannelSamples {
    let of_sample = |s: &Sample| {
        let rgb = s.rgb;
        wavelengths.iter().map(move |w| mixed(rgb, *w))
    };
    ChannelSamples {
        channels: Channels::Bands(wavelengths.to_vec()),
        places: samples.iter().map(|s| s.with_values([])).collect(),
        values: samples.iter().flat_map(of_sample).collect(),
    }
}

/// The true BRDF in bands.
pub fn truth(grid: Grid, model: &dyn Brdf, wavelengths: &[f64]) -> DenseChannels {
    let dense = DenseBrdf::tabulate(grid, model);
    let [red, green, blue] = dense.planes();
    let of_band = |wavelength: &f64| {
        let colours = red.iter().zip(green).zip(blue);
        let mixed = colours.map(|((r, g), b)| mixed([*r, *g, *b], *wavelength));
        mixed.collect()
    };
    DenseChannels {
        channels: Channels::Bands(wavelengths.to_vec()),
        grid,
        planes: wavelengths.iter().map(of_band).collect(),
        scale: Scale::Absolute,
        provenance: BTreeMap::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_evenly_spread_and_have_the_colours_at_theirs() {
        assert_eq!(wavelengths(31)[..3], [400.0, 410.0, 420.0]);
        assert_eq!((wavelengths(31)[30], wavelengths(1)[0]), (700.0, 550.0));
        let rgb = [0.1, 0.2, 0.4];
        let at = RGB_NM.map(|w| mixed(rgb, w));
        assert_eq!(at, rgb);
        assert!((mixed(rgb, 495.0) - 0.3).abs() < 1e-6);
        assert_eq!((mixed(rgb, 400.0), mixed(rgb, 700.0)), (0.4, 0.1));
    }
}
