//! A rig whose encoders sit 0.05° off their axes and were calibrated at the bench.

use gonia::capture::Arms;
use gonia::link::{Controller, calibrate_axis};
use gonia_protocol::settings::{Axis, Key};
use gonia_protocol::{NODE_CAMERA, NODE_LIGHT};
use gonia_sim::bench::Bench;
use gonia_sim::fault::{Arm, FaultPlan};
use gonia_sim::plant::PlantConfig;
use gonia_sim::rig::SimRig;

/// Calibration is over by then, µs of virtual time: faults may begin.
pub const BEGIN_US: u64 = 800_000_000;
/// What an electronic autocollimator repeats to: a second of arc, degrees.
const AUTOCOLLIMATOR_DEG: f64 = 0.0003;

/// The rig, and its arms at [`BEGIN_US`].
pub fn rig(seed: u64, faults: FaultPlan) -> (SimRig, Arms) {
    let arms = [eccentric_arm(2 * seed), eccentric_arm(2 * seed + 1)];
    let rig = SimRig::with_arms(seed, faults, arms);
    calibrate(&rig, Arm::Light, NODE_LIGHT);
    calibrate(&rig, Arm::Camera, NODE_CAMERA);
    assert!(rig.now_us() < BEGIN_US, "{}", rig.now_us());
    let port = |arm| Box::new(rig.port(arm));
    let mut arms = Arms::connect(port(Arm::Light), port(Arm::Camera)).unwrap();
    assert_eq!(arms.uncalibrated().unwrap(), []);
    let wait_us = BEGIN_US - rig.now_us();
    arms.light().rest(wait_us).unwrap();
    (rig, arms)
}

/// An arm whose two rings sit off their axes, each its own way.
fn eccentric_arm(seed: u64) -> Bench {
    let axis = |axis: Axis, start_udeg, turns: f64| {
        let home_udeg = f64::from(Key::HomeAngle.default_of(axis));
        PlantConfig {
            eccentricity_udeg: 50_000.0,
            eccentricity_phase_udeg: (seed as f64 * turns).fract() * 360e6,
            ..PlantConfig::worm_axis(home_udeg, start_udeg)
        }
    };
    let theta = axis(Axis::Theta, 21.3e6, 0.618);
    Bench::new([theta, axis(Axis::Phi, -12.8e6, 0.414)], seed)
}

fn calibrate(rig: &SimRig, arm: Arm, node: u8) {
    let mut controller = Controller::connect(Box::new(rig.port(arm)), node).unwrap();
    let theta: Vec<i32> = (0..10).map(|i| i * 9_700_000).collect();
    let phi: Vec<i32> = (0..24).map(|i| -180_000_000 + i * 15_000_000).collect();
    for (axis, stands) in [(Axis::Theta, theta), (Axis::Phi, phi)] {
        let mut n = 0.0;
        let mut autocollimator = |_: &mut Controller, _| {
            n += 1.0;
            let scatter = AUTOCOLLIMATOR_DEG * f64::sin(n * 2.4);
            Ok(rig.true_deg(arm)[axis.index()] + scatter)
        };
        let found = calibrate_axis(&mut controller, axis, &stands, true, &mut autocollimator);
        let found = found.unwrap();
        assert!(found.encoder.rms_after_deg < 0.003, "{found:?}");
        // The plant's own gear: 0.003° of amplitude.
        let gear = found.gear.unwrap();
        assert!(
            gear.rms_before_deg > 0.0015 && gear.rms_after_deg < 0.0015,
            "{gear:?}"
        );
        assert_eq!(found.steps_disagree_udeg, 10_000);
    }
    controller.save_settings().unwrap();
    controller.rest(1_000).unwrap();
}
