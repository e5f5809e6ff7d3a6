//! What channels cost: time and error of a fill of one value, of colours and of 31 bands, preset by preset.
//!
//! `cargo bench -p gonia-brdf --bench channels [-- MATERIAL …] [PRESET …] [--step 2] [all]` prints a table: of every
//! tenth of the paper's poses, on a grid of 4°; `all`: of all of them. CPU-s: choosing and filling; the error is the RMS
//! of ln(f/f_true) over cells with both θ ≤ 75°, of all channels. `few` with numbers of samples prints the same of so many
//! samples at random pairs of directions, fitted place by place; `threes` fits bands three at a time.

#![allow(clippy::expect_used)]

mod plan;

use gonia_brdf::interpolate::{AnyKernel, Data, NewBlock, Preset, fill, select};
use gonia_brdf::progress::silent;
use gonia_brdf::random::Random;
use gonia_brdf::scattered::ScatteredFit;
use gonia_brdf::{Bins, Brdf, DenseBrdf, Direction, Elementary, Grid, Sample};
use plan::{NOISE, Poses, cpu_seconds, material, measure_with};

/// Every so many lights and views are compared with the truth.
const COMPARED: usize = 7;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let step = arguments.iter().position(|a| a == "--step");
    let step: f64 = step.map_or(4.0, |k| arguments[k + 1].parse().expect("a number"));
    let poses = match arguments.iter().any(|a| a == "all") {
        true => Poses::paper(),
        false => Poses::tenth(),
    };
    let grid = Grid::with_step_deg(step).expect("a grid step");
    let names: Vec<&str> = match plan::named(&arguments) {
        all if all.len() == plan::MATERIALS.len() => vec!["fabric"],
        named => named,
    };
    if arguments.iter().any(|a| a == "few") {
        return few_samples(grid, &names, &arguments);
    }
    println!("| material | preset | channels | CPU-s | of colours | interior |");
    println!("|---|---|---|---|---|---|");
    let has = |preset: &Preset| arguments.iter().any(|a| a == preset.name());
    let any = Preset::ALL.iter().any(has);
    let wanted = |preset: &Preset| !any || has(preset);
    for name in names {
        let material = material(name);
        let samples = measure_with(&*material, 0.0, &poses);
        for preset in Preset::ALL.into_iter().filter(wanted) {
            let colours = row::<3>(grid, &samples, &*material, preset);
            let one = row::<1>(grid, &samples, &*material, preset);
            let bands = row::<31>(grid, &samples, &*material, preset);
            for (channels, (time, error)) in [(1, one), (3, colours), (31, bands)] {
                println!(
                    "| {name} | {} | {channels} | {time:.1} | {:.2} | {error:.4} |",
                    preset.name(),
                    time / colours.0,
                );
            }
        }
    }
}

/// A channel's value between those of colours: the first is red, the one in the middle green, the last blue.
fn channel<const N: usize>(rgb: [f64; 3], channel: usize) -> f64 {
    let at = match N {
        1 => 1.0,
        _ => 2.0 * channel as f64 / (N - 1) as f64,
    };
    let first = (at as usize).min(1);
    let share = at - first as f64;
    (1.0 - share) * rgb[first] + share * rgb[first + 1]
}

/// CPU seconds of a fill, and its error.
fn row<const N: usize>(
    grid: Grid,
    samples: &[Sample],
    material: &dyn Brdf,
    preset: Preset,
) -> (f64, f64)
where
    dyn AnyKernel: NewBlock<N>,
{
    let samples = noisy::<N>(samples);
    let bins = Bins::new(grid, &samples);
    drop(samples);
    let start = cpu_seconds();
    let mut base = preset.settings();
    base.block_deg = base.block_deg.max(2.0 * grid.step_deg());
    let data = Data::thinned(&bins, base.one_bin_in);
    let settings = select(&data, base).settings;
    let dense = fill(&data, &settings, &silent).expect("enough bins");
    (cpu_seconds() - start, error(&dense, material))
}

/// The samples with so many channels, and noise.
fn noisy<const N: usize>(samples: &[Sample]) -> Vec<Sample<N>> {
    let mut random = Random::new(11);
    let noisy = |s: &Sample| {
        let rgb = s.rgb.map(f64::from);
        let mut value = |c: usize| channel::<N>(rgb, c) * (1.0 + NOISE * random.normal());
        s.with_values(std::array::from_fn::<f32, N, _>(|c| value(c) as f32))
    };
    samples.iter().map(noisy).collect()
}

/// The error of a BRDF.
fn error<const N: usize>(dense: &DenseBrdf<N>, material: &dyn Brdf) -> f64 {
    let grid = dense.grid();
    let (mut squares, mut count) = (0.0, 0.0);
    let inner = |d: &usize| grid.direction(*d).theta_deg() <= 75.0;
    let directions = || (0..grid.n_directions()).step_by(COMPARED).filter(inner);
    for light in directions() {
        for view in directions() {
            let [i, v] = [light, view].map(|d| grid.direction(d).to_vec3());
            let truth = material.eval(i, v);
            for (c, found) in dense.at(light, view).into_iter().enumerate() {
                squares += (f64::from(found) / channel::<N>(truth, c))
                    .natural_log()
                    .powi(2);
                count += 1.0;
            }
        }
    }
    (squares / count).sqrt()
}

/// Rows of samples at random pairs of directions.
fn few_samples(grid: Grid, names: &[&str], arguments: &[String]) {
    println!(
        "| material | samples | channels | choosing, CPU-s | fill, CPU-s | of colours | interior |"
    );
    println!("|---|---|---|---|---|---|---|");
    let by_threes = arguments.iter().any(|a| a == "threes");
    let step = arguments.iter().position(|a| a == "--step");
    let words = arguments.iter().enumerate();
    let words = words.filter(|(k, _)| step.is_none_or(|step| *k != step + 1));
    let counts: Vec<usize> = words.filter_map(|(_, word)| word.parse().ok()).collect();
    for name in names {
        let material = material(name);
        for count in &counts {
            let mut random = Random::new(*count as u64);
            let lowest = 80f64.to_radians().cosine();
            let mut direction = || {
                let theta = random.between(lowest, 1.0).arc_cosine();
                Direction::from_deg(theta.to_degrees(), random.between(0.0, 360.0))
            };
            let sample = |_| {
                let (light, view) = (direction(), direction());
                let value = material.eval(light.to_vec3(), view.to_vec3());
                Sample::new(light, view, value.map(|f| f as f32))
            };
            let samples: Vec<Sample> = (0..*count).map(sample).collect();
            let one = few_row::<1>(grid, &samples, &*material, false);
            let colours = few_row::<3>(grid, &samples, &*material, false);
            let bands = few_row::<31>(grid, &samples, &*material, by_threes);
            let all = |row: [f64; 3]| row[0] + row[1];
            for (channels, row) in [(1, one), (3, colours), (31, bands)] {
                println!(
                    "| {name} | {count} | {channels} | {:.2} | {:.2} | {:.2} | {:.4} |",
                    row[0],
                    row[1],
                    all(row) / all(colours),
                    row[2],
                );
            }
        }
    }
}

/// CPU seconds of choosing, by three channels that stand for all, and of a fill, and its error.
fn few_row<const N: usize>(
    grid: Grid,
    samples: &[Sample],
    material: &dyn Brdf,
    by_threes: bool,
) -> [f64; 3] {
    let samples = noisy::<N>(samples);
    let of = |channels: [usize; 3]| -> Vec<Sample> {
        let three = |s: &Sample<N>| s.with_values(channels.map(|c| s.rgb[c]));
        samples.iter().map(three).collect()
    };
    let start = cpu_seconds();
    let fit = ScatteredFit::new(&of([N / 6, N / 2, 5 * N / 6]), None).expect("enough samples");
    let chosen = cpu_seconds();
    let dense = if by_threes {
        let mut planes: [Vec<f32>; N] = std::array::from_fn(|_| Vec::new());
        for first in (0..N).step_by(3) {
            let channels = [0, 1, 2].map(|c| (first + c).min(N - 1));
            let (dense, _) = fit.of_channels(&of(channels)).dense(grid, false);
            for (channel, plane) in channels.into_iter().zip(dense.into_planes()) {
                planes[channel] = plane;
            }
        }
        DenseBrdf::new(grid, planes).expect("planes of the grid")
    } else {
        fit.of_channels(&samples).dense(grid, false).0
    };
    let end = cpu_seconds();
    [chosen - start, end - chosen, error(&dense, material)]
}
