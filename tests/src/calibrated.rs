//! A rig whose encoders sit 0.05° off their axes and were calibrated at the bench.

use gonia_brdf::Elementary;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock};

use gonia_acquire::capture::Arms;
use gonia_acquire::link::{RemoteController, calibrate_axis};
use gonia_protocol::settings::{Axis, Key, MEANINGS};
use gonia_protocol::{NODE_CAMERA, NODE_LIGHT};
use gonia_sim::arm::SimulatedArm;
use gonia_sim::fault::{Arm, FaultPlan};
use gonia_sim::plant::PlantConfig;
use gonia_sim::rig::SimRig;

/// The calibrated settings are in by then, µs of virtual time: faults may begin.
pub const BEGIN_US: u64 = 20_000_000;
/// What an electronic autocollimator repeats to: a second of arc, degrees.
const AUTOCOLLIMATOR_DEG: f64 = 0.0003;

const ARMS: [(Arm, u8); 2] = [(Arm::Light, NODE_LIGHT), (Arm::Camera, NODE_CAMERA)];

/// What calibrating the two arms of a seed has changed.
type Changed = Vec<(Arm, Axis, Key, i32)>;

/// The rig, and its arms at [`BEGIN_US`].
pub fn rig(seed: u64, faults: FaultPlan) -> (SimRig, Arms) {
    let changed = calibration_of(seed);
    let rig = SimRig::with_arms(seed, faults, arms(seed));
    for (arm, node) in ARMS {
        let mut controller = RemoteController::connect(Box::new(rig.port(arm)), node).unwrap();
        for (_, axis, key, value) in changed.iter().filter(|change| change.0 == arm) {
            controller.set_setting(*axis, *key, *value).unwrap();
        }
        controller.save_settings().unwrap();
        controller.rest(1_000).unwrap();
    }
    assert!(rig.now_us() < BEGIN_US, "{}", rig.now_us());
    let port = |arm| Box::new(rig.port(arm));
    let mut arms = Arms::connect(port(Arm::Light), port(Arm::Camera)).unwrap();
    assert_eq!(arms.uncalibrated().unwrap(), []);
    let wait_us = BEGIN_US - rig.now_us();
    arms.light().rest(wait_us).unwrap();
    (rig, arms)
}

fn arms(seed: u64) -> [SimulatedArm; 2] {
    [eccentric_arm(2 * seed), eccentric_arm(2 * seed + 1)]
}

/// Arms are calibrated once, however many sessions they run.
fn calibration_of(seed: u64) -> Changed {
    static KNOWN: Mutex<BTreeMap<u64, Arc<OnceLock<Changed>>>> = Mutex::new(BTreeMap::new());
    let of_the_seed = Arc::clone(KNOWN.lock().unwrap().entry(seed).or_default());
    of_the_seed.get_or_init(|| calibrate_both(seed)).clone()
}

fn calibrate_both(seed: u64) -> Changed {
    let rig = SimRig::with_arms(seed, FaultPlan::default(), arms(seed));
    let mut changed = Vec::new();
    for (arm, node) in ARMS {
        let mut controller = RemoteController::connect(Box::new(rig.port(arm)), node).unwrap();
        calibrate(&rig, arm, &mut controller);
        for meaning in &MEANINGS {
            for axis in Axis::BOTH {
                let value = controller.setting(axis, meaning.key).unwrap();
                if value != meaning.key.default_of(axis) {
                    changed.push((arm, axis, meaning.key, value));
                }
            }
        }
    }
    changed
}

/// An arm whose two rings sit off their axes, each its own way.
fn eccentric_arm(seed: u64) -> SimulatedArm {
    let axis = |axis: Axis, start_udeg, turns: f64| {
        let home_udeg = f64::from(Key::HomeAngle.default_of(axis));
        PlantConfig {
            eccentricity_udeg: 50_000.0,
            eccentricity_phase_udeg: (seed as f64 * turns).fract() * 360e6,
            ..PlantConfig::worm_axis(home_udeg, start_udeg)
        }
    };
    let theta = axis(Axis::Theta, 21.3e6, 0.618);
    SimulatedArm::new([theta, axis(Axis::Phi, -12.8e6, 0.414)], seed)
}

fn calibrate(rig: &SimRig, arm: Arm, controller: &mut RemoteController) {
    let theta: Vec<i32> = (0..10).map(|i| i * 9_700_000).collect();
    let phi: Vec<i32> = (0..24).map(|i| -180_000_000 + i * 15_000_000).collect();
    for (axis, stands) in [(Axis::Theta, theta), (Axis::Phi, phi)] {
        let mut n = 0.0;
        let mut autocollimator = |_: &mut RemoteController, _| {
            n += 1.0;
            let scatter = AUTOCOLLIMATOR_DEG * f64::sine(n * 2.4);
            Ok(rig.true_deg(arm)[axis.index()] + scatter)
        };
        let found = calibrate_axis(controller, axis, &stands, true, &mut autocollimator);
        let found = found.unwrap();
        assert!(found.encoder.rms_after_deg < 0.003, "{found:?}");
        // The plant's own gear: 0.003° of amplitude.
        let gear = found.gear.unwrap();
        assert!(
            gear.rms_before_deg > 0.0015 && gear.rms_after_deg < 0.0015,
            "{gear:?}"
        );
        assert_eq!(found.step_loss_limit_udeg, 10_000);
    }
}
