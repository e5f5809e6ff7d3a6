//! Sessions on a disk that fails and in programs that die, at every call: no wrong pose is kept and none
//! is lost, and the state that a journal gives is the one that the running session had.
//!
//! Arms and camera are left out; what decides and what writes is what a session runs with: [`next_step`],
//! [`judged`], [`after_control`], [`SessionWriter`], [`SessionState`]. The lamp's brightness is in the
//! frames, so that every pose kept can be compared with the truth.

use super::append::LogFile;
use super::entry::{CHANGE_THE_SAMPLE, Entry, GivenUp, PoseDone, SessionEnd};
use super::folder::{FRAMES, JOURNAL};
use super::some_frame::some_frame;
use super::state::SessionState;
use super::writer::SessionWriter;
use super::{ControlComparison, journal};
use crate::capture::{AfterControl, Step, after_control, judged, next_step};
use gonia_brdf::random::Random;
use gonia_formats::FileError;
use gonia_imaging::RegistrationFailure;
use gonia_pipeline::process::{Outcome, SampledFrame, sampled_bytes};
use gonia_protocol::crc32c;
use gonia_rig::Role;
use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard};

const POSES: usize = 6;
const CONTROL_EVERY: usize = 3;
const RETRIES: u32 = 3;
const DRIFT_LIMIT: f64 = 0.02;
const ROLES: [Role; 2] = [Role::Reference, Role::Material];

/// What befalls a program, from a call of the disk on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// The calls fail, and do nothing.
    Fails(ErrorKind),
    /// The first call writes half; the others fail.
    FailsHalfway(ErrorKind),
    /// Every call writes half.
    Short,
    /// The program is killed before the call.
    KilledBefore,
    /// Or after it.
    KilledAfter,
    /// The power goes: what was not synced is there in part, or as zeros.
    PowerCut,
}

const KINDS: [Kind; 9] = [
    // EIO, ENOSPC, EMFILE and EPIPE, as far as the standard library has names for them.
    Kind::Fails(ErrorKind::Other),
    Kind::Fails(ErrorKind::StorageFull),
    Kind::Fails(ErrorKind::BrokenPipe),
    Kind::FailsHalfway(ErrorKind::Other),
    Kind::FailsHalfway(ErrorKind::StorageFull),
    Kind::Short,
    Kind::KilledBefore,
    Kind::KilledAfter,
    Kind::PowerCut,
];

#[derive(Clone, Debug)]
struct Trouble {
    calls: Range<u64>,
    kind: Kind,
}

/// Whole numbers by chance.
#[derive(Debug)]
struct Chance(Random);

impl Chance {
    fn of(seed: u64) -> Self {
        Self(Random::new(seed))
    }

    fn below(&mut self, n: u64) -> u64 {
        self.0.between(0.0, n as f64) as u64
    }
}

#[derive(Debug, Default)]
struct Image {
    synced: Vec<u8>,
    cached: Vec<u8>,
}

#[derive(Debug)]
struct Disk {
    files: [Image; 2],
    calls: u64,
    trouble: Option<Trouble>,
    is_dead: bool,
    chance: Chance,
}

impl Disk {
    /// What befalls the next call, and whether it is the first one of the trouble.
    fn call(&mut self) -> io::Result<Option<(Kind, bool)>> {
        if self.is_dead {
            return Err(ErrorKind::Other.into());
        }
        let call = self.calls;
        self.calls += 1;
        let now = self.trouble.as_ref().filter(|t| t.calls.contains(&call));
        let now = now.map(|t| (t.kind, t.calls.start == call));
        match now {
            Some((Kind::KilledBefore, _)) => self.is_dead = true,
            Some((Kind::Fails(kind) | Kind::FailsHalfway(kind), first))
                if !(first && matches!(now, Some((Kind::FailsHalfway(_), _)))) =>
            {
                return Err(kind.into());
            }
            _ => {}
        }
        if self.is_dead {
            return Err(ErrorKind::Other.into());
        }
        Ok(now)
    }

    /// After a call that was carried out.
    fn called(&mut self, now: Option<(Kind, bool)>) -> io::Result<()> {
        match now {
            Some((Kind::KilledAfter, _)) => self.is_dead = true,
            Some((Kind::PowerCut, _)) => {
                self.is_dead = true;
                for file in &mut self.files {
                    cut_power(file, &mut self.chance);
                }
            }
            _ => return Ok(()),
        }
        Err(ErrorKind::Other.into())
    }
}

/// What is on a disk after its power was cut: all that was synced, and by chance some of what was not.
fn cut_power(file: &mut Image, chance: &mut Chance) {
    let Image { synced, cached } = file;
    if let Some(more) = cached.strip_prefix(synced.as_slice()) {
        let some = chance.below(more.len() as u64 + 1) as usize;
        let is_zeros = chance.below(4) == 0;
        let more = more[..some].iter().map(|b| if is_zeros { 0 } else { *b });
        synced.extend(more.collect::<Vec<u8>>());
    } else if chance.below(2) == 0 {
        synced.clone_from(cached);
    }
    cached.clone_from(synced);
}

#[derive(Clone, Debug)]
struct DiskFile {
    disk: Arc<Mutex<Disk>>,
    which: usize,
}

impl LogFile for DiskFile {
    fn write_at(&mut self, bytes: &[u8], at: u64) -> io::Result<usize> {
        let mut disk = self.disk.lock().unwrap();
        let now = disk.call()?;
        let halves = matches!(
            now,
            Some((Kind::Short | Kind::FailsHalfway(_) | Kind::PowerCut, _))
        );
        let n = if halves {
            bytes.len().div_ceil(2)
        } else {
            bytes.len()
        };
        let file = &mut disk.files[self.which].cached;
        let at = at as usize;
        file.resize(file.len().max(at + n), 0);
        file[at..at + n].copy_from_slice(&bytes[..n]);
        disk.called(now)?;
        Ok(n)
    }

    fn sync(&mut self) -> io::Result<()> {
        let mut disk = self.disk.lock().unwrap();
        let now = disk.call()?;
        if !matches!(now, Some((Kind::PowerCut, _))) {
            let file = &mut disk.files[self.which];
            file.synced.clone_from(&file.cached);
        }
        disk.called(now)
    }

    fn cut(&mut self, length: u64) -> io::Result<()> {
        let mut disk = self.disk.lock().unwrap();
        let now = disk.call()?;
        disk.files[self.which].cached.resize(length as usize, 0);
        disk.called(now)
    }

    fn length(&mut self) -> io::Result<u64> {
        let mut disk = self.disk.lock().unwrap();
        let now = disk.call()?;
        let length = disk.files[self.which].cached.len() as u64;
        disk.called(now)?;
        Ok(length)
    }
}

/// How a program ended.
#[derive(Debug)]
enum Ended {
    /// With its reason in the journal.
    Said(SessionEnd),
    /// With an error that its caller prints, since the disk does not take the reason.
    Told,
    /// It was killed.
    Dead,
}

/// Endings, counted.
#[derive(Debug, Default)]
struct Counts {
    endings: u64,
    said: u64,
    told: u64,
    dead: u64,
    discarded: u64,
}

/// A session, its lamp and its disk.
struct World {
    disk: Arc<Mutex<Disk>>,
    chance: Chance,
    /// Frames that were exposed.
    now: u64,
    /// Times at which the lamp is a tenth darker.
    dark: Vec<Range<u64>>,
    /// The state of the running session after each line that it wrote.
    states: Vec<SessionState>,
    counts: Counts,
    is_eventful: bool,
}

impl World {
    fn new(seed: u64, is_eventful: bool) -> Self {
        let mut chance = Chance::of(seed);
        // Long enough that a control pose falls into each.
        let mut dark = Vec::new();
        let mut at = 3 + chance.below(10);
        for _ in 0..chance.below(4) {
            let end = at + CONTROL_EVERY as u64 + 2 + chance.below(8);
            dark.push(at..end);
            at = end + 1 + chance.below(15);
        }
        let disk = Disk {
            files: Default::default(),
            calls: 0,
            trouble: None,
            is_dead: false,
            chance: Chance::of(seed ^ 0x5555),
        };
        Self {
            disk: Arc::new(Mutex::new(disk)),
            chance,
            now: 0,
            dark,
            states: vec![SessionState::new(POSES, DRIFT_LIMIT)],
            counts: Counts::default(),
            is_eventful,
        }
    }

    fn disk(&self) -> MutexGuard<'_, Disk> {
        self.disk.lock().unwrap()
    }

    fn happens(&mut self, one_in: u64) -> bool {
        self.is_eventful && self.chance.below(one_in) == 0
    }

    /// A frame as it is exposed now. The first one of a role says how bright the lamp is to be: that it
    /// was another before nobody can know.
    fn expose(&mut self, role: Role, index: usize, is_first: bool) -> SampledFrame {
        let now = self.now;
        self.dark
            .retain(|times| !(is_first && times.contains(&now)));
        let is_dark = self.dark.iter().any(|times| times.contains(&self.now));
        let mut frame = some_frame(index as u32, role);
        let value = if is_dark { 0.9 } else { 1.0 };
        for point in frame.points.iter_mut().flatten() {
            point.rgb = [value; 3];
        }
        frame
    }

    /// The frame of a pose, from the disk.
    fn frame(&self, pose: &PoseDone) -> SampledFrame {
        let disk = self.disk();
        let end = (pose.at + pose.bytes) as usize;
        let bytes = &disk.files[1].cached[pose.at as usize..end];
        assert_eq!(crc32c(bytes), pose.crc);
        let frame = sampled_bytes::from_bytes(bytes).unwrap();
        assert_eq!(frame.report.frame as usize, pose.index);
        assert_eq!(frame.report.role, pose.role);
        frame
    }

    /// What the journal on the disk gives, after each of its lines.
    fn replayed(&self) -> (journal::Lines, Vec<SessionState>) {
        let bytes = self.disk().files[0].cached.clone();
        let lines = journal::lines_of(Path::new(JOURNAL), &bytes).unwrap();
        let mut states = vec![SessionState::new(POSES, DRIFT_LIMIT)];
        for entry in &lines.entries {
            let mut state = states.last().unwrap().clone();
            state.apply(entry).unwrap();
            states.push(state);
        }
        (lines, states)
    }

    fn write(&mut self, writer: &mut SessionWriter, entry: &Entry) -> Result<(), FileError> {
        writer.note(entry)?;
        self.states.push(writer.state().clone());
        Ok(())
    }

    /// A program takes the session up, with a trouble on its way, until it ends. Then what is on the disk
    /// is looked at.
    fn program(&mut self, trouble: Option<Trouble>) -> Ended {
        {
            let mut disk = self.disk();
            (disk.calls, disk.trouble, disk.is_dead) = (0, trouble, false);
        }
        let (lines, states) = self.replayed();
        self.states = states;
        let files = [0, 1].map(|which| {
            let disk = Arc::clone(&self.disk);
            Box::new(DiskFile { disk, which }) as Box<dyn LogFile>
        });
        let state = self.states.last().unwrap().clone();
        let on_disk = journal::lines_of(Path::new(JOURNAL), &self.disk().files[0].synced);
        let on_disk = on_disk.unwrap().entries.len();
        let opened = SessionWriter::over(Path::new(""), files.into(), &lines, state);
        if opened.is_err() {
            // What a killed program has not synced nobody has vouched for, until the next one has opened it.
            self.states.truncate(on_disk + 1);
        }
        let run = opened.and_then(|mut writer| {
            let run = self.run(&mut writer);
            if self.disk().is_dead {
                return Ok(SessionEnd::Failed);
            }
            let (end, why) = run.unwrap_or_else(|why| (SessionEnd::Failed, why));
            self.write(&mut writer, &Entry::Stop(end, why))?;
            Ok(end)
        });
        let is_dead = self.disk().is_dead;
        let ended = match run {
            _ if is_dead => Ended::Dead,
            Ok(end) => Ended::Said(end),
            Err(_) => Ended::Told,
        };
        self.check(&ended);
        ended
    }

    /// The whole of a program. An error is the reason why it fails.
    fn run(&mut self, writer: &mut SessionWriter) -> Result<(SessionEnd, String), String> {
        let said = |error: FileError| error.to_string();
        self.write(writer, &Entry::Start("simulated".into()))
            .map_err(said)?;
        for role in ROLES {
            if writer.state().is_complete(role) {
                continue;
            }
            let state = writer.state();
            let is_new = state.role(role).baseline().is_none();
            if role == Role::Material && is_new && !state.has_awaited_material() {
                return Ok((SessionEnd::AwaitsMaterial, CHANGE_THE_SAMPLE.into()));
            }
            if let Some(paused) = self.run_role(writer, role)? {
                return Ok(paused);
            }
            if !writer.state().missing(role).is_empty() {
                return Err("poses were given up".into());
            }
        }
        Ok((SessionEnd::Finished, "every pose is done".into()))
    }

    fn run_role(
        &mut self,
        writer: &mut SessionWriter,
        role: Role,
    ) -> Result<Option<(SessionEnd, String)>, String> {
        let said = |error: FileError| error.to_string();
        let mut queue: VecDeque<(usize, u32)> = writer
            .state()
            .to_measure(role)
            .into_iter()
            .map(|index| (index, 0))
            .collect();
        loop {
            if self.happens(40) {
                return Ok(Some((SessionEnd::Paused, "by Ctrl-C".into())));
            }
            if self.happens(30) {
                self.write(writer, &Entry::Pause("held by hand".into()))
                    .map_err(said)?;
            }
            if self.happens(20) {
                // As a session does: what is no part of its state need not be written.
                let _ = self.write(writer, &Entry::Event("of no matter".into()));
            }
            let state = writer.state().role(role);
            match next_step(state, CONTROL_EVERY, queue.is_empty(), false) {
                Step::Done => return Ok(None),
                Step::Settle => unreachable!("nothing is ever under way"),
                Step::Control(index) => self.control(writer, role, index, &mut queue)?,
                Step::Pose => {
                    let (index, tries) = queue.pop_front().unwrap();
                    let is_first = writer.state().role(role).baseline().is_none();
                    if self.happens(50) {
                        let given_up = GivenUp {
                            role,
                            index,
                            why: "not reached".into(),
                            is_left_out: false,
                        };
                        self.write(writer, &Entry::GivenUp(given_up))
                            .map_err(said)?;
                        continue;
                    }
                    let frame = self.expose(role, index, is_first);
                    match writer.keep(&frame, 0.001) {
                        Ok(done) => {
                            self.states.push(writer.state().clone());
                            assert_eq!(self.frame(&done), frame);
                            self.now += 1;
                        }
                        Err(error) if tries >= RETRIES => return Err(error.to_string()),
                        Err(_) => queue.push_front((index, tries + 1)),
                    }
                }
            }
            if self.disk().is_dead {
                return Err("killed".into());
            }
        }
    }

    fn control(
        &mut self,
        writer: &mut SessionWriter,
        role: Role,
        index: usize,
        queue: &mut VecDeque<(usize, u32)>,
    ) -> Result<(), String> {
        let state = writer.state().role(role);
        let first = self.frame(state.baseline().unwrap());
        let mut frame = self.expose(role, index, false);
        if self.happens(10) {
            frame.report.outcome =
                Outcome::FellBack(RegistrationFailure::LinesMissing { found: 0 });
        }
        let comparison = (frame.report.outcome == Outcome::Locked)
            .then(|| ControlComparison::of(&first, &frame))
            .flatten();
        let control = judged(state, (role, index), comparison, DRIFT_LIMIT);
        let before = state.doubtful();
        self.write(writer, &Entry::Control(control))
            .map_err(|error| error.to_string())?;
        // One that shows nothing, or that no journal has, takes no time: the lamp could come back in just
        // that moment, and no session could know.
        self.now += u64::from(comparison.is_some());
        let state = writer.state().role(role);
        let after = after_control(state, RETRIES);
        if after != AfterControl::GoOn && state.doubtful().is_empty() {
            self.counts.discarded += before.len() as u64;
            for index in before.into_iter().rev() {
                queue.push_front((index, 0));
            }
        }
        match after {
            AfterControl::GoOn | AfterControl::TakeAgain | AfterControl::Wait => Ok(()),
            AfterControl::LampStays | AfterControl::Moved => Err(format!("{after:?}")),
        }
    }

    /// What is on the disk after a program.
    fn check(&mut self, ended: &Ended) {
        self.counts.endings += 1;
        let (lines, states) = self.replayed();
        // Every line that was acknowledged is there. Of a program that was killed, or could not cut it
        // off any more, one more may be.
        let known = self.states.len();
        assert!(
            states.len() == known || states.len() == known + 1,
            "{} lines of {known}, {ended:?}",
            states.len()
        );
        assert_eq!(states[..known], self.states[..]);
        match ended {
            Ended::Said(_) => {
                self.counts.said += 1;
                assert_eq!(states.len(), known);
                assert!(matches!(lines.entries.last(), Some(Entry::Stop(..))));
            }
            Ended::Told => self.counts.told += 1,
            Ended::Dead => self.counts.dead += 1,
        }
        let state = states.last().unwrap();
        for role in ROLES {
            let state = state.role(role);
            let doubtful = state.doubtful();
            for pose in state.done() {
                let frame = self.frame(pose);
                if doubtful.contains(&pose.index) {
                    continue;
                }
                assert!(
                    is_bright(&frame),
                    "{role:?} {} is wrong: {:#?}",
                    pose.index,
                    lines
                        .entries
                        .iter()
                        .map(Entry::to_string)
                        .collect::<Vec<_>>()
                );
            }
        }
    }

    /// Programs without trouble until the session is finished.
    fn finish(&mut self) {
        for _ in 0..200 {
            if let Ended::Said(SessionEnd::Finished) = self.program(None) {
                let (_, states) = self.replayed();
                let state = states.last().unwrap();
                for role in ROLES {
                    let state = state.role(role);
                    assert_eq!(state.done().count(), POSES);
                    assert_eq!(state.doubtful(), [0usize; 0]);
                    assert!(state.done().all(|pose| is_bright(&self.frame(pose))));
                }
                return;
            }
        }
        panic!("the session does not finish");
    }
}

fn is_bright(frame: &SampledFrame) -> bool {
    frame.points.iter().flatten().all(|p| p.rgb == [1.0; 3])
}

impl Counts {
    fn add(&mut self, other: &Counts) {
        self.endings += other.endings;
        self.said += other.said;
        self.told += other.told;
        self.dead += other.dead;
        self.discarded += other.discarded;
    }
}

/// Programs by chance, each with a trouble, and then the rest of the session in peace.
fn by_chance(seed: u64) -> Counts {
    let mut world = World::new(seed, true);
    for _ in 0..3 + world.chance.below(6) {
        let start = world.chance.below(120);
        let calls = start..start + 1 + world.chance.below(14);
        let kind = KINDS[world.chance.below(KINDS.len() as u64) as usize];
        world.program(Some(Trouble { calls, kind }));
    }
    world.finish();
    world.counts
}

/// The same session with every trouble at every call of the disk.
#[test]
fn whatever_fails_at_whatever_call_no_wrong_pose_is_kept_and_none_is_lost() {
    let mut counts = Counts::default();
    for kind in KINDS {
        for length in [1, 5] {
            for start in 0.. {
                let mut world = World::new(7, false);
                // The lamp goes dark in the reference, and in the material.
                world.dark = vec![5..13, 24..33];
                let calls = start..start + length;
                world.program(Some(Trouble { calls, kind }));
                let was_late = world.disk().calls <= start;
                world.program(None);
                world.finish();
                counts.add(&world.counts);
                if was_late {
                    break;
                }
            }
        }
    }
    assert!(
        counts.endings > 2000 && counts.discarded > 1000,
        "{counts:?}"
    );
    assert!(
        counts.said.min(counts.told).min(counts.dead) > 20,
        "{counts:?}"
    );
}

#[test]
fn a_replayed_journal_gives_the_running_state_at_every_line() {
    let mut counts = Counts::default();
    for seed in 0..150 {
        counts.add(&by_chance(seed));
    }
    assert!(
        counts.endings > 1000 && counts.discarded > 100,
        "{counts:?}"
    );
}

/// `cargo test -p gonia-acquire --lib simulation -- --ignored --nocapture`
#[test]
#[ignore = "a soak: a hundred thousand endings"]
fn a_hundred_thousand_endings() {
    let mut counts = Counts::default();
    for seed in 1_000.. {
        counts.add(&by_chance(seed));
        if counts.endings >= 100_000 {
            break;
        }
    }
    println!("{counts:?}");
}

/// The frames' file has its name in errors only.
#[test]
fn a_journal_that_speaks_of_more_frames_than_there_are_is_refused() {
    let mut world = World::new(1, false);
    world.program(None);
    world.disk().files[1].cached.truncate(10);
    let (lines, states) = world.replayed();
    world.disk().trouble = None;
    let files = [0, 1].map(|which| {
        let disk = Arc::clone(&world.disk);
        Box::new(DiskFile { disk, which }) as Box<dyn LogFile>
    });
    let state = states.last().unwrap().clone();
    let error = SessionWriter::over(Path::new(""), files.into(), &lines, state).unwrap_err();
    assert!(error.to_string().contains(FRAMES), "{error}");
}
