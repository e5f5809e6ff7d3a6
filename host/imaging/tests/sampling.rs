//! Sampling and occlusion against the simulator's truth.
#![allow(clippy::unwrap_used, clippy::panic)]

use gonia_brdf::Elementary;
use gonia_brdf::Pose;
use gonia_brdf::direction::{angle_between, local_direction};
use gonia_imaging::*;
use gonia_rig::{CameraModel, CameraShift, Role};
use gonia_sim::scene::{Scene, true_brdf};

#[test]
fn directions_of_samples_are_true_to_two_hundredths_of_a_degree() {
    for px in [400, 1024] {
        let scene = Scene::of_fabric(px);
        let rig = scene.geometry.to_rig();
        let grid = SamplingGrid::new(&rig);
        for angles in [
            [30.0, 140.0, 0.0, 0.0],
            [0.0, 0.0, 45.0, 200.0],
            [60.0, 20.0, 60.0, 90.0],
            [15.0, 10.0, 75.0, 45.0],
        ] {
            let truth = Pose::from_deg(angles);
            let mut reading = truth;
            reading.view.theta += 0.01f64.to_radians();
            let frame = scene.frame(Role::Material, truth, 5);
            let found = Registrar::new(&rig).register(&frame, reading);
            let true_map = CameraModel::new(&rig)
                .predict(truth.view, CameraShift::default())
                .inverse()
                .unwrap();
            for at in grid.points_mm() {
                // What is believed to be at `at` is, in truth, here:
                let there = true_map.apply(found.project(*at));
                let metres = |p: [f64; 2]| p.map(|c| c * 1e-3);
                let light = angle_between(
                    local_direction(truth.light, 1.1, metres(*at)),
                    local_direction(truth.light, 1.1, metres(there)),
                );
                let view = angle_between(
                    local_direction(found.view, 1.8, metres(*at)),
                    local_direction(truth.view, 1.8, metres(there)),
                );
                let error_deg = light.max(view).to_degrees();
                assert!(error_deg < 0.02, "{px} {angles:?} {at:?}: {error_deg}");
            }
        }
    }
}

#[test]
fn values_belong_to_the_place_they_name_even_where_patches_hold_few_pixels() {
    // Without noise the value over the ideal light is the BRDF at the pixels' centre: also at
    // 200 px and θv = 75°, where a patch is 2.4 × 0.6 pixels and is interpolated.
    for (px, limit, fewest) in [(1024, 2e-3, 20), (400, 5e-3, 4), (200, 1e-2, 0)] {
        let mut scene = Scene::of_fabric(px);
        scene.noise = None;
        scene.beam = None;
        let rig = scene.geometry.to_rig();
        let grid = SamplingGrid::new(&rig);
        for angles in [[30.0, 140.0, 15.0, 40.0], [45.0, 200.0, 75.0, 120.0]] {
            let truth = Pose::from_deg(angles);
            let frame = scene.frame(Role::Material, truth, 0);
            let found = Registrar::new(&rig).register(&frame, truth);
            let light = IdealLight::new(&rig, truth.light);
            for (at, value) in grid
                .points_mm()
                .iter()
                .zip(grid.sample(&frame, &found, None))
            {
                let value = value.unwrap();
                // The few patches that hold fewer pixels are interpolated.
                assert!(value.pixels == 0 || value.pixels >= fewest);
                let place = [0, 1].map(|i| at[i] + f64::from(value.offset_mm[i]));
                let f = true_brdf(scene.material.as_ref(), &scene.geometry, truth, place);
                let measured = f64::from(value.rgb[0]) / light.irradiance(place);
                let error = (measured / f[0]).natural_log().abs();
                assert!(error < limit, "{px} {angles:?} {at:?}: {error}");
            }
        }
    }
}

#[test]
fn occluded_patches_are_left_out_and_no_others() {
    let scene = Scene::of_fabric(400);
    let mut open = scene.clone();
    open.occluder = None;
    let rig = scene.geometry.to_rig();
    let grid = SamplingGrid::new(&rig);
    let registrar = Registrar::new(&rig);
    for angles in [
        [30.0, 60.0, 30.0, 60.0],
        [15.0, 0.0, 15.0, 0.0],
        [60.0, 90.0, 60.0, 96.0],
        [15.0, 60.0, 75.0, 60.0],
        [75.0, 15.0, 75.0, 15.0],
        [30.0, 90.0, 36.0, 84.0],
    ] {
        let truth = Pose::from_deg(angles);
        let reference = scene.frame(Role::Reference, truth, 1);
        let found = registrar.register(&reference, truth);
        let mask = find_occlusion(&reference, &found, truth.light, &rig);
        let hidden = grid.sample(
            &scene.frame(Role::Material, truth, 2),
            &found,
            mask.as_ref(),
        );
        let whole = grid.sample(&open.frame(Role::Material, truth, 2), &found, None);
        let (mut kept, mut wrongly_kept, mut wrongly_left) = (0, 0, 0);
        let unmasked = grid.sample(&scene.frame(Role::Material, truth, 2), &found, None);
        for ((masked, unmasked), whole) in hidden.iter().zip(&unmasked).zip(&whole) {
            let (unmasked, whole) = (unmasked.unwrap(), whole.unwrap());
            // Same shot, same noise: what the occluder does not touch is the same.
            let touched = (unmasked.rgb[1] / whole.rgb[1] - 1.0).abs() > 5e-3;
            match masked {
                Ok(_) if touched => wrongly_kept += 1,
                Ok(_) => kept += 1,
                Err(reason) => {
                    assert_eq!(*reason, LeftOut::Occlusion);
                    wrongly_left += usize::from(!touched);
                }
            }
        }
        assert_eq!(wrongly_kept, 0, "{angles:?}");
        assert!(kept < 1225, "{angles:?}: nothing was hidden");
        // The margin costs a rim of patches about the shape.
        assert!(wrongly_left < 250, "{angles:?}: {wrongly_left}");
    }
}

#[test]
fn frames_that_nothing_hides_have_no_mask() {
    let scene = Scene::of_fabric(400);
    let rig = scene.geometry.to_rig();
    let registrar = Registrar::new(&rig);
    for angles in [
        [0.0, 0.0, 45.0, 90.0],
        [85.0, 0.0, 75.0, 180.0],
        [85.0, 90.0, 75.0, 270.0],
        [85.0, 30.0, 0.0, 0.0],
        [75.0, 210.0, 75.0, 30.0],
        [60.0, 100.0, 30.0, 280.0],
    ] {
        let truth = Pose::from_deg(angles);
        for which in [Role::Reference, Role::Material] {
            let frame = scene.frame(which, truth, 1);
            let found = registrar.register(&frame, truth);
            let mask = find_occlusion(&frame, &found, truth.light, &rig);
            assert_eq!(mask, None, "{angles:?} {which:?}");
        }
    }
}

#[test]
fn patches_with_a_pixel_that_is_no_number_are_left_out() {
    let scene = Scene::of_fabric(400);
    let rig = scene.geometry.to_rig();
    let truth = Pose::from_deg([30.0, 140.0, 30.0, 10.0]);
    let mut frame = scene.frame(Role::Material, truth, 1);
    frame.rgb[200 * 400 + 200][2] = f32::NAN;
    let found = Registrar::new(&rig).register(&frame, truth);
    let points = SamplingGrid::new(&rig).sample(&frame, &found, None);
    let bad: Vec<_> = points.iter().filter_map(|p| p.err()).collect();
    assert_eq!(bad, [LeftOut::NotFinite]);
}

#[test]
fn patches_beyond_material_or_frame_are_left_out() {
    let scene = Scene::of_fabric(400);
    let mut rig = scene.geometry.to_rig();
    rig.target.material_half_mm = 250.0;
    let truth = Pose::from_deg([30.0, 140.0, 0.0, 0.0]);
    let mut frame = scene.frame(Role::Material, truth, 1);
    let found = Registrar::new(&rig).register(&frame, truth);
    let grid = SamplingGrid::new(&rig);
    let count = |frame: &gonia_rig::Frame, reason| {
        let points = grid.sample(frame, &found, None);
        points.iter().filter(|p| **p == Err(reason)).count()
    };
    let beyond = |limit: f64| {
        let far = |p: &&[f64; 2]| p[0].abs().max(p[1].abs()) + 7.0 > limit;
        grid.points_mm().iter().filter(far).count()
    };
    assert_eq!(count(&frame, LeftOut::Mark), beyond(250.0));
    assert_eq!(count(&frame, LeftOut::Border), 0);
    // The same image cut off below row 250.
    frame.rgb.truncate(250 * 400);
    frame.height = 250;
    assert!(count(&frame, LeftOut::Border) > 100);
}

#[test]
fn values_are_unbiased_and_scatter_as_little_as_a_median_can() {
    // The standard error of a median of n normal values is 1.2533 σ/√n.
    let px = 1024;
    let mut scene = Scene::of_fabric(px);
    (scene.beam, scene.occluder) = (None, None);
    let noise = scene.noise.unwrap();
    let rig = scene.geometry.to_rig();
    let grid = SamplingGrid::new(&rig);
    let (mut squares, mut count) = (0.0, 0.0);
    for angles in [
        [30.0, 140.0, 0.0, 0.0],
        [0.0, 0.0, 45.0, 200.0],
        [60.0, 20.0, 60.0, 90.0],
        [15.0, 10.0, 75.0, 45.0],
        [85.0, 100.0, 30.0, 280.0],
    ] {
        let truth = Pose::from_deg(angles);
        let mut reading = truth;
        reading.view.theta += 0.01f64.to_radians();
        let frame = scene.frame(Role::Reference, truth, 5);
        let found = Registrar::new(&rig).register(&frame, reading);
        let light = IdealLight::new(&rig, truth.light);
        let at_centre = true_brdf(scene.reference.as_ref(), &scene.geometry, truth, [0.0; 2]);
        let mean = at_centre.iter().sum::<f64>() / 3.0;
        let typical = mean.min(std::f64::consts::FRAC_1_PI) * truth.light.theta.cosine();
        let mut bias = 0.0;
        for (at, value) in grid
            .points_mm()
            .iter()
            .zip(grid.sample(&frame, &found, None))
        {
            let value = value.unwrap();
            let place = [0, 1].map(|i| at[i] + f64::from(value.offset_mm[i]));
            let f = true_brdf(scene.reference.as_ref(), &scene.geometry, truth, place);
            let radiance = f[1] * light.irradiance(place);
            let off = (f64::from(value.rgb[1]) / radiance).natural_log();
            let shot = noise.shot * noise.shot * typical * radiance;
            let sd = (shot + (noise.read * typical).powi(2)).sqrt() / radiance;
            let limit = 1.2533 * sd / f64::from(value.pixels).sqrt();
            squares += (off / limit).powi(2);
            count += 1.0;
            bias += off / 1225.0;
        }
        assert!(bias.abs() < 0.002, "{angles:?}: {bias}");
    }
    let ratio = f64::sqrt(squares / count);
    assert!(ratio < 1.1, "{ratio} times the limit");
    // Nor can it be much better: then the limit would be a wrong one.
    assert!(ratio > 0.9, "{ratio} times the limit");
}
