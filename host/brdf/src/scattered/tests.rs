//! The fit of few samples as a whole: symmetry, noise, error bars, tables and bands.
#![allow(clippy::unwrap_used)]

use super::*;
use crate::random::Random;

/// A lobe about the half vector over a base, `wide` as wide along x as across, and a share of it that goes with
/// twice the azimuth of the half vector.
fn material(light: Direction, view: Direction, wide: f64, wave: f64) -> f64 {
    let [i, v] = [light, view].map(Direction::to_vec3);
    let h = crate::direction::normalize([0, 1, 2].map(|k| i[k] + v[k]));
    let slope2 = (h[0] / wide).powi(2) + (h[1] * wide).powi(2);
    let lobe = (-slope2 / (0.09 * h[2] * h[2])).exponential();
    let planar = h[0] * h[0] + h[1] * h[1];
    let wave = 1.0 + wave * (h[0] * h[0] - h[1] * h[1]) / planar.max(1e-9);
    (0.03 + 0.2 * lobe) * wave
}

fn direction(random: &mut Random, one_azimuth: bool) -> Direction {
    let theta = random
        .between(80f64.to_radians().cosine(), 1.0)
        .arc_cosine();
    let phi = if one_azimuth {
        20.0
    } else {
        random.between(0.0, 360.0)
    };
    Direction::from_deg(theta.to_degrees(), phi)
}

fn samples(
    n: usize,
    one_azimuth: bool,
    value: impl Fn(Direction, Direction, f64) -> f64,
) -> Vec<Sample> {
    let mut random = Random::new(3);
    (0..n)
        .map(|_| {
            let light = direction(&mut random, one_azimuth);
            let view = direction(&mut random, false);
            let value = value(light, view, random.normal());
            Sample::new(light, view, [value as f32; 3])
        })
        .collect()
}

fn of_material(n: usize, one_azimuth: bool, wide: f64, wave: f64) -> Vec<Sample> {
    let noisy = |l, v, normal: f64| material(l, v, wide, wave) * (1.0 + 0.005 * normal);
    samples(n, one_azimuth, noisy)
}

/// RMS of the logarithm of the fit over the truth at random pairs, and the share of them within 1.96 standard
/// errors.
fn error(fit: &ScatteredFit, wide: f64, wave: f64) -> (f64, f64) {
    let mut random = Random::new(77);
    let (mut squares, mut within) = (0.0, 0.0);
    for _ in 0..500 {
        let (light, view) = (direction(&mut random, false), direction(&mut random, false));
        let truth = material(light, view, wide, wave);
        let (value, error) = fit.at(light, view);
        squares += (value[1] / truth).natural_log().powi(2) / 500.0;
        within += f64::from((value[1] - truth).abs() <= 1.96 * error[1]) / 500.0;
    }
    (squares.sqrt(), within)
}

#[test]
fn isotropy_is_assumed_of_one_azimuth_and_holds_at_all() {
    let fit = ScatteredFit::new(&of_material(1000, true, 1.0, 0.0), None).unwrap();
    assert_eq!(fit.choice().reason, Reason::Assumed);
    assert!(fit.choice().settings.symmetry.is_isotropic());
    let (rms, within) = error(&fit, 1.0, 0.0);
    assert!(rms < 0.015, "{rms}");
    assert!(within > 0.9, "{within}");
}

#[test]
fn isotropy_is_found_at_many_azimuths_and_two_per_cent_speak_against_it() {
    let isotropic = ScatteredFit::new(&of_material(1000, false, 1.0, 0.0), None).unwrap();
    assert_eq!(isotropic.choice().reason, Reason::Shown);
    assert!(isotropic.choice().settings.symmetry.is_isotropic());
    let (rms, _) = error(&isotropic, 1.0, 0.0);
    assert!(rms < 0.015, "{rms}");
    for (wide, wave) in [(1.0, 0.02), (1.5, 0.0)] {
        let fit = ScatteredFit::new(&of_material(1500, false, wide, wave), None).unwrap();
        let symmetry = fit.choice().settings.symmetry;
        assert!(!symmetry.is_isotropic(), "{wide} {wave}: {symmetry}");
    }
}

#[test]
fn a_mirror_plane_is_found_with_its_azimuth_and_fills_what_was_not_measured() {
    // Wide along an axis at 25 degrees; and a wave across it, which half a turn turns over.
    let turn = |d: Direction| Direction::from_deg(d.theta_deg(), d.phi_deg() - 25.0);
    let value = |light: Direction, view: Direction, skew: f64| {
        let (light, view) = (turn(light), turn(view));
        let sum = light.to_vec3()[0] + view.to_vec3()[0];
        material(light, view, 1.4, 0.0) * (1.0 + skew * sum)
    };
    for skew in [0.0, 0.3] {
        let noisy = |l, v, normal: f64| value(l, v, skew) * (1.0 + 0.005 * normal);
        let fit = ScatteredFit::new(&samples(900, false, noisy), None).unwrap();
        let symmetry = fit.choice().settings.symmetry;
        assert_eq!(
            symmetry.order(),
            if skew == 0.0 { 4 } else { 2 },
            "{symmetry}"
        );
        // Both planes of the first serve.
        let period = if skew == 0.0 { 90.0 } else { 180.0 };
        let azimuth = symmetry.plane().map(|p| p.azimuth_deg() % period);
        assert!(
            azimuth.is_some_and(|a| (a - 25.0).abs() < 2.0),
            "{symmetry}"
        );
    }
    // A sector of lights (and by reciprocity of views) that is measured on the other side of the plane only.
    let in_sector = |d: Direction| (30.0..110.0).contains(&turn(d).phi_deg());
    let others: Vec<Sample> = samples(1200, false, |l, v, _| value(l, v, 0.3))
        .into_iter()
        .filter(|s| {
            let phis = [s.phi_i_deg, s.phi_v_deg].map(f64::from);
            !phis
                .iter()
                .any(|phi| in_sector(Direction::from_deg(45.0, *phi)))
        })
        .collect();
    let mut random = Random::new(8);
    let pairs: Vec<_> = (0..1500)
        .map(|_| (direction(&mut random, false), direction(&mut random, false)))
        .filter(|(light, view)| in_sector(*light) && in_sector(*view))
        .collect();
    let error = |kind: SymmetryKind| {
        let fit = ScatteredFit::new(&others, Some(kind)).unwrap();
        let errors = fit.at_all(&pairs).into_iter().zip(&pairs);
        let squares =
            errors.map(|((at, _), (l, v))| (at[1] / value(*l, *v, 0.3)).natural_log().powi(2));
        (squares.sum::<f64>() / pairs.len() as f64).sqrt()
    };
    let (with, without) = (error(SymmetryKind::Bilateral), error(SymmetryKind::None));
    assert!(with < 0.7 * without, "{with} {without}");
}

/// Of `drawn` samples of a material that leans along x, with 0.5 % noise, the first `count` with azimuths of light and
/// view within a range, degrees.
fn leaning_within(azimuths: std::ops::Range<f32>, drawn: usize, count: usize) -> Vec<Sample> {
    samples(drawn, false, |l, v, normal| {
        let leaning = 1.0 + 0.3 * (l.to_vec3()[0] + v.to_vec3()[0]);
        material(l, v, 1.4, 0.0) * leaning * (1.0 + 0.005 * normal)
    })
    .into_iter()
    .filter(|s| azimuths.contains(&s.phi_i_deg) && azimuths.contains(&s.phi_v_deg))
    .take(count)
    .collect()
}

#[test]
fn a_plane_of_which_one_side_was_measured_is_not_taken() {
    // Tilted fibres: a plane along x, far from which nothing is alike; lights and views on one side of it, and in one
    // quarter of azimuths.
    for (low, high) in [(0.0, 180.0), (20.0, 110.0)] {
        let of_side = leaning_within(low..high, 9000, 700);
        let far_off = |fit: &ScatteredFit| {
            let plane = fit.choice().settings.symmetry.plane();
            let off = |p: crate::symmetry::MirrorPlane| (p.azimuth_deg() + 90.0) % 180.0 - 90.0;
            plane.is_some_and(|p| off(p).abs() > 3.0)
        };
        let auto = ScatteredFit::new(&of_side, None).unwrap();
        assert!(!far_off(&auto), "{low}: {}", auto.choice().settings);
        let asked = ScatteredFit::new(&of_side, Some(SymmetryKind::Bilateral)).unwrap();
        assert!(!far_off(&asked), "{low}: {}", asked.choice().settings);
        let symmetry = asked.choice().settings.symmetry;
        assert_eq!(
            asked.choice().plane_undetermined,
            symmetry.plane().is_none()
        );
    }
}

#[test]
fn half_a_turn_of_which_one_side_was_measured_is_not_taken() {
    // A wave along x, which half a turn turns over; lights and views on one side.
    for (low, high) in [(0.0, 90.0), (20.0, 110.0)] {
        let of_side = leaning_within(low..high, 12000, 400);
        let fit = ScatteredFit::new(&of_side, None).unwrap();
        let symmetry = fit.choice().settings.symmetry;
        assert!(!symmetry.has_half_turn(), "{low}: {symmetry}");
    }
}

#[test]
fn a_plane_that_is_stated_is_taken_and_what_the_data_say_against_it() {
    let leaning = |l: Direction, v: Direction, normal: f64| {
        let sum = l.to_vec3()[0] + v.to_vec3()[0];
        material(l, v, 1.4, 0.0) * (1.0 + 0.3 * sum) * (1.0 + 0.005 * normal)
    };
    let samples = samples(700, false, leaning);
    for (azimuth_deg, is_contradicted) in [(0.0, false), (35.0, true)] {
        let plane = MirrorPlane::at_deg(azimuth_deg);
        let fit = ScatteredFit::about_plane(&samples, SymmetryKind::Bilateral, plane).unwrap();
        let choice = fit.choice();
        assert_eq!(choice.settings.symmetry, Symmetry::Bilateral(plane));
        assert_eq!(
            choice.contradicted_by.is_some(),
            is_contradicted,
            "{azimuth_deg}"
        );
    }
}

#[test]
fn a_symmetry_that_is_contradicted_is_taken_and_said() {
    let anisotropic = of_material(800, false, 1.5, 0.0);
    let asked = ScatteredFit::new(&anisotropic, Some(SymmetryKind::Isotropic)).unwrap();
    assert!(asked.choice().settings.symmetry.is_isotropic());
    assert!(asked.choice().contradicted_by.is_some());
    let isotropic = of_material(800, false, 1.0, 0.0);
    let asked = ScatteredFit::new(&isotropic, Some(SymmetryKind::Isotropic)).unwrap();
    assert_eq!(asked.choice().contradicted_by, None);
}

#[test]
fn noise_as_large_as_a_small_signal_averages_out_and_stays_positive() {
    let noisy = samples(10_000, false, |_, _, normal| 0.001 * (1.0 + normal));
    let fit = ScatteredFit::new(&noisy, None).unwrap();
    let mut random = Random::new(5);
    let pairs: Vec<_> = (0..1000)
        .map(|_| (direction(&mut random, false), direction(&mut random, false)))
        .collect();
    let values = fit.at_all(&pairs);
    assert!(values.iter().all(|(value, _)| value[0] > 0.0));
    let mean = values.iter().map(|(value, _)| value[0]).sum::<f64>() / 1000.0;
    assert!((mean / 0.001 - 1.0).abs() < 0.02, "{mean}");
}

/// Whether a dense table is positive, finite, exactly reciprocal and one value a pole, how far it is from the fit
/// at the most, and how far at the 95th percentile.
fn checked(fit: &ScatteredFit, grid: Grid) -> (f64, f64) {
    let (dense, errors) = fit.dense(grid, true);
    let n = grid.n_directions();
    assert!(
        errors
            .unwrap()
            .iter()
            .flatten()
            .all(|e| e.is_finite() && *e > 0.0)
    );
    let mut off = Vec::new();
    for light in 0..n {
        for view in 0..n {
            let value = dense.at(light, view);
            assert!(value[0] > 0.0 && value[0].is_finite());
            assert_eq!(value, dense.at(view, light));
            if light < grid.n_phi() {
                assert_eq!(value, dense.at(0, view));
            }
            if (light + 7 * view) % 41 == 0 {
                let (at, _) = fit.at(grid.direction(light), grid.direction(view));
                off.push((f64::from(value[1]) / at[1]).natural_log().abs());
            }
        }
    }
    off.sort_by(f64::total_cmp);
    (off[off.len() - 1], off[off.len() * 95 / 100])
}

#[test]
fn a_dense_table_is_that_of_the_fit_reciprocal_and_one_value_a_pole() {
    let grid = Grid::with_step_deg(15.0).unwrap();
    let isotropic = ScatteredFit::new(&of_material(500, true, 1.0, 0.0), None).unwrap();
    // Cells that share a system differ a little from one of their own.
    let (worst, usual) = checked(&isotropic, grid);
    assert!(worst < 0.1 && usual < 0.05, "{worst} {usual}");
    // One system for all; many; with light and view exchanged and not; turned by half a turn.
    for (places, symmetry, reciprocal_data) in [
        (60, Symmetry::None, true),
        (1200, Symmetry::None, true),
        (1200, Symmetry::None, false),
        (1200, Symmetry::HalfTurn, true),
    ] {
        let settings = Settings {
            symmetry,
            reciprocal_data,
            coordinates: Coordinates::half_difference(0.3),
            ..Settings::DEFAULT
        };
        let samples = of_material(places, false, 1.5, 0.0);
        let fit = ScatteredFit::with_settings(&samples, settings).unwrap();
        let (worst, usual) = checked(&fit, grid);
        // Where few samples are, neighbourhoods differ, and what they say beyond their data.
        assert!(usual < 0.15, "{settings}: {worst} {usual}");
    }
}

#[test]
fn standard_errors_hold_the_truth_of_noisy_and_of_anisotropic_samples() {
    let anisotropic = ScatteredFit::new(&of_material(1000, false, 1.5, 0.0), None).unwrap();
    let (rms, within) = error(&anisotropic, 1.5, 0.0);
    assert!(rms < 0.15, "{rms}");
    assert!(within > 0.9, "{within}");
    let noise = samples(1000, false, |_, _, normal| 1.0 + 0.3 * normal);
    let fit = ScatteredFit::new(&noise, None).unwrap();
    let mut random = Random::new(6);
    let within = (0..300)
        .map(|_| fit.at(direction(&mut random, false), direction(&mut random, false)))
        .filter(|(value, error)| (value[1] - 1.0).abs() <= 1.96 * error[1])
        .count();
    assert!(within > 255, "{within} of 300");
}

#[test]
fn too_few_for_cross_validation_get_simple_defaults() {
    let few = ScatteredFit::new(&of_material(12, true, 1.0, 0.0), None).unwrap();
    assert_eq!(
        (few.choice().log_error, few.choice().reason),
        (None, Reason::Assumed)
    );
    assert!(
        few.at(
            Direction::from_deg(30.0, 200.0),
            Direction::from_deg(10.0, 0.0)
        )
        .0[0]
            > 0.0
    );
    assert!(ScatteredFit::new(&of_material(5, true, 1.0, 0.0), None).is_none());
    // At several azimuths: three angles are what so few bear, with errors that hold.
    let few = ScatteredFit::new(&of_material(16, false, 1.0, 0.0), None).unwrap();
    assert_eq!(few.choice().reason, Reason::TooFew);
    assert_eq!(few.choice().settings.symmetry, Symmetry::Isotropic);
    let (rms, within) = error(&few, 1.0, 0.0);
    assert!(rms < 0.4, "{rms}");
    assert!(within > 0.9, "{within}");
}

#[test]
fn a_hundred_anisotropic_samples_are_not_made_isotropic_and_their_errors_hold() {
    let fit = ScatteredFit::new(&of_material(100, false, 1.5, 0.0), None).unwrap();
    let symmetry = fit.choice().settings.symmetry;
    assert!(!symmetry.is_isotropic(), "{symmetry}");
    let (rms, within) = error(&fit, 1.5, 0.0);
    assert!(rms < 0.25, "{rms}");
    assert!(within > 0.9, "{within}");
    // Of as many isotropic ones, what is taken for noise may be a dependence on the azimuth.
    let fit = ScatteredFit::new(&of_material(100, false, 1.0, 0.0), None).unwrap();
    assert!(fit.choice().settings.symmetry.is_isotropic());
    assert_eq!(fit.choice().settings.hidden, 1.0);
    let (_, within) = error(&fit, 1.0, 0.0);
    assert!(within > 0.9, "{within}");
}

#[test]
fn images_of_one_sample_count_as_one() {
    // Of noise about zero every datum weighs the same: threes whose light and view differ have four images, and minus
    // ones, in which half a turn exchanges light and view, have two.
    let at = |theta_i: f64, theta_v: f64, phi_v: f64, value: f32| {
        let light = Direction::from_deg(theta_i, 0.0);
        Sample::new(light, Direction::from_deg(theta_v, phi_v), [value; 3])
    };
    let samples: Vec<Sample> = (0..8)
        .map(|k| {
            let theta = 20.0 + f64::from(k);
            match k % 2 {
                0 => at(theta, theta + 15.0, 70.0, 3.0),
                _ => at(theta, theta, 180.0, -1.0),
            }
        })
        .collect();
    let settings = Settings {
        symmetry: Symmetry::HalfTurn,
        nugget: 1e3,
        ..Settings::DEFAULT
    };
    let fit = ScatteredFit::with_settings(&samples, settings).unwrap();
    let (value, _) = fit.at(
        Direction::from_deg(25.0, 0.0),
        Direction::from_deg(30.0, 90.0),
    );
    assert!((value[0] - 1.0).abs() < 0.1, "{value:?}");
}

#[test]
fn images_of_a_camera_are_not_few_samples() {
    let framed = |per_frame: u32| -> Vec<Sample> {
        let samples = of_material(300, false, 1.0, 0.0).into_iter();
        let numbered = samples.enumerate();
        numbered
            .map(|(k, s)| s.in_frame(k as u32 / per_frame))
            .collect()
    };
    assert!(is_few(&of_material(300, false, 1.0, 0.0)) && is_few(&framed(1)));
    assert!(!is_few(&framed(50)));
}

#[test]
fn cells_beyond_a_plane_of_symmetry_are_as_near_to_the_fit_as_those_whose_systems_they_have() {
    let grid = Grid::with_step_deg(5.0).unwrap();
    let plane = MirrorPlane::at_deg(22.8);
    for symmetry in [
        Symmetry::Bilateral(plane),
        Symmetry::HalfTurnBilateral(plane),
    ] {
        let settings = Settings {
            symmetry,
            ..Settings::DEFAULT
        };
        let samples = of_material(3000, false, 1.5, 0.0);
        let fit = ScatteredFit::with_settings(&samples, settings).unwrap();
        let (dense, _) = fit.dense(grid, false);
        let off = |cells: &quadratic::Cells| {
            let [lights, views] = [0, 2].map(|axis| cells.directions(axis, grid, 0));
            let all = lights
                .iter()
                .flat_map(|l| views.iter().map(move |v| (*l, *v)));
            let off = all.step_by(17).map(|(l, v)| {
                let (at, _) = fit.at(grid.direction(l), grid.direction(v));
                (f64::from(dense.at(l, v)[1]) / at[1]).natural_log().powi(2)
            });
            off.collect::<Vec<f64>>()
        };
        let (mut own, mut beyond) = (Vec::new(), Vec::new());
        for pair in patches::pairs(grid, symmetry, true) {
            if let Some(cells) = pair.beyond {
                own.extend(off(&pair.cells));
                beyond.extend(off(&cells.cells));
            }
        }
        let rms = [own, beyond].map(|off| (off.iter().sum::<f64>() / off.len() as f64).sqrt());
        assert!(rms[1] < 1.1 * rms[0], "{symmetry}: {rms:?}");
    }
}

/// The samples with other channels: each so many times the red one.
fn of_times<const N: usize>(samples: &[Sample], times: [f32; N]) -> Vec<Sample<N>> {
    let with = |s: &Sample| s.with_values(times.map(|times| times * s.rgb[0]));
    samples.iter().map(with).collect()
}

fn settings_of(symmetry: Symmetry) -> Settings {
    Settings {
        symmetry,
        ..Settings::DEFAULT
    }
}

#[test]
fn bands_of_one_factorisation_are_each_what_it_is_among_colours() {
    let samples = of_material(300, false, 1.5, 0.0);
    let fit = ScatteredFit::with_settings(&samples, settings_of(Symmetry::None)).unwrap();
    let times = [1.0, 0.5, 2.0, 3.0, 0.7];
    let bands = fit.of_channels(&of_times(&samples, times));
    let colours = fit.of_channels(&of_times(&samples, [3.0, 0.7, 1.0]));
    // One that is noise about zero leaves the others what they are.
    let mut random = Random::new(6);
    let mut dark = of_times(&samples, times);
    for sample in &mut dark {
        sample.rgb[1] = 1e-4 * random.normal() as f32;
    }
    let with_dark = fit.of_channels(&dark);
    for _ in 0..20 {
        let (light, view) = (direction(&mut random, false), direction(&mut random, false));
        let (found, known) = (bands.at(light, view), colours.at(light, view));
        for (band, colour) in [(3, 0), (4, 1), (0, 2)] {
            assert!((found.0[band] / known.0[colour] - 1.0).abs() < 1e-12);
            assert!((found.1[band] / known.1[colour] - 1.0).abs() < 1e-9);
        }
        let (beside_dark, _) = with_dark.at(light, view);
        for band in [0, 2, 3, 4] {
            assert!((beside_dark[band] / found.0[band] - 1.0).abs() < 1e-12);
        }
        assert!(beside_dark[1] > 0.0 && beside_dark[1] < 1e-3);
    }
}

#[test]
fn cells_ring_by_ring_are_those_of_all_at_once() {
    let grid = Grid::with_step_deg(5.0).unwrap();
    let samples = of_material(400, false, 1.5, 0.0);
    let samples = of_times(&samples, [1.0, 0.5, 2.0]);
    let plane = MirrorPlane::at_deg(22.8);
    for symmetry in [
        Symmetry::None,
        Symmetry::HalfTurnBilateral(plane),
        Symmetry::Isotropic,
    ] {
        let fit = ScatteredFit::with_settings(&samples, settings_of(symmetry)).unwrap();
        let (dense, _) = fit.dense(grid, false);
        for at_a_time in [1, 5, 100] {
            let mut planes = vec![Vec::new(); 3];
            let taken = fit.by_rings(grid, at_a_time, |rings, some| {
                assert!(rings.len() <= at_a_time);
                for (plane, some) in planes.iter_mut().zip(some) {
                    plane.extend_from_slice(some);
                }
                Ok::<(), ()>(())
            });
            assert_eq!(taken, Ok(()));
            assert!(planes == dense.planes(), "{symmetry} {at_a_time}");
        }
    }
}
