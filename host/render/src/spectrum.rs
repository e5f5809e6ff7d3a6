//! From spectra to linear sRGB: the CIE 1931 standard observer (2°) under illuminant D65.

/// Wavelength (nm), the colour-matching functions x̄, ȳ and z̄ of the CIE 1931 standard colorimetric observer, and the
/// relative power of CIE illuminant D65, every 10 nm (CIE 015:2018, tables 5 and 11; ISO/CIE 11664-1 and -2).
const TABLE: [[f64; 5]; 41] = [
    [380.0, 0.001368, 3.9e-05, 0.00645, 49.9755],
    [390.0, 0.004243, 0.00012, 0.02005, 54.6482],
    [400.0, 0.01431, 0.000396, 0.06785, 82.7549],
    [410.0, 0.04351, 0.00121, 0.2074, 91.486],
    [420.0, 0.13438, 0.004, 0.6456, 93.4318],
    [430.0, 0.2839, 0.0116, 1.3856, 86.6823],
    [440.0, 0.34828, 0.023, 1.74706, 104.865],
    [450.0, 0.3362, 0.038, 1.77211, 117.008],
    [460.0, 0.2908, 0.06, 1.6692, 117.812],
    [470.0, 0.19536, 0.09098, 1.28764, 114.861],
    [480.0, 0.09564, 0.13902, 0.81295, 115.923],
    [490.0, 0.03201, 0.20802, 0.46518, 108.811],
    [500.0, 0.0049, 0.323, 0.272, 109.354],
    [510.0, 0.0093, 0.503, 0.1582, 107.802],
    [520.0, 0.06327, 0.71, 0.07825, 104.79],
    [530.0, 0.1655, 0.862, 0.04216, 107.689],
    [540.0, 0.2904, 0.954, 0.0203, 104.405],
    [550.0, 0.43345, 0.99495, 0.00875, 104.046],
    [560.0, 0.5945, 0.995, 0.0039, 100.0],
    [570.0, 0.7621, 0.952, 0.0021, 96.3342],
    [580.0, 0.9163, 0.87, 0.00165, 95.788],
    [590.0, 1.0263, 0.757, 0.0011, 88.6856],
    [600.0, 1.0622, 0.631, 0.0008, 90.0062],
    [610.0, 1.0026, 0.503, 0.00034, 89.5991],
    [620.0, 0.85445, 0.381, 0.00019, 87.6987],
    [630.0, 0.6424, 0.265, 5e-05, 83.2886],
    [640.0, 0.4479, 0.175, 2e-05, 83.6992],
    [650.0, 0.2835, 0.107, 0.0, 80.0268],
    [660.0, 0.1649, 0.061, 0.0, 80.2146],
    [670.0, 0.0874, 0.032, 0.0, 82.2778],
    [680.0, 0.04677, 0.017, 0.0, 78.2842],
    [690.0, 0.0227, 0.00821, 0.0, 69.7213],
    [700.0, 0.011359, 0.004102, 0.0, 71.6091],
    [710.0, 0.00579, 0.002091, 0.0, 74.349],
    [720.0, 0.002899, 0.001047, 0.0, 61.604],
    [730.0, 0.00144, 0.00052, 0.0, 69.8856],
    [740.0, 0.00069, 0.000249, 0.0, 75.087],
    [750.0, 0.000332, 0.00012, 0.0, 63.5927],
    [760.0, 0.000166, 6e-05, 0.0, 46.4182],
    [770.0, 8.3e-05, 3e-05, 0.0, 66.8054],
    [780.0, 4.2e-05, 1.5e-05, 0.0, 63.3828],
];

/// Between the rows of the table, as CIE 015 has it for D65, values are linear; sums go by steps of this, nm.
const STEP_NM: f64 = 1.0;

/// Linear sRGB of XYZ (IEC 61966-2-1).
const RGB_OF_XYZ: [[f64; 3]; 3] = [
    [3.2406, -1.5372, -0.4986],
    [-0.9689, 1.8758, 0.0415],
    [0.0557, -0.2040, 1.0570],
];

/// The colours of spectra that are given in bands.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectrumColours {
    /// By channel and band: what the band's value counts.
    weights: [Vec<f64>; 3],
    beyond: f64,
}

impl SpectrumColours {
    /// Of bands at these wavelengths, nanometres, ascending. Between them a spectrum is linear; beyond the first
    /// and the last it keeps their value.
    pub fn new(wavelengths_nm: &[f64]) -> Self {
        let n = wavelengths_nm.len();
        let mut xyz = [(); 3].map(|()| vec![0.0; n]);
        let (mut white, mut beyond) = ([0.0; 3], 0.0);
        let first = TABLE[0][0];
        let steps = ((TABLE[TABLE.len() - 1][0] - first) / STEP_NM) as usize;
        for step in 0..=steps {
            let wavelength = first + STEP_NM * step as f64;
            let [x, y, z, power] = row_at(wavelength);
            let seen = [x, y, z].map(|response| response * power);
            let (below, share) = place(wavelengths_nm, wavelength);
            for c in 0..3 {
                white[c] += seen[c];
                for (band, weight) in [(below, 1.0 - share), (below + 1, share)] {
                    if let Some(sum) = xyz[c].get_mut(band) {
                        *sum += weight * seen[c];
                    }
                }
            }
            let is_within = wavelengths_nm.first().is_some_and(|w| wavelength >= *w)
                && wavelengths_nm.last().is_some_and(|w| wavelength <= *w);
            if !is_within {
                beyond += seen[1];
            }
        }
        let to_rgb = |row: [f64; 3], v: [f64; 3]| row[0] * v[0] + row[1] * v[1] + row[2] * v[2];
        let weights = RGB_OF_XYZ.map(|row| {
            // A white reflector has the values 1 exactly, not those of the rounded table and matrix.
            let of_white = to_rgb(row, white);
            let of_band = |k: usize| to_rgb(row, [xyz[0][k], xyz[1][k], xyz[2][k]]) / of_white;
            (0..n).map(of_band).collect()
        });
        Self {
            weights,
            beyond: beyond / white[1],
        }
    }

    /// Linear sRGB of the values of all bands, 1 for a white reflector; negative where sRGB does not hold the
    /// colour.
    pub fn rgb(&self, values: impl Iterator<Item = f32> + Clone) -> [f32; 3] {
        self.weights.each_ref().map(|weights| {
            let products = weights.iter().zip(values.clone());
            products.map(|(w, v)| w * f64::from(v)).sum::<f64>() as f32
        })
    }

    /// The share of white light, as the eye weighs it, that lies beyond the first and the last band: 0 ..= 1.
    pub fn beyond(&self) -> f64 {
        self.beyond
    }
}

/// The table at a wavelength within it.
fn row_at(wavelength: f64) -> [f64; 4] {
    let step = TABLE[1][0] - TABLE[0][0];
    let along = (wavelength - TABLE[0][0]) / step;
    let below = (along as usize).min(TABLE.len() - 2);
    let share = along - below as f64;
    [1, 2, 3, 4].map(|k| (1.0 - share) * TABLE[below][k] + share * TABLE[below + 1][k])
}

/// The band at or below a wavelength, and the share of the next one.
fn place(wavelengths: &[f64], at: f64) -> (usize, f64) {
    let above = wavelengths.partition_point(|w| *w <= at);
    match (above.checked_sub(1), wavelengths.get(above)) {
        (None, _) => (0, 0.0),
        (Some(below), None) => (below, 0.0),
        (Some(below), Some(next)) => {
            let from = wavelengths[below];
            (below, (at - from) / (next - from))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bands(from: f64, to: f64, step: f64) -> Vec<f64> {
        let count = ((to - from) / step).round() as usize + 1;
        (0..count).map(|k| from + step * k as f64).collect()
    }

    #[test]
    fn the_table_has_the_chromaticity_of_d65_and_of_equal_energy() {
        let sum = |power: fn(&[f64; 5]) -> f64| {
            let sum = |c: usize| TABLE.iter().map(|row| row[c] * power(row)).sum::<f64>();
            let [x, y, z] = [1, 2, 3].map(sum);
            [x / (x + y + z), y / (x + y + z)]
        };
        for (found, truth) in [
            (sum(|row| row[4]), [0.312_72, 0.329_03]),
            (sum(|_| 1.0), [1.0 / 3.0, 1.0 / 3.0]),
        ] {
            for k in 0..2 {
                assert!((found[k] - truth[k]).abs() < 2e-4, "{found:?}");
            }
        }
    }

    #[test]
    fn a_white_reflector_is_white_and_one_band_is_grey_whatever_the_bands() {
        for wavelengths in [
            bands(380.0, 780.0, 10.0),
            bands(400.0, 700.0, 10.0),
            bands(360.0, 830.0, 1.0),
            vec![405.0, 532.0, 633.0],
            vec![532.0],
        ] {
            let colours = SpectrumColours::new(&wavelengths);
            let rgb = colours.rgb(wavelengths.iter().map(|_| 0.5));
            assert!(rgb.iter().all(|v| (v - 0.5).abs() < 1e-6), "{rgb:?}");
        }
    }

    /// The primaries of sRGB lie at dominant wavelengths of about 611, 549 and 464 nm.
    #[test]
    fn what_reflects_long_waves_is_red_and_short_ones_blue_in_any_order_of_bands() {
        let wavelengths = bands(400.0, 700.0, 10.0);
        let colours = SpectrumColours::new(&wavelengths);
        let of = |reflects: fn(f64) -> bool| {
            colours.rgb(
                wavelengths
                    .iter()
                    .map(|w| f32::from(u8::from(reflects(*w)))),
            )
        };
        let (red, green, blue) = (
            of(|w| w >= 600.0),
            of(|w| (500.0..600.0).contains(&w)),
            of(|w| w < 500.0),
        );
        assert!(
            red[0] > 0.5 && red[1].abs() < 0.2 && red[2].abs() < 0.1,
            "{red:?}"
        );
        assert!(green[1] > 0.7 && green[2].abs() < 0.2, "{green:?}");
        assert!(blue[2] > 0.7 && blue[0].abs() < 0.2, "{blue:?}");
        for c in 0..3 {
            assert!((red[c] + green[c] + blue[c] - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn coarse_and_fine_bands_of_one_smooth_spectrum_have_one_colour() {
        let smooth = |w: f64| (0.2 + 0.6 * ((w - 400.0) / 300.0).clamp(0.0, 1.0)) as f32;
        let of = |wavelengths: Vec<f64>| {
            SpectrumColours::new(&wavelengths).rgb(wavelengths.iter().map(|w| smooth(*w)))
        };
        let (coarse, fine) = (of(bands(400.0, 700.0, 20.0)), of(bands(380.0, 780.0, 1.0)));
        for c in 0..3 {
            assert!((coarse[c] - fine[c]).abs() < 1e-4, "{coarse:?} {fine:?}");
        }
    }

    #[test]
    fn what_lies_beyond_the_bands_is_told() {
        let beyond = |wavelengths: Vec<f64>| SpectrumColours::new(&wavelengths).beyond();
        assert!(beyond(bands(380.0, 780.0, 10.0)) == 0.0);
        assert!(beyond(bands(400.0, 700.0, 10.0)) < 0.002);
        assert!(beyond(bands(500.0, 600.0, 10.0)) > 0.2);
    }
}
