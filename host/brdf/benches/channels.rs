//! What channels cost: time and error of a fill of one value, of colours and of 31 bands, preset by preset.
//!
//! `cargo bench -p gonia-brdf --bench channels [-- MATERIAL …] [PRESET …] [--step 2] [all]` prints a table: of every
//! tenth of the paper's poses, on a grid of 4°; `all`: of all of them. CPU-s: choosing and filling; the error is the RMS
//! of ln(f/f_true) over cells with both θ ≤ 75°, of all channels.

#![allow(clippy::expect_used)]

mod plan;

use gonia_brdf::interpolate::{AnyKernel, Data, NewBlock, Preset, fill, select};
use gonia_brdf::progress::silent;
use gonia_brdf::{Bins, Brdf, Elementary, Grid, Sample};
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
    println!("| material | preset | channels | CPU-s | of colours | interior |");
    println!("|---|---|---|---|---|---|");
    let names: Vec<&str> = match plan::named(&arguments) {
        all if all.len() == plan::MATERIALS.len() => vec!["fabric"],
        named => named,
    };
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
    let mut random = gonia_brdf::random::Random::new(11);
    let noisy = |s: &Sample| {
        let rgb = s.rgb.map(f64::from);
        let mut value = |c: usize| channel::<N>(rgb, c) * (1.0 + NOISE * random.normal());
        s.with_values(std::array::from_fn::<f32, N, _>(|c| value(c) as f32))
    };
    let samples: Vec<Sample<N>> = samples.iter().map(noisy).collect();
    let bins = Bins::new(grid, &samples);
    drop(samples);
    let start = cpu_seconds();
    let mut base = preset.settings();
    base.block_deg = base.block_deg.max(2.0 * grid.step_deg());
    let data = Data::thinned(&bins, base.one_bin_in);
    let settings = select(&data, base).settings;
    let dense = fill(&data, &settings, &silent).expect("enough bins");
    let time = cpu_seconds() - start;
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
    (time, (squares / count).sqrt())
}
