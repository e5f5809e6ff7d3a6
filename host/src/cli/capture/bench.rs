//! The bench of a session: two arms and a camera, as `rig.toml` and the command line name them.

use crate::camera::{Camera, CommandCamera, FolderCamera, RenderingCamera};
use crate::capture::{Arms, Options, Orders, SessionPort};
use crate::dataset::Rig;
use crate::dataset::bench_setup::{SessionSettings, Source};
use crate::dataset::genicam_setup::Genicam;
use crate::link::{StreamTransport, Transport};
use anyhow::{Context, Result, bail};
use gonia_brdf::Pose;
use gonia_protocol::settings::{Axis, Key};
use gonia_sim::arm::SimulatedArm;
use gonia_sim::fault::{Arm, FaultPlan};
use gonia_sim::rig::SimRig;
use std::path::Path;

/// Ports that the command line names.
#[derive(Clone, Copy)]
pub struct Ports<'a> {
    pub light: Option<&'a str>,
    pub camera: Option<&'a str>,
    pub simulated: bool,
}

/// Arms that answer, and a camera.
pub struct Bench {
    pub arms: Arms,
    pub camera: Box<dyn Camera>,
    /// Of a simulated rig.
    pub seed: Option<u64>,
    /// Of one whose every take is the same.
    pub exact: bool,
}

impl Bench {
    /// Opens everything. `path` is that of `rig.toml`, which names its folders relative to itself.
    pub fn open(
        rig: &Rig,
        path: &Path,
        ports: Ports,
        planned: usize,
        settings: &SessionSettings,
        orders: &Orders,
    ) -> Result<Self> {
        let mut bench = match &rig.source {
            Some(Source::Simulated { seed, exact }) => {
                simulated(rig, *seed, *exact, planned, orders)?
            }
            _ if ports.simulated => simulated(rig, 1, false, planned, orders)?,
            Some(Source::Folder {
                path: folder,
                timeout_s,
            }) => {
                let folder = path.parent().unwrap_or(Path::new("")).join(folder);
                let camera = FolderCamera::open(rig, folder, *timeout_s)?;
                real(rig, ports, Box::new(camera), orders)?
            }
            Some(Source::Command { run, timeout_s }) => {
                let camera = CommandCamera::new(rig, run.clone(), *timeout_s);
                real(rig, ports, Box::new(camera), orders)?
            }
            Some(Source::Genicam(setup)) => {
                let camera = genicam(rig, setup, settings)?;
                real(rig, ports, camera, orders)?
            }
            None => bail!(
                "{}: has no [source]: say there where the frames come from (docs/session.md), or try --simulated",
                path.display()
            ),
        };
        let exposures_us = settings.exposures_s.iter();
        bench.arms.set_options(Options {
            exposures_us: exposures_us.map(|s| (s * 1e6).round() as u32).collect(),
            ..Options::default()
        })?;
        if let Some(arms) = &rig.arms {
            bench.arms.set_keep_out_deg(arms.keep_out_deg);
        }
        Ok(bench)
    }

    /// Refuses poses that the controllers would refuse in the night.
    pub fn check_reach(&mut self, plan: &[Pose]) -> Result<()> {
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
            let limits = least?..=most?;
            let name = controller.name().to_owned();
            for (index, pose) in plan.iter().enumerate() {
                let direction = if is_light { pose.light } else { pose.view };
                // The arms are sent to the nearest millionth of a degree.
                let theta_deg = (direction.theta_deg() * 1e6).round() * 1e-6;
                if !limits.contains(&theta_deg) {
                    bail!(
                        "plan, pose {index}: theta {theta_deg} degrees is beyond the {name}'s limits ({} to {}); take it out of the plan, or widen the limits with gonia device",
                        limits.start(),
                        limits.end()
                    );
                }
            }
        }
        Ok(())
    }
}

#[cfg(feature = "genicam")]
fn genicam(rig: &Rig, setup: &Genicam, settings: &SessionSettings) -> Result<Box<dyn Camera>> {
    let camera = crate::camera::GenicamCamera::open(rig, setup, &settings.exposures_s)?;
    Ok(Box::new(camera))
}

#[cfg(not(feature = "genicam"))]
fn genicam(_: &Rig, _: &Genicam, _: &SessionSettings) -> Result<Box<dyn Camera>> {
    bail!(
        "this gonia was built without GenICam: install libaravis-dev, and build it with --features genicam (docs/cameras.md)"
    )
}

fn simulated(rig: &Rig, seed: u64, exact: bool, planned: usize, orders: &Orders) -> Result<Bench> {
    let sim = if exact {
        let arms = [(); 2].map(|()| SimulatedArm::quiet_arm_near_home());
        SimRig::with_arms(seed, FaultPlan::default(), arms)
    } else {
        SimRig::new(seed, FaultPlan::default())
    };
    let port = |arm| {
        let sim = sim.clone();
        SessionPort::open(
            Box::new(move || Ok(Box::new(sim.port(arm)) as Box<dyn Transport>)),
            orders,
        )
    };
    let arms = Arms::connect(Box::new(port(Arm::Light)?), Box::new(port(Arm::Camera)?))?;
    let camera = RenderingCamera::new(rig, sim, seed, planned, exact);
    Ok(Bench {
        arms,
        camera: Box::new(camera),
        seed: Some(seed),
        exact,
    })
}

fn real(rig: &Rig, ports: Ports, camera: Box<dyn Camera>, orders: &Orders) -> Result<Bench> {
    let baud = rig.arms.as_ref().map_or(115_200, |arms| arms.baud);
    let [light, camera_arm] = [
        ("light", ports.light, rig.arms.as_ref().map(|a| &a.light)),
        ("camera", ports.camera, rig.arms.as_ref().map(|a| &a.camera)),
    ]
    .map(|(name, given, of_rig)| {
        let path = given.or(of_rig.map(String::as_str)).with_context(|| {
            format!(
                "no port of the {name} arm's controller: give [arms] {name} in rig.toml, or --{} PORT",
                if name == "light" { "light" } else { "camera-arm" }
            )
        })?;
        let path = path.to_owned();
        let named = path.clone();
        let open = move || -> std::io::Result<Box<dyn Transport>> {
            Ok(Box::new(StreamTransport::open_serial(&path, baud)?))
        };
        SessionPort::open(Box::new(open), orders).with_context(|| {
            format!("the {name} arm's port {named} cannot be opened; check the cable, the name and that nobody else uses it")
        })
    });
    Ok(Bench {
        arms: Arms::connect(Box::new(light?), Box::new(camera_arm?))?,
        camera,
        seed: None,
        exact: false,
    })
}
