//! Bilinear demosaicing of a merged Bayer frame: a photosite keeps its own colour, and gets the mean
//! of the nearest ones of the others. Patches are medians over many pixels, so that sharpness is
//! worth less here than a mean that is linear in the photosites and passes their variances on.

use gonia_rig::Bayer;

/// RGB and its variances from one plane of values and one of variances.
pub fn bilinear(
    value: &[f32],
    variance: &[f32],
    width: usize,
    pattern: Bayer,
) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let height = value.len() / width.max(1);
    let colors = pattern.colors();
    let near = [0, 1].map(|y| [0, 1].map(|x| [0, 1, 2].map(|c| neighbours(&colors, [x, y], c))));
    let mut rgb = Vec::with_capacity(value.len());
    let mut spread = Vec::with_capacity(value.len());
    for y in 0..height {
        for x in 0..width {
            let (mut mean, mut var) = ([0.0; 3], [0.0; 3]);
            for (c, offsets) in near[y % 2][x % 2].iter().enumerate() {
                let (mut sum, mut var_sum, mut n) = (0.0, 0.0, 0.0);
                for [dx, dy] in offsets {
                    let (Some(x), Some(y)) = (x.checked_add_signed(*dx), y.checked_add_signed(*dy))
                    else {
                        continue;
                    };
                    if x < width && y < height {
                        sum += value[y * width + x];
                        var_sum += variance[y * width + x];
                        n += 1.0;
                    }
                }
                (mean[c], var[c]) = (sum / n, var_sum / (n * n));
            }
            rgb.push(mean);
            spread.push(var);
        }
    }
    (rgb, spread)
}

/// Where a photosite at a place of the pattern finds a colour: at itself, or else at all those of
/// the 3 × 3 around it. In frames of at least 2 × 2 one of them is always inside.
fn neighbours(colors: &[[usize; 2]; 2], at: [usize; 2], color: usize) -> Vec<[isize; 2]> {
    if colors[at[1]][at[0]] == color {
        return vec![[0, 0]];
    }
    let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| [dx, dy]));
    around
        .filter(|[dx, dy]: &[isize; 2]| {
            let place = |i: usize, d: isize| (at[i] as isize + d).rem_euclid(2) as usize;
            colors[place(1, *dy)][place(0, *dx)] == color
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_of_each_colour_is_kept_inside_the_frame_whatever_the_pattern() {
        let (width, height) = (12, 10);
        let truth =
            |x: usize, y: usize, c: usize| 1.0 + c as f32 + 0.1 * x as f32 + 0.03 * y as f32;
        for pattern in [Bayer::Rggb, Bayer::Bggr, Bayer::Grbg, Bayer::Gbrg] {
            let colors = pattern.colors();
            let mosaic: Vec<f32> = (0..width * height)
                .map(|i| (i % width, i / width))
                .map(|(x, y)| truth(x, y, colors[y % 2][x % 2]))
                .collect();
            let (rgb, variance) = bilinear(&mosaic, &vec![1.0; width * height], width, pattern);
            for (i, pixel) in rgb.iter().enumerate() {
                let (x, y) = (i % width, i / width);
                if (1..width - 1).contains(&x) && (1..height - 1).contains(&y) {
                    for c in 0..3 {
                        assert!(
                            (pixel[c] - truth(x, y, c)).abs() < 1e-5,
                            "{pattern:?} {x} {y} {c}"
                        );
                    }
                    assert_eq!(variance[i][colors[y % 2][x % 2]], 1.0);
                    assert!(variance[i].iter().all(|v| *v <= 1.0));
                }
                assert!(pixel.iter().all(|v| v.is_finite()));
            }
        }
    }

    #[test]
    fn a_saturated_photosite_marks_the_pixels_that_are_made_of_it() {
        let mut mosaic = vec![1.0f32; 64];
        mosaic[3 * 8 + 3] = f32::INFINITY;
        let (rgb, _) = bilinear(&mosaic, &[1.0; 64], 8, Bayer::Rggb);
        // (3, 3) is blue: the blue of the eight around it is made of it.
        let marked = rgb.iter().filter(|p| p.contains(&f32::INFINITY)).count();
        assert_eq!(marked, 9);
        assert_eq!(rgb[3 * 8 + 3][1], 1.0);
    }
}
