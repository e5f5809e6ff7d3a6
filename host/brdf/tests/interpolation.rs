//! What the interpolation owes to any material, on a plan of some hundred frames.

use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, local_direction};
use gonia_brdf::hemisphere::{paper_lights, paper_views};
use gonia_brdf::interpolate::coordinates::Point;
use gonia_brdf::interpolate::cross_validation::Fold;
use gonia_brdf::interpolate::datum::{Datum, half_of_data};
use gonia_brdf::interpolate::hierarchy::{Detail, Found, Hierarchy, Neighbours};
use gonia_brdf::interpolate::patches::{Patch, cover};
use gonia_brdf::interpolate::refine::Refiner;
use gonia_brdf::interpolate::{
    Calibration, Candidate, Coordinates, Data, FillSettings, Kernel, Origin, Preset, fill,
    fill_with_errors, origins, select,
};
use gonia_brdf::model::{Brdf, Ggx, Kurt, KurtLobe, Ward};
use gonia_brdf::progress::silent;
use gonia_brdf::random::Random;
use gonia_brdf::{Bins, DenseBrdf, Direction, Grid, Sample};

/// Standard deviation of the samples' noise, relative.
const NOISE: f64 = 0.02;

/// Every ninth frame of the paper's plan, points 56 mm apart.
fn measure(model: &dyn Brdf) -> Vec<Sample> {
    measure_every(9, model)
}

fn measure_every(nth: usize, model: &dyn Brdf) -> Vec<Sample> {
    let (lights, views) = (paper_lights(), paper_views());
    let mut random = Random::new(1);
    let mut samples = Vec::new();
    for frame in (0..lights.len() * views.len()).step_by(nth) {
        let (light, view) = (lights[frame / views.len()], views[frame % views.len()]);
        for (x, y) in (-4..=4).flat_map(|x| (-4..=4).map(move |y| (x, y))) {
            let point = [0.056 * f64::from(x), 0.056 * f64::from(y)];
            let l = local_direction(light, 1.1, point);
            let v = local_direction(view, 1.8, point);
            let value = model.eval(l, v);
            let rgb = value.map(|value| (value * (1.0 + NOISE * random.normal())) as f32);
            let (l, v) = (Direction::from_vec3(l), Direction::from_vec3(v));
            samples.push(Sample::new(l, v, rgb).in_frame(frame as u32));
        }
    }
    samples
}

fn broad() -> Kurt {
    Kurt::new(
        [0.2, 0.15, 0.1],
        &[KurtLobe {
            specular: [2.0, 1.6, 1.2],
            f0: 0.05,
            mx: 0.15,
            my: 0.4,
            alpha: 0.3,
            azimuth_deg: 31.0,
        }],
    )
}

fn angles(bin_light: [f32; 3], bin_view: [f32; 3]) -> (f64, f64) {
    let deg = |d: [f32; 3]| f64::from(d[2]).min(1.0).arc_cosine().to_degrees();
    (deg(bin_light), deg(bin_view))
}

#[test]
fn left_out_bins_lie_within_their_error_bars() {
    let grid = Grid::with_step_deg(4.0).unwrap();
    for model in [broad(), Kurt::two_thread_fabric()] {
        let bins = Bins::new(grid, &measure(&model));
        let data = Data::new(&bins);
        let settings = FillSettings {
            noise_variance: (NOISE * NOISE) as f32,
            ..FillSettings::DEFAULT
        };
        let calibration = Calibration::new(&data, &settings).unwrap();
        // Other frames than those that the calibration left out.
        let mut shares = [[0.0f32; 2]; 4];
        for number in 0..4 {
            let fold = Fold::new(&bins, number, 24, 4000).unwrap();
            let predictions = fold.predict(&data, &settings);
            let mut bright: Vec<f32> = predictions.iter().map(|p| p.bin.median[1]).collect();
            bright.sort_by(f32::total_cmp);
            let bright = bright[bright.len() * 9 / 10];
            for p in &predictions {
                let (i, v) = angles(p.bin.light, p.bin.view);
                let strata = [
                    true,
                    i.max(v) <= 75.0,
                    i.max(v) > 75.0,
                    p.bin.median[1] > bright,
                ];
                for covered in calibration.covers(p) {
                    for (share, _) in shares.iter_mut().zip(strata).filter(|(_, inside)| *inside) {
                        share[0] += p.weight * f32::from(u8::from(covered));
                        share[1] += p.weight;
                    }
                }
            }
        }
        for (name, [inside, all]) in ["all", "interior", "grazing", "bright"].iter().zip(shares) {
            let percent = 100.0 * inside / all;
            println!("{name}: {percent:.1} % of {all}");
            assert!((93.0..=97.0).contains(&percent), "{name}: {percent} %");
        }
    }
}

/// Materials that no constant of the choice or the error bars was found on.
fn others() -> [Box<dyn Brdf>; 2] {
    [
        Box::new(Ggx {
            diffuse: [0.3, 0.2, 0.1],
            specular: [0.9; 3],
            f0: 0.06,
            alpha_x: 0.18,
            alpha_y: 0.3,
            azimuth_deg: 50.0,
        }),
        Box::new(Ward {
            diffuse: [0.2, 0.3, 0.2],
            specular: [0.15; 3],
            alpha_x: 0.12,
            alpha_y: 0.25,
            azimuth_deg: 100.0,
        }),
    ]
}

#[test]
fn true_values_lie_within_the_error_bars_of_their_cells() {
    let grid = Grid::with_step_deg(4.0).unwrap();
    let patches = cover(grid, &[8.0, 4.0]).patches;
    let models = [
        Box::new(broad()) as Box<dyn Brdf>,
        Box::new(Kurt::two_thread_fabric()),
        Box::new(Kurt::white_reference_fabric()),
    ];
    for (number, model) in models.into_iter().chain(others()).enumerate() {
        let bins = Bins::new(grid, &measure_every(10, &*model));
        let data = Data::new(&bins);
        let settings = select(&data, FillSettings::DEFAULT).settings;
        let calibration = Calibration::new(&data, &settings).unwrap();
        let moved = data.moved(settings.coordinates);
        let hierarchy = moved.as_ref().unwrap_or(data.hierarchy());
        let origins = origins(&bins);
        let mut refiner = Refiner::new(&settings);
        let mut shares = [[0.0f64; 2]; 4];
        // Pairs without a pattern.
        for k in 0..800 {
            let (p, q) = (
                &patches[k * 7919 % patches.len()],
                &patches[k * 104_729 % patches.len()],
            );
            let solved = refiner.solve(hierarchy, &settings, (p, q), true);
            let (rows, columns) = (p.vectors.len(), q.vectors.len());
            // Around the pole a pair has thousands of cells, with one error.
            for k in (0..rows * columns).step_by((rows * columns / 16).max(1)) {
                let (a, b) = (k / columns, k % columns);
                let origin = origins[grid.cell(p.directions[a] as usize, q.directions[b] as usize)];
                if origin == Origin::Extrapolated as u8 {
                    continue;
                }
                let (light, view) = (p.vectors[a], q.vectors[b]);
                let (log, variance) = (solved.cells[k], solved.variances[k]);
                let error = calibration.standard_error(light, view, log, variance);
                let truth = model.eval(light, view);
                let is_grazing = light[2].min(view[2]) < 75f64.to_radians().cosine();
                let is_measured = origin != Origin::Interpolated as u8;
                let strata = [true, !is_grazing, is_grazing, is_measured];
                for c in 0..3 {
                    let off = (f64::from(log[c]) - truth[c].natural_log()).abs();
                    let inside = off <= 1.96 * f64::from(error[c]);
                    for (share, _) in shares.iter_mut().zip(strata).filter(|(_, is_in)| *is_in) {
                        share[0] += f64::from(u8::from(inside));
                        share[1] += 1.0;
                    }
                }
            }
        }
        let percent = shares.map(|[inside, all]| 100.0 * inside / all);
        println!("material {number}: {percent:.1?} % of all, interior, grazing, measured");
        // Where noise hides the error, the factor is the usual one of some materials, not this one's.
        let bounds = 93.0..=97.0;
        assert!(bounds.contains(&percent[0]), "{number}: {percent:?}");
    }
}

#[test]
fn every_cell_has_an_error_and_knows_where_its_value_is_from() {
    let grid = Grid::with_step_deg(6.0).unwrap();
    let bins = Bins::new(grid, &measure(&broad()));
    let data = Data::new(&bins);
    let settings = FillSettings {
        neighbours: 48,
        ..FillSettings::DEFAULT
    };
    let calibration = Calibration::new(&data, &settings).unwrap();
    let (dense, bars) = fill_with_errors(&data, &settings, &calibration, &silent).unwrap();
    assert_eq!(dense, fill(&data, &settings, &silent).unwrap());
    for plane in &bars.standard_error {
        assert!(plane.iter().all(|e| e.is_finite() && *e >= 0.0));
    }
    // One of the plan's nine views lies at 60°/144°.
    let origin = |i: f64, v: f64| {
        let at = |theta, phi| grid.nearest(theta, phi).unwrap();
        bars.origin[grid.cell(at(i, 30.0), at(v, 144.0))]
    };
    assert_eq!(origin(84.0, 84.0), Origin::Extrapolated as u8);
    assert_ne!(origin(84.0, 60.0), Origin::Extrapolated as u8);
    let count = |o: Origin| bars.origin.iter().filter(|k| **k == o as u8).count();
    assert_eq!(count(Origin::Measured), bins.bins().len());
    assert!(count(Origin::Reciprocal) > 0 && count(Origin::Interpolated) > 0);
}

#[test]
fn a_gap_in_azimuth_is_extrapolated() {
    let grid = Grid::with_step_deg(6.0).unwrap();
    let mut samples = measure(&broad());
    // Neither light nor view between 90 and 180 degrees.
    samples.retain(|s| {
        let in_gap = |theta: f32, phi: f32| theta > 5.0 && (90.0..=180.0).contains(&phi);
        !in_gap(s.theta_i_deg, s.phi_i_deg) && !in_gap(s.theta_v_deg, s.phi_v_deg)
    });
    let bins = Bins::new(grid, &samples);
    let data = Data::new(&bins);
    let settings = FillSettings {
        neighbours: 32,
        tolerance: f32::INFINITY,
        ..FillSettings::DEFAULT
    };
    let calibration = Calibration::new(&data, &settings).unwrap();
    let (_, bars) = fill_with_errors(&data, &settings, &calibration, &silent).unwrap();
    let origin = |i: (f64, f64), v: (f64, f64)| {
        let at = |(theta, phi)| grid.nearest(theta, phi).unwrap();
        bars.origin[grid.cell(at(i), at(v))]
    };
    let extrapolated = Origin::Extrapolated as u8;
    assert_eq!(origin((60.0, 132.0), (42.0, 0.0)), extrapolated);
    assert_eq!(origin((42.0, 0.0), (60.0, 132.0)), extrapolated);
    assert_ne!(origin((60.0, 240.0), (42.0, 0.0)), extrapolated);
    // Near the pole all azimuths are near.
    assert_ne!(origin((6.0, 132.0), (42.0, 0.0)), extrapolated);
}

#[test]
fn a_pair_is_refined_where_a_sharp_lobe_passes_and_nowhere_on_a_matte_material() {
    let grid = Grid::PAPER;
    let sharp = Kurt::new(
        [0.2; 3],
        &[KurtLobe {
            specular: [1.0; 3],
            f0: 0.05,
            mx: 0.04,
            my: 0.04,
            alpha: 0.3,
            azimuth_deg: 0.0,
        }],
    );
    let at = |theta: f64, phi: f64| -> Vec3 { Direction::from_deg(theta, phi).to_vec3() };
    let is_refined = |model: &dyn Brdf, view: Vec3| {
        let bins = Bins::new(grid, &measure(model));
        let settings = FillSettings {
            noise_variance: (NOISE * NOISE) as f32,
            ..FillSettings::DEFAULT
        };
        let hierarchy =
            Hierarchy::with_mirror_images(half_of_data(&bins, 1, settings.coordinates), 1);
        let patches = cover(grid, &[settings.block_deg, 0.5 * settings.block_deg]).patches;
        let around = |d: Vec3| {
            let near = |p: &&Patch| (0..3).map(|k| p.centre[k] * d[k]).sum::<f64>();
            patches
                .iter()
                .max_by(|a, b| near(a).total_cmp(&near(b)))
                .unwrap()
        };
        let pair = (around(at(30.0, 0.0)), around(view));
        let mut refiner = Refiner::new(&settings);
        let solved = refiner.solve(&hierarchy, &settings, pair, false);
        solved.refined.is_some()
    };
    assert!(is_refined(&sharp, at(32.0, 180.0)));
    assert!(!is_refined(&sharp, at(45.0, 90.0)));
    assert!(!is_refined(
        &Kurt::white_reference_fabric(),
        at(32.0, 180.0)
    ));
}

#[test]
fn samples_without_frames_are_grouped_by_clusters() {
    let mut samples = measure(&broad());
    samples.iter_mut().for_each(|s| s.frame = Sample::NO_FRAME);
    let bins = Bins::new(Grid::with_step_deg(4.0).unwrap(), &samples);
    let data = Data::new(&bins);
    let coordinates = Coordinates::sum_difference(1.0);
    let fold = Fold::new(&bins, 0, 24, 500).unwrap();
    let settings = FillSettings {
        coordinates,
        ..FillSettings::DEFAULT
    };
    let predictions = fold.predict(&data, &settings);
    assert!(predictions.len() >= 100);
    let near = predictions
        .iter()
        .filter(|p| p.residual[1].unwrap().abs() < 0.1)
        .count();
    assert!(10 * near > 8 * predictions.len(), "{near}");
    assert_eq!(select(&data, FillSettings::DEFAULT).candidates.len(), 5);
}

/// A dull base, and a lobe of 12° around the light's own direction.
struct RetroReflector;

impl Brdf for RetroReflector {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let apart: f64 = (0..3).map(|k| (light[k] - view[k]).powi(2)).sum();
        let width = 12f64.to_radians();
        [0.1 + (-0.5 * apart / (width * width)).exponential(); 3]
    }
}

#[test]
fn of_a_retro_reflector_the_kernel_looks_at_the_difference() {
    let bins = Bins::new(Grid::with_step_deg(4.0).unwrap(), &measure(&RetroReflector));
    let data = Data::new(&bins);
    let selection = select(&data, FillSettings::DEFAULT);
    assert!(selection.settings.kernel_weight > 1.0);
    // Nearer than with a kernel that looks at half vector and difference alike.
    let error_at_most = |weight: f64| {
        let of = |c: &&Candidate| c.settings.kernel_weight <= weight;
        let errors = selection.candidates.iter().filter(of);
        errors.map(|c| c.log_error).fold(f64::INFINITY, f64::min)
    };
    let (best, alike) = (error_at_most(f64::INFINITY), error_at_most(1.0));
    assert!(best < 0.75 * alike, "{best} {alike}");
}

/// It would be nearer at frames left out by four in a hundred, and twice as far off between them.
#[test]
fn of_a_matte_material_it_looks_at_half_vector_and_difference() {
    let matte = Kurt::white_reference_fabric();
    let bins = Bins::new(
        Grid::with_step_deg(4.0).unwrap(),
        &measure_every(10, &matte),
    );
    let data = Data::new(&bins);
    let settings = select(&data, FillSettings::DEFAULT).settings;
    assert!(settings.kernel_weight <= 1.0, "{settings:?}");
    let error = interior_error(&fill(&data, &settings, &silent).unwrap(), &matte);
    assert!(error < 0.01, "{error}");
}

#[test]
fn on_few_poses_presets_choose_alike_and_the_slower_is_the_nearer() {
    let grid = Grid::with_step_deg(4.0).unwrap();
    for model in others() {
        let bins = Bins::new(grid, &measure(&*model));
        let data = Data::new(&bins);
        let chosen = [Preset::Preview, Preset::Fast, Preset::Default]
            .map(|preset| select(&data, preset.settings()).settings);
        let choice = |s: &FillSettings| (s.coordinates, s.kernel_weight);
        assert!(
            chosen.iter().all(|s| choice(s) == choice(&chosen[0])),
            "{chosen:?}"
        );
        let errors = chosen.map(|settings| {
            let dense = fill(&data, &settings, &silent).unwrap();
            interior_error(&dense, &*model)
        });
        println!("{errors:?}");
        assert!(
            errors.is_sorted_by(|quick, slow| quick > slow),
            "{errors:?}"
        );
    }
}

#[test]
fn beyond_all_that_was_measured_a_lobe_goes_on_rising() {
    // Both polar angles above 78 degrees: no frame shows them, and a broad lobe rises there as far again as on the whole
    // edge of what was measured.
    let grid = Grid::with_step_deg(4.0).unwrap();
    let model = Kurt::white_reference_fabric();
    let bins = Bins::new(grid, &measure_every(2, &model));
    let data = Data::new(&bins);
    let settings = select(&data, FillSettings::DEFAULT).settings;
    let dense = fill(&data, &settings, &silent).unwrap();
    let beyond = |d: &usize| grid.direction(*d).theta_deg() > 78.0;
    let directions: Vec<usize> = (0..grid.n_directions()).filter(beyond).collect();
    let pairs = directions
        .iter()
        .flat_map(|i| directions.iter().map(move |v| (*i, *v)));
    let squares: Vec<f64> = pairs
        .map(|(light, view)| {
            let [i, v] = [light, view].map(|d| grid.direction(d).to_vec3());
            let truth = model.eval(i, v)[1];
            (f64::from(dense.at(light, view)[1]) / truth)
                .natural_log()
                .powi(2)
        })
        .collect();
    let error = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    println!("log RMS {error:.4}");
    // It was 0.074 where blocks on the edge were carried on as they are.
    assert!(error < 0.05, "{error}");
}

/// RMS of ln(f/f_true) where both θ ≤ 75°, of one light in 29.
fn interior_error(dense: &DenseBrdf, model: &dyn Brdf) -> f64 {
    let grid = dense.grid();
    let inside: Vec<usize> = (0..grid.n_directions())
        .filter(|d| grid.direction(*d).theta_deg() <= 75.0)
        .collect();
    let pairs = inside
        .iter()
        .step_by(29)
        .flat_map(|light| inside.iter().map(move |view| (*light, *view)));
    let squares: Vec<f64> = pairs
        .map(|(light, view)| {
            let [i, v] = [light, view].map(|d| grid.direction(d).to_vec3());
            (f64::from(dense.at(light, view)[1]) / model.eval(i, v)[1])
                .natural_log()
                .powi(2)
        })
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn blocks_leave_no_seams_whole_or_refined() {
    // Blocks of as many cells as on the 2° grid.
    let grid = Grid::with_step_deg(3.0).unwrap();
    for (model, tolerance) in [(broad(), f32::INFINITY), (Kurt::two_thread_fabric(), 1.0)] {
        let bins = Bins::new(grid, &measure_every(2, &model));
        let data = Data::new(&bins);
        let settings = FillSettings {
            block_deg: 12.0,
            tolerance,
            noise_variance: (NOISE * NOISE) as f32,
            ..FillSettings::DEFAULT
        };
        let dense = fill(&data, &settings, &silent).unwrap();
        let (across, inside) = bends(&dense, &model, settings.block_deg);
        println!("tolerance {tolerance}: bends of {across:.5} across borders, {inside:.5} inside");
        // 1.6 times where blending may shift blocks by their usual difference only.
        assert!(across < 1.3 * inside, "{across} {inside}");
    }
}

/// RMS of second differences of the error's logarithm between three neighbouring cells, along all
/// four angles: with a border of two blocks among them, and inside of blocks. Both θ ≤ 75°.
fn bends(dense: &DenseBrdf, model: &dyn Brdf, block_deg: f64) -> (f64, f64) {
    let grid = dense.grid();
    let (n, n_phi) = (grid.n_directions(), grid.n_phi());
    let mut block = vec![0; n];
    for (number, patch) in cover(grid, &[block_deg]).patches.iter().enumerate() {
        for direction in &patch.directions {
            block[*direction as usize] = number;
        }
    }
    let off = |light: usize, view: usize| {
        let [i, v] = [light, view].map(|d| grid.direction(d).to_vec3());
        (f64::from(dense.at(light, view)[1]) / model.eval(i, v)[1]).natural_log()
    };
    let interior = |d: usize| grid.direction(d).theta_deg() <= 75.0;
    // Rows of one row of blocks count as one.
    let height = (block_deg / grid.step_deg()).round() as usize;
    let mut rows = vec![[[0.0; 2]; 2]; 2 * grid.n_theta()];
    for light in (0..n).step_by(29).filter(|d| interior(*d)) {
        for view in (n_phi..n).filter(|d| interior(*d)) {
            let around = |k: usize| view / n_phi * n_phi + (view + k) % n_phi;
            let triples = [[around(1), around(2)], [view + n_phi, view + 2 * n_phi]];
            for (axis, [b, c]) in triples.into_iter().enumerate() {
                if c < n && interior(c) {
                    let bend = off(light, view) - 2.0 * off(light, b) + off(light, c);
                    let row = axis * grid.n_theta() + view / n_phi / height * height;
                    let sum = &mut rows[row][usize::from(block[view] == block[c])];
                    sum[0] += bend * bend;
                    sum[1] += 1.0;
                }
            }
        }
    }
    rows.retain(|row| row.iter().all(|[_, count]| *count > 0.0));
    let count: f64 = rows.iter().map(|row| row[0][1]).sum();
    let across: f64 = rows.iter().map(|row| row[0][0]).sum();
    let inside: f64 = rows.iter().map(|[a, i]| i[0] / i[1] * a[1]).sum();
    ((across / count).sqrt(), (inside / count).sqrt())
}

#[test]
fn on_a_sparse_plan_fine_blocks_stay_within_their_budget() {
    let grid = Grid::with_step_deg(4.0).unwrap();
    let bins = Bins::new(grid, &measure(&Kurt::two_thread_fabric()));
    let data = Data::new(&bins);
    let chosen = |budget: f32| {
        let base = FillSettings {
            block_deg: 20.0,
            neighbours: 48,
            budget,
            ..FillSettings::DEFAULT
        };
        select(&data, base).settings
    };
    // What the plan asks for, and a half of it.
    let fine_blocks = |settings: &FillSettings| {
        let hierarchy =
            Hierarchy::with_mirror_images(half_of_data(&bins, 1, settings.coordinates), 1);
        let patches = cover(grid, &[settings.block_deg, 0.5 * settings.block_deg]).patches;
        let mut refiner = Refiner::new(settings);
        let (mut parts, mut pairs) = (0, 0);
        for (k, p) in patches.iter().enumerate() {
            for q in &patches[k..] {
                let solved = refiner.solve(&hierarchy, settings, (p, q), false);
                parts += solved.refined.unwrap_or(0);
                pairs += 1;
            }
        }
        parts as f32 / pairs as f32
    };
    let unlimited = chosen(f32::INFINITY);
    assert_eq!(unlimited.tolerance, FillSettings::DEFAULT.tolerance);
    let wanted = fine_blocks(&unlimited);
    let limited = chosen(0.5 * wanted);
    assert!(limited.tolerance > unlimited.tolerance);
    let spent = fine_blocks(&limited);
    println!("{wanted} blocks a pair wanted, {spent} spent");
    assert!((0.35..0.65).contains(&(spent / wanted)), "{spent} {wanted}");
}

/// The default kernel and a smoother one, as a user writes them: without vectors.
enum Written {
    Matern32,
    Matern52,
}

impl Kernel for Written {
    fn name(&self) -> &str {
        match self {
            Written::Matern32 => "written matern-3/2",
            Written::Matern52 => "written matern-5/2",
        }
    }
    fn scale(&self) -> f32 {
        match self {
            Written::Matern32 => 3f32.sqrt(),
            Written::Matern52 => 5f32.sqrt(),
        }
    }
    fn correlation(&self, s: f32) -> f32 {
        match self {
            Written::Matern32 => (1.0 + s) * (-s).exponential(),
            Written::Matern52 => (1.0 + s + s * s / 3.0) * (-s).exponential(),
        }
    }
}

#[test]
fn a_kernel_of_ones_own_is_used_from_the_choice_of_settings_to_the_fill() {
    let grid = Grid::with_step_deg(6.0).unwrap();
    let model = broad();
    let bins = Bins::new(grid, &measure(&model));
    let data = Data::new(&bins);
    let base = FillSettings {
        block_deg: 12.0,
        kernel: &Written::Matern32,
        ..FillSettings::DEFAULT
    };
    let settings = select(&data, base).settings;
    assert_eq!(settings.kernel.name(), "written matern-3/2");
    assert!(settings.to_string().contains("written matern-3/2"));
    let error = |settings: &FillSettings| {
        let dense = fill(&data, settings, &silent).unwrap();
        assert!(dense.planes().iter().flatten().all(|v| *v > 0.0));
        interior_error(&dense, &model)
    };
    let usual = FillSettings {
        kernel: FillSettings::DEFAULT.kernel,
        ..settings
    };
    assert_ne!(usual, settings);
    let smoother = FillSettings {
        kernel: &Written::Matern52,
        ..settings
    };
    let [usual, written, smoother] = [usual, settings, smoother].map(|s| error(&s));
    println!("errors: {usual} by default, {written} written anew, {smoother} by Matern 5/2");
    assert!((written / usual - 1.0).abs() < 0.01, "{written} {usual}");
    assert!(
        smoother != usual && smoother < 2.0 * usual,
        "{smoother} {usual}"
    );
}

/// A pair of directions to predict.
#[derive(Clone)]
struct Wanted((Vec3, Vec3));

impl AsRef<(Vec3, Vec3)> for Wanted {
    fn as_ref(&self) -> &(Vec3, Vec3) {
        &self.0
    }
}

/// Counts how often data around a place are looked for: once a block.
struct Counting<'a>(&'a Hierarchy, std::cell::Cell<u32>);

impl Neighbours for Counting<'_> {
    fn around(&self, place: &Point, n: usize, found: &mut Vec<Found>) {
        self.1.set(self.1.get() + 1);
        self.0.around(place, n, found);
    }

    fn expand(&self, place: &Point, merged: &[Found], found: &mut Vec<Found>) {
        self.0.expand(place, merged, found);
    }

    fn datum(&self, detail: Detail, number: u32) -> Datum {
        self.0.datum(detail, number)
    }
}

#[test]
fn predictions_in_one_pair_share_its_blocks_and_are_those_of_each_alone() {
    let bins = Bins::new(Grid::PAPER, &measure(&*others()[1]));
    for tolerance in [0.7, f32::INFINITY, 0.0] {
        let settings = FillSettings {
            tolerance,
            noise_variance: (NOISE * NOISE) as f32,
            ..FillSettings::DEFAULT
        };
        let data = Hierarchy::with_mirror_images(half_of_data(&bins, 1, settings.coordinates), 1);
        let patches = cover(Grid::PAPER, &[8.0, 4.0]).patches;
        let pair = (&patches[40], &patches[130]);
        // A place in each part, and again, part by part.
        let mut wanted = Vec::new();
        for (a, b) in pair
            .0
            .parts
            .iter()
            .flat_map(|a| pair.1.parts.iter().map(move |b| (a, b)))
        {
            let place = (a.patch.vectors[0], b.patch.vectors[0]);
            wanted.extend([Wanted(place), Wanted(place)]);
        }
        let counting = Counting(&data, 0.into());
        let mut refiner = Refiner::new(&settings);
        refiner.prepare(&counting, &settings, pair);
        let shared = wanted.iter().map(|place| {
            let of = refiner.predict(&counting, &settings, pair, &mut vec![place.clone()]);
            (of.logs[0], of.variance, of.variance_of_mean)
        });
        let shared: Vec<_> = shared.collect();
        // The coarse block, the one that it is compared with, and one a part.
        let parts = pair.0.parts.len() * pair.1.parts.len();
        assert!(counting.1.get() as usize <= 2 + parts, "{:?}", counting.1);
        for (place, shared) in wanted.iter().zip(&shared) {
            let mut refiner = Refiner::new(&settings);
            refiner.prepare(&data, &settings, pair);
            let of = refiner.predict(&data, &settings, pair, &mut vec![place.clone()]);
            assert_eq!((of.logs[0], of.variance, of.variance_of_mean), *shared);
        }
    }
}
