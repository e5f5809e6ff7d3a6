//! What a session is measured with: two arms and a camera, as `rig.toml` and the command line name them.

use crate::camera::{Camera, CameraError, CameraSetup, open_camera};
use crate::capture::arms::{Arms, BadExposures, ShotOptions, pose_apart_deg};
use crate::capture::orders::Orders;
use crate::capture::port::SessionPort;
use crate::capture::usb_port::{UsbPort, remedy_for};
use crate::link::{LinkError, StreamTransport, Transport};
use gonia_brdf::Pose;
use gonia_protocol::settings::{Axis, Key};
use gonia_rig::{DEFAULT_BAUD, Rig, SessionSettings, Source};
use gonia_sim::arm::SimulatedArm;
use gonia_sim::fault::{Arm, FaultPlan};
use gonia_sim::rig::SimRig;
use std::io;
use std::path::Path;

// What a rig has where it does not say otherwise is what the boards speak.
const _: () = assert!(DEFAULT_BAUD == gonia_protocol::BAUD);

/// Of a simulated rig that `rig.toml` does not describe.
const SIMULATED: Source = Source::Simulated {
    seed: 1,
    exact: false,
};

/// The controllers' ports, where they are not those of `rig.toml`.
#[derive(Clone, Copy, Debug, Default)]
pub struct ArmPortNames<'a> {
    /// The light arm's.
    pub light: Option<&'a str>,
    /// The camera arm's.
    pub camera: Option<&'a str>,
    /// Simulated arms and camera instead, whatever `rig.toml` says.
    pub simulated: bool,
}

/// Arms that answer, and a camera.
pub struct Equipment {
    /// Both arms.
    pub arms: Arms,
    /// The camera.
    pub camera: Box<dyn Camera>,
    /// Seed of a simulated rig.
    pub seed: Option<u64>,
    /// Whether every take of a pose is the same: readings are the commanded pose.
    pub exact: bool,
}

/// Why arms or camera cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum EquipmentError {
    /// The rig does not say where its frames come from.
    #[error(
        "{path}: has no [source]: say there where the frames come from (docs/src/reference/files/rig.md), or try --simulated"
    )]
    NoSource {
        /// `rig.toml`.
        path: String,
    },
    /// Neither rig nor command line names the port.
    #[error(
        "no port of the {arm} arm's controller: give [arms] {arm} in rig.toml, or --{option} PORT"
    )]
    NoPort {
        /// Which arm: light or camera.
        arm: &'static str,
        /// The command line's option.
        option: &'static str,
    },
    /// The port cannot be opened.
    #[error("the {arm} arm's port {port} cannot be opened; {remedy}: {source}")]
    Port {
        /// Which arm: light or camera.
        arm: &'static str,
        /// Its port.
        port: String,
        /// What to do.
        remedy: String,
        /// What the system says.
        source: io::Error,
    },
    /// A controller does not answer as it should.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// The session's exposure times.
    #[error(transparent)]
    Exposures(#[from] BadExposures),
    /// A pose of the plan that a controller would refuse.
    #[error(
        "plan, pose {index}: theta {theta_deg} degrees is beyond the {arm}'s limits ({least_deg} to {most_deg}); take it out of the plan, or widen the limits with gonia device"
    )]
    OutOfReach {
        /// Its place in the plan.
        index: usize,
        /// The polar angle that it asks of the arm.
        theta_deg: f64,
        /// The arm's name.
        arm: String,
        /// The lower limit.
        least_deg: f64,
        /// The upper limit.
        most_deg: f64,
    },
    /// A pose to whose azimuth an arm cannot turn.
    #[error(
        "plan, pose {index}: no turn of phi {phi_deg} degrees is within the {arm}'s limits; take it out of the plan, or widen the limits with gonia device"
    )]
    NoTurn {
        /// Its place in the plan.
        index: usize,
        /// The azimuth that it asks of the arm.
        phi_deg: f64,
        /// The arm's name.
        arm: String,
    },
    /// A pose at which the arms would touch.
    #[error(
        "plan, pose {index}: the arms would be {apart_deg:.1} degrees apart, and touch below {keep_out_deg:.1} (arms.keep_out_deg); make the plan with gonia plan RIG.toml, which leaves such poses out"
    )]
    TooNear {
        /// Its place in the plan.
        index: usize,
        /// The angle between light and view.
        apart_deg: f64,
        /// The least one.
        keep_out_deg: f64,
    },
}

impl Equipment {
    /// Opens arms and camera. `path` is that of `rig.toml`; `planned` is the number of poses.
    ///
    /// # Errors
    /// As [`EquipmentError`] says.
    pub fn open(
        rig: &Rig,
        path: &Path,
        ports: ArmPortNames,
        planned: usize,
        settings: &SessionSettings,
        orders: &Orders,
    ) -> Result<Self, EquipmentError> {
        let source = match &rig.source {
            Some(source @ Source::Simulated { .. }) => source,
            _ if ports.simulated => &SIMULATED,
            Some(source) => source,
            None => {
                let path = path.display().to_string();
                return Err(EquipmentError::NoSource { path });
            }
        };
        let mut setup = CameraSetup {
            rig,
            folder: path.parent().unwrap_or(Path::new("")),
            exposures_s: &settings.exposures_s,
            planned,
            simulated: None,
        };
        let mut equipment = if let Source::Simulated { seed, exact } = source {
            let sim = simulated_arms(*seed, *exact);
            let arms = connect_simulated(&sim, orders)?;
            setup.simulated = Some(&sim);
            Self {
                arms,
                camera: open_camera(source, setup)?,
                seed: Some(*seed),
                exact: *exact,
            }
        } else {
            // First, as it needs no arms that answer.
            let camera = open_camera(source, setup)?;
            Self {
                arms: connect_serial(rig, ports, orders)?,
                camera,
                seed: None,
                exact: false,
            }
        };
        equipment.arms.set_options(ShotOptions {
            exposures_us: settings
                .exposures_s
                .iter()
                .map(|s| (s * 1e6).round() as u32)
                .collect(),
            ..ShotOptions::default()
        })?;
        if let Some(arms) = &rig.arms {
            equipment.arms.set_keep_out_deg(arms.keep_out_deg);
        }
        Ok(equipment)
    }

    /// Refuses, before anything moves, poses that the session would fail at.
    ///
    /// # Errors
    /// A pose beyond the limits of θ, without a turn of φ within its limits, or at which the arms would
    /// touch; or a controller that does not answer.
    pub fn check_reach(&mut self, plan: &[Pose]) -> Result<(), EquipmentError> {
        for (index, pose) in plan.iter().enumerate() {
            let apart_deg = pose_apart_deg(pose);
            let keep_out_deg = self.arms.keep_out_deg;
            if apart_deg < keep_out_deg {
                return Err(EquipmentError::TooNear {
                    index,
                    apart_deg,
                    keep_out_deg,
                });
            }
            if let Some((arm, phi_deg)) = self.arms.without_turn(pose) {
                return Err(EquipmentError::NoTurn {
                    index,
                    phi_deg,
                    arm,
                });
            }
        }
        for is_light in [true, false] {
            let controller = if is_light {
                self.arms.light()
            } else {
                self.arms.camera()
            };
            let [least, most] = [Key::SoftMin, Key::SoftMax].map(|key| {
                let value = controller.setting(Axis::Theta, key);
                value.map(|udeg| f64::from(udeg) * 1e-6)
            });
            let (least_deg, most_deg) = (least?, most?);
            for (index, pose) in plan.iter().enumerate() {
                let direction = if is_light { pose.light } else { pose.view };
                // The arms are sent to the nearest millionth of a degree.
                let theta_deg = (direction.theta_deg() * 1e6).round() * 1e-6;
                if !(least_deg..=most_deg).contains(&theta_deg) {
                    return Err(EquipmentError::OutOfReach {
                        index,
                        theta_deg,
                        arm: controller.name().to_owned(),
                        least_deg,
                        most_deg,
                    });
                }
            }
        }
        Ok(())
    }
}

/// The simulated rig's arms. Exact ones are near their home and free of noise.
pub fn simulated_arms(seed: u64, exact: bool) -> SimRig {
    if exact {
        let arms = [(); 2].map(|()| SimulatedArm::quiet_arm_near_home());
        SimRig::with_arms(seed, FaultPlan::default(), arms)
    } else {
        SimRig::new(seed, FaultPlan::default())
    }
}

fn connect_simulated(sim: &SimRig, orders: &Orders) -> Result<Arms, EquipmentError> {
    let port = |arm, name: &'static str| {
        let sim = sim.clone();
        let open = move || Ok(Box::new(sim.port(arm)) as Box<dyn Transport>);
        SessionPort::open(Box::new(open), orders).map_err(|source| EquipmentError::Port {
            arm: name,
            port: "simulated".into(),
            remedy: "please report this".into(),
            source,
        })
    };
    let (light, camera) = (port(Arm::Light, "light")?, port(Arm::Camera, "camera")?);
    Ok(Arms::connect(Box::new(light), Box::new(camera))?)
}

fn connect_serial(rig: &Rig, ports: ArmPortNames, orders: &Orders) -> Result<Arms, EquipmentError> {
    let of_rig = rig.arms.as_ref();
    let baud = of_rig.map_or(DEFAULT_BAUD, |arms| arms.baud);
    let light = ports.light.or(of_rig.map(|arms| arms.light.as_str()));
    let camera = ports.camera.or(of_rig.map(|arms| arms.camera.as_str()));
    let light = serial_port("light", "light", light, baud, orders)?;
    let camera = serial_port("camera", "camera-arm", camera, baud, orders)?;
    Ok(Arms::connect(Box::new(light), Box::new(camera))?)
}

fn serial_port(
    arm: &'static str,
    option: &'static str,
    port: Option<&str>,
    baud: u32,
    orders: &Orders,
) -> Result<SessionPort, EquipmentError> {
    let port = port
        .ok_or(EquipmentError::NoPort { arm, option })?
        .to_owned();
    let mut usb = UsbPort::new(&port);
    let open = move || -> io::Result<Box<dyn Transport>> {
        let path = usb.path();
        Ok(Box::new(StreamTransport::open_serial(&path, baud)?))
    };
    SessionPort::open(Box::new(open), orders).map_err(|source| EquipmentError::Port {
        arm,
        remedy: remedy_for(&port, &source),
        port,
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Direction;

    fn arms(first: Arm, second: Arm) -> Result<Arms, LinkError> {
        let sim = simulated_arms(1, true);
        Arms::connect(Box::new(sim.port(first)), Box::new(sim.port(second)))
    }

    #[test]
    fn ports_that_were_exchanged_are_told_apart_and_used_rightly() {
        let mut arms = arms(Arm::Camera, Arm::Light).unwrap();
        assert_eq!(arms.light().name(), "light arm");
        assert_eq!(arms.camera().name(), "camera arm");
        let remark = arms.exchange_remark().unwrap().to_string();
        assert!(remark.contains("exchange light and camera"), "{remark}");
        assert_eq!(
            self::arms(Arm::Light, Arm::Camera)
                .unwrap()
                .exchange_remark(),
            None
        );
        let error = self::arms(Arm::Light, Arm::Light)
            .err()
            .unwrap()
            .to_string();
        assert!(
            error.contains("both ports lead to the light arm"),
            "{error}"
        );
    }

    #[test]
    fn a_plan_is_refused_whole_before_anything_moves() {
        let pose = |theta_i, theta_v| Pose {
            light: Direction::from_deg(theta_i, 0.0),
            view: Direction::from_deg(theta_v, 0.0),
        };
        let mut arms = arms(Arm::Light, Arm::Camera).unwrap();
        arms.set_keep_out_deg(10.0);
        let rig = Rig::paper(32);
        let mut equipment = Equipment {
            arms,
            camera: Box::new(crate::camera::CommandCamera::new(&rig, Vec::new(), 1.0)),
            seed: None,
            exact: true,
        };
        equipment.check_reach(&[pose(0.0, 20.0)]).unwrap();
        for (plan, said) in [
            (
                [pose(0.0, 20.0), pose(30.0, 35.0)],
                "plan, pose 1: the arms would be 5.0 degrees",
            ),
            (
                [pose(0.0, 20.0), pose(120.0, 35.0)],
                "plan, pose 1: theta 120 degrees",
            ),
        ] {
            let error = equipment.check_reach(&plan).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
