//! Rectified frames against the simulator's truth.
#![allow(clippy::unwrap_used)]

use gonia_brdf::Pose;
use gonia_imaging::rectify::{View, rectify};
use gonia_imaging::{IdealLight, Registrar};
use gonia_rig::Role;
use gonia_sim::scene::{Scene, true_brdf};

#[test]
fn a_rectified_frame_shows_each_point_of_the_target_at_its_place() {
    let mut scene = Scene::of_fabric(512);
    (scene.noise, scene.beam, scene.occluder) = (None, None, None);
    let rig = scene.geometry.to_rig();
    let truth = Pose::from_deg([30.0, 140.0, 45.0, 200.0]);
    let frame = scene.frame(Role::Material, truth, 0);
    let registration = Registrar::new(&rig).register(&frame, truth);
    let view = View::of_target(&rig, 0.5);
    assert_eq!(view.side_px, 350);
    let seen = rectify(&frame, &registration, &view);
    let light = IdealLight::new(&rig, truth.light);
    for (row, column) in [(60, 60), (175, 175), (60, 290), (250, 130)] {
        let at = view.point_mm(column, row);
        let f = true_brdf(scene.material.as_ref(), &scene.geometry, truth, at);
        let measured = f64::from(seen.rgb[row * 350 + column][1]) / light.irradiance(at);
        assert!(
            (measured / f[1] - 1.0).abs() < 0.01,
            "{at:?}: {measured} {}",
            f[1]
        );
    }
    // The lines x = ±335 are at columns 7.5 and 341.5.
    let line = &seen.rgb[175 * 350..176 * 350];
    let brightest = |range: std::ops::Range<usize>| {
        range
            .max_by(|a, b| line[*a][1].total_cmp(&line[*b][1]))
            .unwrap()
    };
    assert!((7..=8).contains(&brightest(2..12)), "{}", brightest(2..12));
    assert!((341..=342).contains(&brightest(338..348)));
}
