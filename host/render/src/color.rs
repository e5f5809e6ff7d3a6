//! From linear sRGB to Lab and CIEDE2000.

use palette::color_difference::Ciede2000;
use palette::convert::IntoColorUnclamped;
use palette::white_point::D65;
use palette::{Lab, LinSrgb};

/// A colour in CIE L*a*b* under D65.
pub type LabD65 = Lab<D65, f32>;

/// Linear sRGB (1 = diffuse white) in Lab. Negative components count as zero; above one they are
/// kept, so that a highlight is lighter than white (L* > 100).
pub fn lab(rgb: [f32; 3]) -> LabD65 {
    let [r, g, b] = rgb.map(|v| v.max(0.0));
    LinSrgb::new(r, g, b).into_color_unclamped()
}

/// The difference of two linear sRGB colours, CIEDE2000.
pub fn delta_e(a: [f32; 3], b: [f32; 3]) -> f32 {
    lab(a).difference(lab(b))
}

/// Relative luminance of linear sRGB.
pub fn luminance(rgb: [f32; 3]) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the 34 test pairs of Sharma, Wu and Dalal (2005), table 1: those that reach every
    /// branch of the formula (hue wrap, achromatic, the rotation term, large differences).
    const SHARMA: [([f64; 3], [f64; 3], f64); 20] = [
        ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
        ([50.0, 3.1571, -77.2803], [50.0, 0.0, -82.7485], 2.8615),
        ([50.0, 2.8361, -74.0200], [50.0, 0.0, -82.7485], 3.4412),
        ([50.0, -1.3802, -84.2814], [50.0, 0.0, -82.7485], 1.0000),
        ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
        ([50.0, -1.0, 2.0], [50.0, 0.0, 0.0], 2.3669),
        ([50.0, 2.4900, -0.0010], [50.0, -2.4900, 0.0009], 7.1792),
        ([50.0, 2.4900, -0.0010], [50.0, -2.4900, 0.0011], 7.2195),
        ([50.0, -0.0010, 2.4900], [50.0, 0.0009, -2.4900], 4.8045),
        ([50.0, -0.0010, 2.4900], [50.0, 0.0011, -2.4900], 4.7461),
        ([50.0, 2.5, 0.0], [50.0, 0.0, -2.5], 4.3065),
        ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
        ([50.0, 2.5, 0.0], [61.0, -5.0, 29.0], 22.8977),
        ([50.0, 2.5, 0.0], [56.0, -27.0, -3.0], 31.9030),
        ([50.0, 2.5, 0.0], [58.0, 24.0, 15.0], 19.4535),
        (
            [60.2574, -34.0099, 36.2677],
            [60.4626, -34.1751, 39.4387],
            1.2644,
        ),
        (
            [22.7233, 20.0904, -46.6940],
            [23.0331, 14.9730, -42.5619],
            2.0373,
        ),
        (
            [90.8027, -2.0831, 1.4410],
            [91.1528, -1.6435, 0.0447],
            1.4441,
        ),
        (
            [6.7747, -0.2908, -2.4247],
            [5.8714, -0.0985, -2.2286],
            0.6377,
        ),
        (
            [2.0776, 0.0795, -1.1350],
            [0.9033, -0.0636, -0.5514],
            0.9082,
        ),
    ];

    #[test]
    fn ciede2000_gives_the_published_differences() {
        for (a, b, expected) in SHARMA {
            let lab = |c: [f64; 3]| Lab::<D65, f64>::new(c[0], c[1], c[2]);
            let found = lab(a).difference(lab(b));
            assert!(
                (found - expected).abs() < 1e-4,
                "{a:?} {b:?}: {found} {expected}"
            );
            let single = |c: [f64; 3]| LabD65::new(c[0] as f32, c[1] as f32, c[2] as f32);
            let found = f64::from(single(a).difference(single(b)));
            assert!(
                (found - expected).abs() < 2e-3,
                "{a:?} {b:?}: {found} {expected}"
            );
        }
    }

    #[test]
    fn white_grey_and_red_have_their_known_lab() {
        let near = |rgb, expected: [f32; 3]| {
            let c = lab(rgb);
            for (found, expected) in [c.l, c.a, c.b].into_iter().zip(expected) {
                assert!((found - expected).abs() < 0.05, "{rgb:?}: {c:?}");
            }
        };
        near([1.0, 1.0, 1.0], [100.0, 0.0, 0.0]);
        near([0.184_19, 0.184_19, 0.184_19], [50.0, 0.0, 0.0]);
        near([1.0, 0.0, 0.0], [53.24, 80.09, 67.20]);
        near([-1.0, -0.5, 0.0], [0.0, 0.0, 0.0]);
        assert!(lab([2.0, 2.0, 2.0]).l > 100.0);
        assert!((luminance([1.0, 1.0, 1.0]) - 1.0).abs() < 1e-6);
    }
}
