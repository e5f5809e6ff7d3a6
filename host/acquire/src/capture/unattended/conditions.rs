//! What a session waits for: room on the disk, and a temperature within its limits.

use crate::capture::coordinator::{Coordinator, Halt};
use crate::capture::shooter::Shooter;
use crate::capture::thermometer;
use crate::capture::unattended::role_run::RoleRun;
use crate::capture::watch::SessionEvent;
use crate::session::Entry;
use std::time::Instant;

/// While the arms rest, orders are looked for this often, µs.
const REST_US: u64 = 200_000;

impl RoleRun<'_> {
    /// Waits while the disk is nearly full.
    pub(super) fn wait_for_room(
        &self,
        shooter: &mut Shooter,
        coordinator: &mut Coordinator,
    ) -> Result<(), Halt> {
        let settings = self.session.settings;
        for tries in 0.. {
            // The writer itself may be waiting for the disk, and the arms do not wait for that.
            let Some(free_mb) = (self.session.free_mb)(&coordinator.folder) else {
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
            coordinator.note(&text);
            self.rest(shooter, coordinator)?;
        }
        Ok(())
    }

    /// Waits while it is too cold or too warm, or the temperature is not known. It is read again only at
    /// `look_us` by the arms' clock, which this moves on. What it has done to the lamp, the control pose
    /// tells, which comes first then.
    pub(super) fn wait_for_temperature(
        &self,
        shooter: &mut Shooter,
        coordinator: &mut Coordinator,
        look_us: &mut u64,
    ) -> Result<(), Halt> {
        let settings = self.session.settings;
        let Some(thermometer) = &settings.thermometer else {
            return Ok(());
        };
        if shooter.arms().now_us() < *look_us {
            return Ok(());
        }
        for tries in 0.. {
            let Err(error) = thermometer::check(thermometer) else {
                *look_us = shooter.arms().now_us() + (thermometer.every_s * 1e6) as u64;
                return Ok(());
            };
            if tries >= settings.max_retries {
                return Err(Halt::Failed(format!("{error}: go on with --resume")));
            }
            if tries == 0 {
                coordinator.write(&Entry::Pause(error.to_string()))?;
                let text = error.to_string();
                coordinator.watch.on_event(&SessionEvent::Note(&text));
            } else {
                coordinator.note(&error.to_string());
            }
            self.rest(shooter, coordinator)?;
        }
        Ok(())
    }

    /// A pause by the arms' clock, in which orders are carried out.
    pub(super) fn rest(
        &self,
        shooter: &mut Shooter,
        coordinator: &mut Coordinator,
    ) -> Result<(), Halt> {
        let until_us = shooter.arms().now_us() + (self.session.settings.pause_s * 1e6) as u64;
        while shooter.arms().now_us() < until_us {
            self.obey(shooter, coordinator)?;
            let began = Instant::now();
            let left_us = until_us.saturating_sub(shooter.arms().now_us());
            let rested = shooter.arms().light().rest(left_us.min(REST_US));
            coordinator.paused += began.elapsed();
            if let Err(error) = rested {
                return Err(Halt::Failed(error.to_string()));
            }
        }
        Ok(())
    }
}
