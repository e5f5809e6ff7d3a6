//! The rate of a session, and the time that is left.

use gonia_rig::Role;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// The rate is that of this many poses.
const LAST: usize = 60;

/// Poses done and to be done, and the rate of the last ones.
#[derive(Clone, Debug)]
pub struct Pace {
    roles: usize,
    /// Poses of this role that are done.
    pub done: usize,
    /// Poses of a role.
    pub planned: usize,
    /// Poses of the roles after this one.
    later: usize,
    /// When the last poses were done, and when the first of them was begun.
    moments: VecDeque<Instant>,
}

impl Pace {
    /// Of a session over so many poses and roles.
    pub fn new(planned: usize, roles: usize) -> Self {
        Self {
            roles,
            done: 0,
            planned,
            later: planned * roles.saturating_sub(1),
            moments: VecDeque::new(),
        }
    }

    /// A role begins, or goes on.
    pub fn begin(&mut self, role: Role, missing: usize, now: Instant) {
        self.done = self.planned.saturating_sub(missing);
        self.later = match role {
            Role::Reference => self.planned * self.roles.saturating_sub(1),
            Role::Material | Role::Mirror => 0,
        };
        self.go_on(now);
    }

    /// After a pause, which is no part of the rate.
    pub fn go_on(&mut self, now: Instant) {
        self.moments.clear();
        self.moments.push_back(now);
    }

    /// A pose is done.
    pub fn pose(&mut self, now: Instant) {
        self.done += 1;
        self.moments.push_back(now);
        if self.moments.len() > LAST {
            self.moments.pop_front();
        }
    }

    /// So many poses were discarded.
    pub fn discard(&mut self, poses: usize) {
        self.done = self.done.saturating_sub(poses);
    }

    /// Poses a second; `None` before the first one.
    pub fn rate(&self) -> Option<f64> {
        let took = *self.moments.back()? - *self.moments.front()?;
        (took > Duration::ZERO).then(|| (self.moments.len() - 1) as f64 / took.as_secs_f64())
    }

    /// Time until all roles are done, seconds; `None` before the first pose.
    pub fn left_s(&self) -> Option<f64> {
        let left = self.planned.saturating_sub(self.done) + self.later;
        Some(left as f64 / self.rate()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_that_of_the_last_poses_and_a_pause_is_none_of_it() {
        let began = Instant::now();
        let at = |s: u64| began + Duration::from_secs(s);
        let mut pace = Pace::new(1000, 2);
        assert_eq!((pace.rate(), pace.left_s()), (None, None));
        pace.begin(Role::Reference, 1000, at(0));
        for k in 1..=100 {
            pace.pose(at(8 * k));
        }
        assert_eq!(pace.rate(), Some(0.125));
        assert_eq!(pace.left_s(), Some(8.0 * 1900.0));
        // Half as fast from here on, after a night's pause.
        pace.go_on(at(50_000));
        pace.discard(2);
        pace.pose(at(50_016));
        assert_eq!((pace.done, pace.rate()), (99, Some(0.0625)));
        pace.begin(Role::Material, 400, at(60_000));
        pace.pose(at(60_010));
        assert_eq!((pace.done, pace.left_s()), (601, Some(3990.0)));
    }
}
