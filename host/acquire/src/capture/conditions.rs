//! What a session waits for: room on the disk, a temperature that will do.

use crate::capture::accounts::{Accounts, Halt};
use crate::capture::session::Shooter;
use crate::capture::thermometer;
use crate::capture::unattended::Measuring;
use std::path::Path;
use std::time::Instant;

/// Arms that rest listen to orders this often, µs.
const REST_US: u64 = 200_000;

impl Measuring<'_> {
    /// Waits while the disk is nearly full.
    pub(super) fn wait_for_room(
        &self,
        shooter: &mut Shooter,
        accounts: &mut Accounts,
    ) -> Result<(), Halt> {
        let settings = self.capture.settings;
        for tries in 0.. {
            // The writer itself may be waiting for the disk, and the arms do not wait for that.
            let Some(free_mb) = (self.capture.free_mb)(&accounts.folder) else {
                return Ok(());
            };
            if free_mb >= settings.disk_reserve_mb {
                return Ok(());
            }
            let text = format!(
                "the disk has {free_mb} MB left, and {} MB are reserved",
                settings.disk_reserve_mb
            );
            if tries >= settings.max_retries {
                return Err(Halt::Failed(format!(
                    "{text}: free some, and go on with --resume"
                )));
            }
            accounts.event(&text);
            self.rest(shooter, accounts)?;
        }
        Ok(())
    }

    /// Waits while it is too cold or too warm, or nobody knows. Looks again only `every_s` after the
    /// last look, which was before `look_us` by the arms' clock. Whether it had to wait.
    pub(super) fn wait_for_temperature(
        &self,
        shooter: &mut Shooter,
        accounts: &mut Accounts,
        look_us: &mut u64,
    ) -> Result<bool, Halt> {
        let settings = self.capture.settings;
        let Some(thermometer) = &settings.thermometer else {
            return Ok(false);
        };
        if shooter.arms().now_us() < *look_us {
            return Ok(false);
        }
        for tries in 0.. {
            let Err(text) = thermometer::check(thermometer) else {
                *look_us = shooter.arms().now_us() + (thermometer.every_s * 1e6) as u64;
                return Ok(tries > 0);
            };
            if tries >= settings.max_retries {
                return Err(Halt::Failed(format!("{text}: go on with --resume")));
            }
            accounts.event(&text);
            self.rest(shooter, accounts)?;
        }
        Ok(true)
    }

    /// A pause by the arms' clock, in which orders are heard.
    pub(super) fn rest(&self, shooter: &mut Shooter, accounts: &mut Accounts) -> Result<(), Halt> {
        let until_us = shooter.arms().now_us() + (self.capture.settings.pause_s * 1e6) as u64;
        while shooter.arms().now_us() < until_us {
            self.obey(shooter, accounts)?;
            let began = Instant::now();
            let left_us = until_us.saturating_sub(shooter.arms().now_us());
            let rested = shooter.arms().light().rest(left_us.min(REST_US));
            accounts.paused += began.elapsed();
            if let Err(error) = rested {
                return Err(Halt::Failed(error.to_string()));
            }
        }
        Ok(())
    }
}

/// Room on the disk of a folder, MB; `None` where the system does not say.
pub fn free_mb(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize) / 1_000_000)
}
