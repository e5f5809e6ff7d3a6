//! Merging against the simulated sensor's truth.

use crate::hdr::*;
use gonia_brdf::Elementary;
use gonia_rig::Bayer;
use gonia_sim::scene::RawSensor;

const SIDE: usize = 160;

fn sensor(bayer: Option<Bayer>) -> Sensor {
    Sensor {
        black_counts: 64.0,
        saturation_counts: 3900.0,
        gain_e_per_count: 2.5,
        read_noise_e: 4.0,
        bayer,
    }
}

/// The simulated counterpart of [`sensor`], of 12 bits.
fn device() -> RawSensor {
    RawSensor {
        black_counts: 64.0,
        white_counts: 4095.0,
        gain_e_per_count: 2.5,
        read_noise_e: 4.0,
    }
}

/// Rates in counts a second over four orders of magnitude, one level a row.
fn level(row: usize, channel: usize) -> f32 {
    10f32.power(1.0 + 4.0 * row as f32 / SIDE as f32) * [1.0, 0.8, 0.6][channel]
}

fn expose(
    times: &[f64],
    channel_of: impl Fn(usize) -> Vec<usize>,
    seed: u64,
) -> Vec<(f64, RawFrame)> {
    let rates: Vec<f32> = (0..SIDE * SIDE)
        .flat_map(|i| {
            channel_of(i)
                .into_iter()
                .map(move |c| level(i / SIDE, c))
                .collect::<Vec<_>>()
        })
        .collect();
    let shot = |(k, time): (usize, &f64)| {
        let raw = RawFrame {
            width: SIDE,
            height: SIDE,
            channels: rates.len() / (SIDE * SIDE),
            counts: device().expose(&rates, *time, seed + k as u64),
        };
        (*time, raw)
    };
    times.iter().enumerate().map(shot).collect()
}

const TIMES: [f64; 5] = [0.02, 0.1, 0.5, 2.5, 12.5];

/// Mean and RMS of (value − truth)/σ, and the share of saturated values.
fn scores(radiance: &Radiance) -> (f64, f64, f64) {
    let (mut sum, mut squares, mut n, mut saturated) = (0.0, 0.0, 0.0, 0.0);
    for (i, (rgb, variance)) in radiance
        .frame
        .rgb
        .iter()
        .zip(&radiance.variance)
        .enumerate()
    {
        for c in 0..3 {
            if rgb[c] == f32::INFINITY {
                saturated += 1.0;
                continue;
            }
            let score = f64::from((rgb[c] - level(i / SIDE, c)) / variance[c].sqrt());
            sum += score;
            squares += score * score;
            n += 1.0;
        }
    }
    (sum / n, (squares / n).sqrt(), saturated / (n + saturated))
}

#[test]
fn rgb_brackets_are_unbiased_and_their_variance_is_the_true_one() {
    let radiance = merge_bracket(&expose(&TIMES, |_| vec![0, 1, 2], 1), &sensor(None));
    let (mean, rms, saturated) = scores(&radiance);
    // 77 thousand values: the mean of their scores is good to 0.004.
    assert!(mean.abs() < 0.03, "{mean}");
    assert!((rms - 1.0).abs() < 0.03, "{rms}");
    assert_eq!(saturated, 0.0);
    let worst = radiance.linearity.unwrap();
    assert!(worst.deviation.abs() < 0.01, "{worst:?}");
}

/// Mean of `shots` brackets of one photosite a level, less the truth, and its standard error; both over
/// the truth.
fn biases(levels: &[f32], shots: u64) -> Vec<[f64; 2]> {
    let repeated: Vec<f32> = levels.iter().flat_map(|l| [*l; SIDE]).collect();
    let mut sums = vec![[0.0f64; 2]; levels.len()];
    for shot in 0..shots {
        let seed = |k: usize| 100 * shot + k as u64;
        let counts: Vec<_> = (0..TIMES.len())
            .map(|k| device().expose(&repeated, TIMES[k], seed(k)))
            .collect();
        let exposures: Vec<_> = TIMES
            .iter()
            .copied()
            .zip(counts.iter().map(|c| &c[..]))
            .collect();
        let merged = merge::merge(&exposures, &sensor(None));
        for (i, (value, variance)) in merged.value.iter().zip(&merged.variance).enumerate() {
            sums[i / SIDE][0] += f64::from(*value);
            sums[i / SIDE][1] += f64::from(*variance);
        }
    }
    let n = shots as f64 * SIDE as f64;
    let bias = |(level, [value, variance]): (&f32, &[f64; 2])| {
        let truth = f64::from(*level);
        [value / n / truth - 1.0, (variance / n / n).sqrt() / truth]
    };
    levels.iter().zip(&sums).map(bias).collect()
}

#[test]
fn no_level_of_light_is_biased_not_even_where_an_exposure_begins_to_saturate() {
    let decades: Vec<f32> = (0..SIDE).map(|row| level(row, 0)).collect();
    // Where the longest exposure saturates, closely.
    let about_saturation: Vec<f32> = (0..40)
        .map(|k| (0.9 + 0.004 * k as f32) * (3900.0 - 64.0) / 12.5)
        .collect();
    for levels in [decades, about_saturation] {
        for (level, [off, noise]) in levels.iter().zip(biases(&levels, 40)) {
            assert!(
                off.abs() < 2e-4 + 4.5 * noise,
                "{level}: {off}, noise {noise}"
            );
        }
    }
}

#[test]
fn bayer_brackets_are_merged_before_they_are_demosaiced() {
    let pattern = Bayer::Grbg;
    let channel = |i: usize| vec![pattern.colors()[i / SIDE % 2][i % 2]];
    let radiance = merge_bracket(&expose(&TIMES, channel, 5), &sensor(Some(pattern)));
    // Levels grow by 6 % a row, and rows are what the missing colours are taken from.
    let (mean, _, saturated) = scores(&radiance);
    assert!(mean.abs() < 0.3, "{mean}");
    assert_eq!(saturated, 0.0);
    for (i, rgb) in radiance.frame.rgb.iter().enumerate() {
        let (row, column) = (i / SIDE, i % SIDE);
        if (1..SIDE - 1).contains(&row) && (1..SIDE - 1).contains(&column) {
            for c in 0..3 {
                let sd = radiance.variance[i][c].sqrt();
                let off = rgb[c] - level(row, c);
                assert!(
                    off.abs() < 6.0 * sd + 0.01 * level(row, c),
                    "{row} {column} {c}: {off}"
                );
            }
        }
    }
}

#[test]
fn what_saturates_in_every_exposure_is_marked() {
    let radiance = merge_bracket(&expose(&[0.5, 2.5], |_| vec![0], 9), &sensor(None));
    for (i, rgb) in radiance.frame.rgb.iter().enumerate() {
        let counts = 64.0 + 0.5 * level(i / SIDE, 0);
        // 3900 counts, and five times the noise about it.
        if !(3700.0..4100.0).contains(&counts) {
            assert_eq!(rgb[0] == f32::INFINITY, counts > 3900.0, "{counts}");
        }
    }
}

#[test]
fn a_wrong_exposure_time_or_black_level_shows_in_the_linearity() {
    let mut exposures = expose(&TIMES, |_| vec![0], 3);
    let told = merge_bracket(&exposures, &sensor(None)).linearity.unwrap();
    assert!(told.deviation.abs() < 0.01, "{told:?}");
    exposures[2].0 = 0.55;
    let told = merge_bracket(&exposures, &sensor(None)).linearity.unwrap();
    assert!((0.08..0.12).contains(&told.deviation.abs()), "{told:?}");
    exposures[2].0 = 0.5;
    let dark = Sensor {
        black_counts: 0.0,
        ..sensor(None)
    };
    let told = merge_bracket(&exposures, &dark).linearity.unwrap();
    assert!(told.deviation.abs() > LINEARITY_LIMIT, "{told:?}");
}
