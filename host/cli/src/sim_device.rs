//! `gonia sim-device`: simulated controllers on pseudo-terminals, in real time.

use anyhow::Result;
#[cfg(not(unix))]
use anyhow::bail;
use std::path::PathBuf;

/// Simulates both controllers, with their arms, until it is stopped with Ctrl-C.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia sim-device --pty &\n  gonia device /dev/pts/3 identify\n\nIt prints a line for each arm: its name and the port to open. Any baud rate does.\n\nWith --frames and --rig a camera stands beside them: it leaves a frame of the demo's fabric in the\nfolder for every trigger pulse, as [source] kind = \"folder\" wants them.\n\nBuilt with the feature genicam, --gige 127.0.0.1 and --rig make it a GigE Vision device at that address\ninstead, for [source] kind = \"genicam\": docs/src/guides/camera.md."
)]
pub struct SimDevice {
    /// Offer the controllers on pseudo-terminals (the default)
    #[arg(long)]
    pty: bool,
    /// Seed of the noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Also be the camera: leave a frame in this folder for every trigger pulse
    #[arg(long, value_name = "DIR", requires = "rig", group = "camera")]
    frames: Option<PathBuf>,
    /// Also be the camera: a GigE Vision device at this address of the loopback
    #[cfg(feature = "genicam")]
    #[arg(long, value_name = "ADDRESS", requires = "rig", group = "camera")]
    gige: Option<std::net::Ipv4Addr>,
    /// The rig whose camera it is
    #[arg(long, value_name = "RIG.toml", requires = "camera")]
    rig: Option<PathBuf>,
}

#[cfg(not(unix))]
impl SimDevice {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let _ = (self.pty, self.seed, self.frames, self.rig);
        bail!("this system has no pseudo-terminals: run it on Linux or macOS")
    }
}

#[cfg(unix)]
impl SimDevice {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        // There is no other way, so the option changes nothing.
        let camera = self.frames.as_deref().zip(self.rig.as_deref());
        let rig = gonia_sim::rig::SimRig::new(self.seed, gonia_sim::fault::FaultPlan::default());
        #[cfg(feature = "genicam")]
        let _gige = match (self.gige, &self.rig) {
            (Some(address), Some(path)) => Some(gige(path, &rig, self.seed, address)?),
            _ => None,
        };
        ptys::serve(&rig, self.seed, camera)
    }
}

/// The camera as a GigE Vision device, looking at the demo's fabric.
#[cfg(all(unix, feature = "genicam"))]
fn gige(
    path: &std::path::Path,
    arms: &gonia_sim::rig::SimRig,
    seed: u64,
    address: std::net::Ipv4Addr,
) -> Result<gonia_acquire::camera::SimulatedGige> {
    use gonia_brdf::model::Kurt;
    use std::sync::Arc;
    let rig = gonia_formats::rig_toml::read_rig(path)?;
    let (material, reference) = (Kurt::two_thread_fabric(), Kurt::white_reference_fabric());
    let surfaces = (Arc::new(material) as _, Arc::new(reference) as _);
    let arms = arms.clone();
    Ok(gonia_acquire::camera::SimulatedGige::start(
        &rig,
        arms,
        surfaces,
        seed,
        address,
        |_| None,
    )?)
}

#[cfg(unix)]
mod ptys {
    use super::Result;
    use crate::say::{errln, outln};
    use anyhow::{Context, bail};
    use gonia_brdf::Pose;
    use gonia_brdf::model::Kurt;
    use gonia_formats::check_writable;
    use gonia_formats::frame_exr::write_frame;
    use gonia_formats::rig_toml::read_rig;
    use gonia_rig::Role;
    use gonia_sim::fault::Arm;
    use gonia_sim::rig::{SimPort, SimRig};
    use gonia_sim::scene::{Scene, SceneGeometry};
    use serialport::{SerialPort, TTYPort};
    use std::io::{ErrorKind, Read, Write};
    use std::path::Path;
    use std::sync::Arc;
    use std::sync::mpsc::{Sender, channel};
    use std::time::{Duration, Instant};

    /// How long a turn waits for bytes of the host; the simulation is behind by no more.
    const TURN: Duration = Duration::from_millis(1);

    struct ArmPort {
        port: SimPort,
        master: TTYPort,
        // Kept open, so that the terminal outlives its clients.
        _slave: TTYPort,
    }

    /// Starts a camera that renders a frame for every pose it is sent, on a thread of its own, so that
    /// the arms do not wait for it.
    fn start_camera(folder: &Path, rig: &Path, seed: u64) -> Result<Sender<Pose>> {
        let rig = read_rig(rig)?;
        check_writable(folder)?;
        let scene = Scene::new(
            SceneGeometry::of_rig(&rig),
            Arc::new(Kurt::two_thread_fabric()),
            Arc::new(Kurt::white_reference_fabric()),
            seed,
        );
        let (exposed, poses) = channel();
        let folder = folder.to_owned();
        std::thread::spawn(move || {
            for (number, pose) in poses.iter().enumerate() {
                let frame = scene.frame(Role::Material, pose, number as u64);
                let path = folder.join(format!("{number:06}.exr"));
                if let Err(error) = write_frame(&path, &frame) {
                    errln!("gonia: {error}");
                }
            }
        });
        Ok(exposed)
    }

    pub fn serve(rig: &SimRig, seed: u64, camera: Option<(&Path, &Path)>) -> Result<()> {
        let camera = match camera {
            Some((folder, rig)) => Some(start_camera(folder, rig, seed)?),
            None => None,
        };
        let mut exposed = 0;
        let mut ports = Vec::new();
        for (arm, name) in [(Arm::Light, "light arm"), (Arm::Camera, "camera arm")] {
            let (mut master, slave) =
                TTYPort::pair().context("no pseudo-terminal to be had; close some")?;
            master.set_timeout(TURN)?;
            let Some(path) = slave.name() else {
                bail!("the pseudo-terminal has no name");
            };
            outln!("{name}  {path}");
            ports.push(ArmPort {
                port: rig.port(arm),
                master,
                _slave: slave,
            });
        }
        let began = Instant::now();
        loop {
            for port in &mut ports {
                port.read_master()?;
            }
            let now_us = began.elapsed().as_micros() as u64;
            for port in &mut ports {
                port.run_until(now_us)?;
            }
            if let Some(camera) = &camera
                && rig.trigger_count() > exposed
            {
                for trigger in rig.triggers().split_off(exposed) {
                    exposed += 1;
                    camera.send(trigger.pose())?;
                }
            }
        }
    }

    impl ArmPort {
        fn read_master(&mut self) -> Result<()> {
            let mut bytes = [0; 512];
            match self.master.read(&mut bytes) {
                Ok(n) => self.port.send(&bytes[..n]),
                Err(error) if error.kind() == ErrorKind::TimedOut => {}
                Err(error) => return Err(error).context("the pseudo-terminal failed"),
            }
            Ok(())
        }

        /// Lets the rig run up to now, and passes on what it sent.
        fn run_until(&mut self, now_us: u64) -> Result<()> {
            let mut bytes = Vec::new();
            loop {
                let left_us = now_us.saturating_sub(self.port.now_us());
                let before = bytes.len();
                self.port.receive(&mut bytes, left_us);
                if bytes.len() == before && self.port.now_us() >= now_us {
                    break;
                }
            }
            match self.master.write_all(&bytes) {
                Ok(()) => Ok(()),
                // Nobody reads, and the terminal is full: as on a wire, the bytes are lost.
                Err(error) if error.kind() == ErrorKind::TimedOut => Ok(()),
                Err(error) => Err(error).context("the pseudo-terminal failed"),
            }
        }
    }
}
