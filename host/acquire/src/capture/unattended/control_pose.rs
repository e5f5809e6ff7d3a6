//! The control pose in a session: when it has changed, what was measured since is measured again.

use crate::capture::coordinator::{Coordinator, Halt};
use crate::capture::course::{AfterControl, after_control, judged};
use crate::capture::frame_worker::{Task, lock};
use crate::capture::shooter::Shooter;
use crate::capture::unattended::role_run::RoleRun;
use crate::capture::watch::SessionEvent;
use crate::session::{ControlComparison, Entry, RoleState};

impl RoleRun<'_> {
    /// Takes the control pose once, and does what follows from it. Poses that it does not vouch for are
    /// measured again.
    pub(super) fn take_control(
        &self,
        shooter: &mut Shooter,
        coordinator: &mut Coordinator,
        index: usize,
    ) -> Result<(), Halt> {
        let settings = self.session.settings;
        let comparison = self.compare(shooter, coordinator, index)?;
        let said = comparison.map_or("its marks are not to be seen".into(), |c| c.to_string());
        let (control, doubtful, since) = self.state(coordinator, |state| {
            let control = judged(state, (self.role, index), comparison, settings.drift_limit);
            (control, state.doubtful(), state.doubtful_since())
        });
        coordinator.write(&Entry::Control(control))?;
        let (after, still) = self.state(coordinator, |state| {
            let after = after_control(state, settings.max_retries);
            (after, state.doubtful())
        });
        if after != AfterControl::GoOn && still.is_empty() && !doubtful.is_empty() {
            self.discarded(coordinator, doubtful, since, &said)?;
        }
        match after {
            AfterControl::GoOn => Ok(()),
            AfterControl::TakeAgain => {
                coordinator.note(&format!("the control pose is taken once more: {said}"));
                Ok(())
            }
            AfterControl::Wait => {
                coordinator.note(&format!("the lamp has drifted: {said}"));
                self.rest(shooter, coordinator)
            }
            AfterControl::LampStays => Err(Halt::Failed(format!(
                "the lamp stays other than it was ({said}): mend it and go on with --resume, or begin a new session"
            ))),
            AfterControl::Moved => Err(Halt::Failed(format!(
                "the control pose is not what it was ({said}): put the {} and the camera back as they were, or begin a new session",
                self.role.name()
            ))),
        }
    }

    /// Something of this role's state.
    pub(super) fn state<T>(
        &self,
        coordinator: &Coordinator,
        get: impl FnOnce(&RoleState) -> T,
    ) -> T {
        get(lock(coordinator.writer).state().role(self.role))
    }

    fn compare(
        &self,
        shooter: &mut Shooter,
        coordinator: &mut Coordinator,
        index: usize,
    ) -> Result<Option<ControlComparison>, Halt> {
        coordinator.control_take = None;
        coordinator.queue.push_front(Task {
            index,
            tries: 0,
            is_control: true,
        });
        // Its own second takes come by the queue too.
        loop {
            if let Some(take) = coordinator.control_take.take() {
                return Ok(take);
            }
            self.obey(shooter, coordinator)?;
            let Some(at) = coordinator.queue.iter().position(|task| task.is_control) else {
                return Ok(None);
            };
            if let Some(task) = coordinator.queue.remove(at) {
                self.shoot(shooter, coordinator, task)?;
            }
            coordinator.close_last_shot()?;
            coordinator.wait_for_worker()?;
        }
    }

    /// Puts the poses that a control pose has discarded into the queue again, and says so.
    fn discarded(
        &self,
        coordinator: &mut Coordinator,
        poses: Vec<usize>,
        since: usize,
        why: &str,
    ) -> Result<(), Halt> {
        // The control's own entry has discarded them; this one is for those who read the journal.
        coordinator.write(&Entry::Discard {
            role: Some(self.role),
            since,
            why: why.to_owned(),
        })?;
        coordinator.watch.on_event(&SessionEvent::Discarded(&poses));
        coordinator.note(&format!(
            "{} poses since the last control are taken again",
            poses.len()
        ));
        for index in poses.into_iter().rev() {
            coordinator.queue.push_front(Task {
                index,
                tries: 0,
                is_control: false,
            });
        }
        Ok(())
    }
}
