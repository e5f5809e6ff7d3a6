//! `gonia sim-device`: simulated controllers on pseudo-terminals, in real time.

use anyhow::{Result, bail};

/// Simulates both controllers, with their arms, until it is stopped with Ctrl-C.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia sim-device --pty &\n  gonia device /dev/pts/3 identify\n\nIt prints a line for each arm: its name and the port to open. Any baud rate does."
)]
pub struct SimDevice {
    /// Offer the controllers on pseudo-terminals (the default)
    #[arg(long)]
    pty: bool,
    /// Seed of the noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

#[cfg(not(unix))]
impl SimDevice {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let _ = (self.pty, self.seed);
        bail!("this system has no pseudo-terminals: run it on Linux or macOS")
    }
}

#[cfg(unix)]
impl SimDevice {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        // There is one door, so the option only says aloud what happens anyhow.
        let Self { pty: _, seed } = self;
        ptys::serve(seed)
    }
}

#[cfg(unix)]
mod ptys {
    use super::{Result, bail};
    use anyhow::Context;
    use gonia_sim::fault::FaultPlan;
    use gonia_sim::rig::{Arm, SimPort, SimRig};
    use serialport::{SerialPort, TTYPort};
    use std::io::{ErrorKind, Read, Write};
    use std::time::{Duration, Instant};

    /// How long a turn waits for bytes of the host; the simulation is behind by no more.
    const TURN: Duration = Duration::from_millis(1);

    struct Door {
        port: SimPort,
        master: TTYPort,
        // Kept open, so that the terminal outlives its clients.
        _slave: TTYPort,
    }

    pub fn serve(seed: u64) -> Result<()> {
        let rig = SimRig::new(seed, FaultPlan::default());
        let mut doors = Vec::new();
        for (arm, name) in [(Arm::Light, "light arm"), (Arm::Camera, "camera arm")] {
            let (mut master, slave) =
                TTYPort::pair().context("no pseudo-terminal to be had; close some")?;
            master.set_timeout(TURN)?;
            let Some(path) = slave.name() else {
                bail!("the pseudo-terminal has no name");
            };
            println!("{name}  {path}");
            doors.push(Door {
                port: rig.port(arm),
                master,
                _slave: slave,
            });
        }
        std::io::stdout().flush()?;
        let began = Instant::now();
        loop {
            for door in &mut doors {
                door.hear()?;
            }
            let now_us = began.elapsed().as_micros() as u64;
            for door in &mut doors {
                door.answer(now_us)?;
            }
        }
    }

    impl Door {
        fn hear(&mut self) -> Result<()> {
            let mut bytes = [0; 512];
            match self.master.read(&mut bytes) {
                Ok(n) => self.port.send(&bytes[..n]),
                Err(error) if error.kind() == ErrorKind::TimedOut => {}
                Err(error) => return Err(error).context("the pseudo-terminal failed"),
            }
            Ok(())
        }

        /// Lets the rig run up to now, and passes on what it said.
        fn answer(&mut self, now_us: u64) -> Result<()> {
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
