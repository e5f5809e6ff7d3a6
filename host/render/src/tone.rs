//! From linear light to the screen.

use crate::Picture;
use gonia_brdf::Elementary;

/// The sRGB transfer curve (IEC 61966-2-1) of a linear value, clipped to 0 ..= 1, in 8 bits.
pub fn srgb8(linear: f32) -> u8 {
    let v = linear.clamp(0.0, 1.0);
    let encoded = if v <= 0.003_130_8 {
        12.92 * v
    } else {
        1.055 * v.power(1.0 / 2.4) - 0.055
    };
    (255.0 * encoded + 0.5) as u8
}

/// A linear colour times an exposure, for the screen.
pub fn rgb8(rgb: [f32; 3], exposure: f32) -> [u8; 3] {
    rgb.map(|v| srgb8(v * exposure))
}

/// A picture for the screen, transparent where there is no surface.
pub fn picture_rgba(picture: &Picture, exposure: f32) -> Vec<[u8; 4]> {
    let pixels = picture.rgb.iter().zip(&picture.cover);
    pixels
        .map(|(rgb, cover)| {
            let [r, g, b] = rgb8(*rgb, exposure);
            [r, g, b, (255.0 * cover + 0.5) as u8]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_has_its_known_points() {
        for (linear, expected) in [
            (-1.0, 0),
            (0.0, 0),
            (0.214, 127),
            (0.5, 188),
            (1.0, 255),
            (9.0, 255),
        ] {
            assert_eq!(srgb8(linear), expected, "{linear}");
        }
        assert_eq!(rgb8([0.25, 0.5, 1.0], 2.0), [188, 255, 255]);
    }
}
