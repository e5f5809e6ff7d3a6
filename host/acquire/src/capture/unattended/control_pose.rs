//! The control pose in a session: when it has changed, what was measured since is measured again.

use crate::capture::control::Judgement;
use crate::capture::coordinator::{Coordinator, Halt};
use crate::capture::frame_worker::{ControlTake, Task, lock};
use crate::capture::shooter::Shooter;
use crate::capture::unattended::role_run::{RoleRun, Totals};
use crate::capture::watch::SessionEvent;
use crate::session::Entry;

impl RoleRun<'_> {
    /// Takes the control pose until it is as it was. Poses measured since it last was are measured
    /// again.
    pub(super) fn check_control(
        &self,
        shooter: &mut Shooter,
        coordinator: &mut Coordinator,
        good_line: usize,
    ) -> Result<(), Halt> {
        let Some(index) = coordinator.control else {
            return Ok(());
        };
        let settings = self.session.settings;
        let mut said = String::new();
        for _ in 0..=settings.max_retries {
            let judgement = match self.compare(shooter, coordinator, index)? {
                ControlTake::Compared(comparison) => {
                    said = comparison.to_string();
                    comparison.judge(settings.drift_limit)
                }
                ControlTake::Unusable => {
                    said = "its marks are not to be seen".into();
                    Judgement::Moved
                }
            };
            let name = format!("{} pose {index}: {said}", self.role.name());
            let noted = lock(coordinator.writer).note(&Entry::Control(name.clone()));
            noted.map_err(|error| Halt::Failed(error.to_string()))?;
            if judgement == Judgement::Same {
                return Ok(());
            }
            self.discard(coordinator, good_line, &name)?;
            if judgement == Judgement::Moved {
                return Err(Halt::Failed(format!(
                    "the control pose is not what it was ({said}): put sample and camera back as they were, or begin a new session"
                )));
            }
            coordinator.note(&format!("the lamp has drifted: {said}"));
            self.rest(shooter, coordinator)?;
        }
        Err(Halt::Failed(format!(
            "the lamp stays other than it was ({said}): mend it and go on with --resume"
        )))
    }

    fn compare(
        &self,
        shooter: &mut Shooter,
        coordinator: &mut Coordinator,
        index: usize,
    ) -> Result<ControlTake, Halt> {
        coordinator.control_take = None;
        coordinator.queue.push_front(Task {
            index,
            tries: 0,
            is_control: true,
        });
        // Its own second takes come by the queue too.
        let mut totals = Totals::default();
        loop {
            if let Some(take) = coordinator.control_take.take() {
                return Ok(take);
            }
            self.obey(shooter, coordinator)?;
            let Some(at) = coordinator.queue.iter().position(|task| task.is_control) else {
                return Ok(ControlTake::Unusable);
            };
            if let Some(task) = coordinator.queue.remove(at) {
                self.shoot(shooter, coordinator, task, &mut totals)?;
            }
            coordinator.close_last_shot()?;
            coordinator.wait_for_worker()?;
        }
    }

    /// Discards the poses since the last good control pose, and puts them into the queue again.
    fn discard(
        &self,
        coordinator: &mut Coordinator,
        good_line: usize,
        why: &str,
    ) -> Result<(), Halt> {
        if coordinator.since_control.is_empty() {
            return Ok(());
        }
        let noted = lock(coordinator.writer).note(&Entry::Discard {
            since: good_line,
            why: why.to_owned(),
        });
        noted.map_err(|error| Halt::Failed(error.to_string()))?;
        let discarded = std::mem::take(&mut coordinator.since_control);
        coordinator
            .watch
            .on_event(&SessionEvent::Discarded(&discarded));
        coordinator.note(&format!(
            "{} poses since the last control are taken again",
            discarded.len()
        ));
        for index in discarded.into_iter().rev() {
            coordinator.queue.push_front(Task {
                index,
                tries: 0,
                is_control: false,
            });
        }
        Ok(())
    }
}
