//! The controller of one arm, as the host knows it.

use std::collections::VecDeque;

use gonia_protocol::fault::FaultCode;
use gonia_protocol::link::{IncomingPacket, NextAction, Requester, RetryPolicy};
use gonia_protocol::message::{
    Completed, Faulted, Hello, Identity, Latch, LogEntry, Message, Move, RequestRefusal, Setting,
    SettingName, Status, Telemetry, TriggerRequest,
};
use gonia_protocol::packet::{Decoder, encode};
use gonia_protocol::settings::{Axis, Key};
use gonia_protocol::{NODE_ANY, NODE_CAMERA, NODE_LIGHT, PROTOCOL_VERSION, SCHEMA_KEY};

use gonia_rig::Remark;

use crate::link::{LinkError, Transport};

/// The host watchdog is restarted this often while something is waited for, µs: an eighth of its default,
/// since on a bad wire one packet in ten may be lost.
pub const HEARTBEAT_US: u64 = 250_000;
/// After so long without a packet the host requests the status: an event may be lost.
const ASK_AFTER_US: u64 = 2_000_000;
/// Captured pulses that are kept until they are read.
const MAX_LATCHES: usize = 64;
/// Ends that are kept until they are claimed. Nobody waits for more than a move and a trigger at a time;
/// those of requests that were given up would otherwise live until their number comes again.
const MAX_COMPLETED: usize = 32;
/// Warnings that are kept until somebody takes them.
const MAX_WARNINGS: usize = 32;
/// Bytes that are kept of what comes first from the other end.
const MAX_HEARD: usize = 256;

/// A request that was accepted; an event will say when it has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticket {
    request: u16,
    what: &'static str,
}

/// The controller of one arm, behind a transport.
pub struct RemoteController {
    arm: String,
    transport: Box<dyn Transport>,
    session: u32,
    link: Requester,
    decoder: Decoder,
    incoming: Vec<u8>,
    identity: Identity,
    completed: VecDeque<Completed>,
    latches: VecDeque<Latch>,
    telemetry: Option<Telemetry>,
    last_event: Option<u32>,
    events_lost: u32,
    /// Warnings that nobody has taken yet.
    warnings: Vec<(FaultCode, Option<Axis>)>,
    heard_us: u64,
    asked_us: u64,
    heartbeat_us: u64,
    /// The first request, and the first bytes that came after it: they tell who else is at the other end.
    greeting: Vec<u8>,
    heard: Vec<u8>,
}

impl RemoteController {
    /// Says hello and checks that both speak the same protocol. `node` is the controller's address, or
    /// [`NODE_ANY`] for whichever is at the other end.
    ///
    /// # Errors
    /// No answer, or another protocol.
    pub fn connect(transport: Box<dyn Transport>, node: u8) -> Result<Self, LinkError> {
        let controller = Self::connect_for_service(transport, node)?;
        controller.check_version()?;
        Ok(controller)
    }

    /// Says hello, also to firmware of another protocol. Requests that such firmware may not answer are
    /// then refused here: identity, status, log and stops are left.
    ///
    /// # Errors
    /// No answer.
    pub fn connect_for_service(transport: Box<dyn Transport>, node: u8) -> Result<Self, LinkError> {
        Self::greet(transport, node, name_of(node))
    }

    /// As [`Self::connect`], with whichever controller is at the other end. Until it has said which arm it
    /// is, errors call it by `name`.
    ///
    /// # Errors
    /// No answer, or another protocol.
    pub fn connect_any(transport: Box<dyn Transport>, name: &str) -> Result<Self, LinkError> {
        let controller = Self::greet(transport, NODE_ANY, name)?;
        controller.check_version()?;
        Ok(controller)
    }

    fn greet(transport: Box<dyn Transport>, node: u8, name: &str) -> Result<Self, LinkError> {
        let now_us = transport.now_us();
        let mut controller = Self {
            arm: name.to_owned(),
            transport,
            // A number that the controller has not heard: the µs at which this session began.
            session: now_us as u32,
            link: Requester::new(node, 0, RetryPolicy::default()),
            decoder: Decoder::new(),
            incoming: Vec::new(),
            identity: no_identity(),
            completed: VecDeque::new(),
            latches: VecDeque::new(),
            telemetry: None,
            last_event: None,
            events_lost: 0,
            warnings: Vec::new(),
            heard_us: now_us,
            asked_us: now_us,
            heartbeat_us: now_us,
            greeting: Vec::new(),
            heard: Vec::new(),
        };
        match controller.hello() {
            Ok(()) => Ok(controller),
            Err(error) => Err(controller.who_answers(error)),
        }
    }

    /// Says hello again, after the controller restarted or the cable was out. Returns whether it
    /// has restarted since the last time.
    ///
    /// # Errors
    /// No answer, or another protocol.
    pub fn reconnect(&mut self) -> Result<bool, LinkError> {
        let before = self.identity.boot_id;
        self.hello()?;
        self.check_version()?;
        Ok(self.identity.boot_id != before)
    }

    /// Its board, firmware, settings' checksum and last start.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Its address on the wire.
    pub fn node(&self) -> u8 {
        self.link.node()
    }

    /// Its name: light arm, camera arm, or controller where its address is not known.
    pub fn name(&self) -> &str {
        &self.arm
    }

    /// Now, by the transport's clock, µs.
    pub fn now_us(&self) -> u64 {
        self.transport.now_us()
    }

    /// Events that never arrived, and requests that had to be repeated, so far.
    pub fn losses(&self) -> (u32, u32) {
        (self.events_lost, self.link.repeats())
    }

    /// What the controller has warned of since the last call: the arm goes on, and a person should know.
    pub fn take_remarks(&mut self) -> Vec<Remark> {
        let warnings = std::mem::take(&mut self.warnings);
        let remarks = warnings.into_iter().map(|(code, axis)| {
            let axis = match axis {
                Some(Axis::Theta) => ", θ",
                Some(Axis::Phi) => ", φ",
                None => "",
            };
            let place = format!("{}{axis}", self.arm);
            let (symptom, cure) = code.page().map_or(
                ("a warning that this host does not know", "update the host"),
                |page| (page.symptom, page.cure),
            );
            Remark::new(place, format_args!("{symptom} (code {})", code.0), cure)
        });
        remarks.collect()
    }

    /// The newest telemetry; `None` before the first.
    pub fn telemetry(&self) -> Option<&Telemetry> {
        self.telemetry.as_ref()
    }

    /// Its state and where its axes are.
    pub fn status(&mut self) -> Result<Status, LinkError> {
        match self.ask(&Message::GetStatus, "status")?.1 {
            Message::Status(status) => Ok(status),
            _ => Err(self.confused("status")),
        }
    }

    /// Homes both axes.
    pub fn home(&mut self) -> Result<Ticket, LinkError> {
        self.begin(&Message::Home, "homing")
    }

    /// Moves both axes to absolute angles, µdeg.
    pub fn move_to(&mut self, target_udeg: [i32; 2]) -> Result<Ticket, LinkError> {
        self.begin(&Message::Move(Move { target_udeg }), "a move")
    }

    /// Requests a trigger train, which [`Self::fire`] starts. The ticket ends only on a follower: when it
    /// has captured the last pulse. What was captured in earlier trains is discarded.
    pub fn request_trigger(&mut self, request: TriggerRequest) -> Result<Ticket, LinkError> {
        self.latches.clear();
        self.begin(&Message::RequestTrigger(request), "the trigger request")
    }

    /// Starts the train that was requested; the ticket ends with its last pulse.
    pub fn fire(&mut self) -> Result<Ticket, LinkError> {
        self.begin(&Message::Fire, "the trigger")
    }

    /// Withdraws the trigger request.
    pub fn disarm(&mut self) -> Result<(), LinkError> {
        self.begin(&Message::Disarm, "withdrawing the trigger request")
            .map(drop)
    }

    /// Decelerates and stops.
    pub fn stop(&mut self) -> Result<(), LinkError> {
        self.begin(&Message::Stop, "a stop").map(drop)
    }

    /// Stops at once, and stays stopped until the fault is cleared; the other controller stops too.
    pub fn emergency_stop(&mut self) -> Result<(), LinkError> {
        self.begin(&Message::EStop, "an emergency stop").map(drop)
    }

    /// Leaves a latched fault, if its cause is gone.
    pub fn clear_fault(&mut self) -> Result<(), LinkError> {
        self.begin(&Message::ClearFault, "clearing the fault")
            .map(drop)
    }

    /// What was captured at a pulse of the last train, counted from 0: from its event, or requested where
    /// that was lost.
    pub fn latch(&mut self, pulse: u8) -> Result<Latch, LinkError> {
        if let Some(latch) = self.latches.iter().find(|latch| latch.pulse == pulse) {
            return Ok(latch.clone());
        }
        match self.ask(&Message::ReadLatch(pulse), "a captured pulse")?.1 {
            Message::LatchIs(latch) => Ok(latch),
            _ => Err(self.confused("a captured pulse")),
        }
    }

    /// The value of a setting.
    pub fn setting(&mut self, axis: Axis, key: Key) -> Result<i32, LinkError> {
        let name = SettingName {
            axis,
            key: key.number(),
        };
        match self.ask(&Message::GetSetting(name), "a setting")?.1 {
            Message::SettingIs(setting) => Ok(setting.value),
            _ => Err(self.confused("a setting")),
        }
    }

    /// Changes a setting until the next reset.
    pub fn set_setting(&mut self, axis: Axis, key: Key, value: i32) -> Result<(), LinkError> {
        let key = key.number();
        self.ask(
            &Message::SetSetting(Setting { axis, key, value }),
            "a setting",
        )?;
        Ok(())
    }

    /// Writes the settings to the board's memory.
    pub fn save_settings(&mut self) -> Result<(), LinkError> {
        self.begin(&Message::SaveSettings, "saving the settings")
            .map(drop)
    }

    /// The faults and warnings that the controller remembers since it started, newest first.
    pub fn log(&mut self) -> Result<Vec<LogEntry>, LinkError> {
        let mut entries = Vec::new();
        for back in 0..=u8::MAX {
            match self.ask(&Message::ReadLog(back), "its log")?.1 {
                Message::LogIs(entry) if entry.fault.is_none() => break,
                Message::LogIs(entry) => entries.push(entry),
                _ => return Err(self.confused("its log")),
            }
        }
        Ok(entries)
    }

    /// Waits at most `timeout_us` for a request to end; `None` if it has not. Restarts the host watchdog.
    pub fn poll(
        &mut self,
        ticket: Ticket,
        timeout_us: u64,
    ) -> Result<Option<Completed>, LinkError> {
        let deadline_us = self.now_us() + timeout_us;
        loop {
            self.keep_alive()?;
            if let Some(at) = self
                .completed
                .iter()
                .position(|c| c.request == ticket.request)
            {
                return Ok(self.completed.remove(at));
            }
            let now_us = self.now_us();
            if now_us >= deadline_us {
                return Ok(None);
            }
            if now_us >= self.heard_us.max(self.asked_us) + ASK_AFTER_US {
                self.ask_whether_ended(ticket)?;
                continue;
            }
            let wait_us = (deadline_us - now_us).min(HEARTBEAT_US);
            self.listen(wait_us, None)?;
        }
    }

    /// Waits until a request has ended, at most `limit_us`.
    pub fn wait(&mut self, ticket: Ticket, limit_us: u64) -> Result<Completed, LinkError> {
        match self.poll(ticket, limit_us)? {
            Some(completed) => Ok(completed),
            None => self.must_have_ended(ticket, limit_us),
        }
    }

    /// After waiting for so long without an end: requests the status, for the event may be lost.
    pub fn must_have_ended(
        &mut self,
        ticket: Ticket,
        limit_us: u64,
    ) -> Result<Completed, LinkError> {
        self.ask_whether_ended(ticket)?;
        self.poll(ticket, 0)?.ok_or(LinkError::Endless {
            arm: self.arm.clone(),
            what: ticket.what,
            limit_s: limit_us as f64 * 1e-6,
        })
    }

    /// Lets time pass, and reads what arrives.
    pub fn rest(&mut self, for_us: u64) -> Result<(), LinkError> {
        let until_us = self.now_us() + for_us;
        loop {
            // Read once: the clock goes on between two looks at it.
            let wait_us = until_us.saturating_sub(self.now_us());
            if wait_us == 0 {
                return Ok(());
            }
            self.listen(wait_us, None)?;
        }
    }

    /// Restarts the host watchdog, if it is due.
    pub fn keep_alive(&mut self) -> Result<(), LinkError> {
        let now_us = self.now_us();
        if now_us >= self.heartbeat_us + HEARTBEAT_US {
            self.heartbeat_us = now_us;
            // Without a body no message is too long.
            if let Ok(packet) = encode(self.link.node(), 0, &Message::Heartbeat) {
                self.send(&packet)?;
            }
        }
        Ok(())
    }

    // ---- requests ----

    fn hello(&mut self) -> Result<(), LinkError> {
        let hello = Message::Hello(Hello {
            session: self.session,
        });
        self.last_event = None;
        self.completed.clear();
        let (_, answer) = self.ask(&hello, "hello")?;
        let Message::Identity(identity) = answer else {
            return Err(self.confused("hello"));
        };
        self.identity = identity;
        Ok(())
    }

    /// What is at the other end, where it is no controller.
    fn who_answers(&self, error: LinkError) -> LinkError {
        let is_no_hello = matches!(
            error,
            LinkError::NoAnswer { .. } | LinkError::Confused { .. }
        );
        if !is_no_hello || self.heard.is_empty() {
            return error;
        }
        let arm = self.arm.clone();
        let length = self.greeting.len();
        let is_echo = length > 0 && self.heard.windows(length).any(|some| some == self.greeting);
        if is_echo {
            return LinkError::Echo { arm };
        }
        LinkError::Foreign {
            arm,
            said: readable(&self.heard),
        }
    }

    /// Whether both speak the same protocol.
    ///
    /// # Errors
    /// [`LinkError::Version`]: only identity, status, log and stops are left.
    pub fn check_version(&self) -> Result<(), LinkError> {
        let identity = &self.identity;
        let speaks = identity.protocol_min..=identity.protocol_max;
        if !speaks.contains(&PROTOCOL_VERSION) || identity.schema_key != SCHEMA_KEY {
            let [major, minor, patch] = identity.firmware;
            return Err(LinkError::Version {
                arm: self.arm.clone(),
                firmware: format!("{major}.{minor}.{patch} ({})", identity.git),
                theirs: format!(
                    "{}-{} schema {:08x}",
                    speaks.start(),
                    speaks.end(),
                    identity.schema_key
                ),
                ours: format!("{PROTOCOL_VERSION} schema {SCHEMA_KEY:08x}"),
            });
        }
        Ok(())
    }

    fn begin(&mut self, message: &Message, what: &'static str) -> Result<Ticket, LinkError> {
        match self.ask(message, what)? {
            (request, Message::Accepted) => Ok(Ticket { request, what }),
            _ => Err(self.confused(what)),
        }
    }

    /// Sends a request and waits for its answer, repeating it as often as its timeouts allow.
    fn ask(&mut self, message: &Message, what: &'static str) -> Result<(u16, Message), LinkError> {
        if !Message::is_always_answered(message.kind()) {
            self.check_version()?;
        }
        let now_us = self.now_us();
        let Ok((id, packet)) = self.link.begin(message, now_us) else {
            return Err(self.confused(what));
        };
        let packet = packet.to_vec();
        self.send(&packet)?;
        if self.greeting.is_empty() {
            self.greeting.clone_from(&packet);
        }
        // Any request restarts the host watchdog.
        self.heartbeat_us = now_us;
        loop {
            let now_us = self.now_us();
            let wait_us = match self.link.poll(now_us) {
                NextAction::WaitUntil(due_us) => due_us.saturating_sub(now_us),
                NextAction::Repeat(packet) => {
                    let packet = packet.to_vec();
                    // The zero ends whatever a fault has left open at the other end.
                    self.send(&[0])?;
                    self.send(&packet)?;
                    continue;
                }
                NextAction::Nothing | NextAction::GiveUp => {
                    return Err(LinkError::NoAnswer {
                        arm: self.arm.clone(),
                        what,
                    });
                }
            };
            match self.listen(wait_us, Some(id))? {
                None => {}
                Some(Message::Refused(refusal)) => return Err(self.refused(what, refusal)),
                Some(answer) => return Ok((id, answer)),
            }
        }
    }

    fn ask_whether_ended(&mut self, ticket: Ticket) -> Result<(), LinkError> {
        let status = self.status()?;
        self.asked_us = self.now_us();
        let known = self.completed.iter().any(|c| c.request == ticket.request);
        if let Some((request, outcome)) = status.last
            && request == ticket.request
            && !known
        {
            self.keep_completed(Completed {
                seq: 0,
                request,
                outcome,
                encoder_udeg: [0, 1].map(|i| status.axes[i].encoder_udeg),
                corrections: [0; 2],
            });
        }
        Ok(())
    }

    // ---- bytes ----

    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        self.transport
            .send(bytes)
            .map_err(|source| LinkError::Port {
                arm: self.arm.clone(),
                source,
            })
    }

    /// Reads what arrives; returns the answer to request `id` if it is among it.
    fn listen(&mut self, timeout_us: u64, id: Option<u16>) -> Result<Option<Message>, LinkError> {
        let mut bytes = std::mem::take(&mut self.incoming);
        bytes.clear();
        let received = self.transport.receive(&mut bytes, timeout_us);
        let room = MAX_HEARD.saturating_sub(self.heard.len());
        self.heard.extend(bytes.iter().take(room));
        let mut answer = None;
        for &byte in &bytes {
            let Some(packet) = self.decoder.push(byte) else {
                continue;
            };
            self.heard_us = self.transport.now_us();
            let role = self.link.sort(&packet.header);
            match (role, packet.message) {
                (IncomingPacket::Event, Ok(event)) => self.take_event(event),
                (IncomingPacket::Answer, message) if id == Some(packet.header.request) => {
                    if self.link.node() == NODE_ANY {
                        self.link.set_node(packet.header.node);
                        self.arm = name_of(packet.header.node).to_owned();
                    }
                    // A body that cannot be read is an answer too: not the one that was asked for.
                    answer =
                        Some(message.unwrap_or(Message::Refused(RequestRefusal::NotUnderstood)));
                }
                _ => {}
            }
        }
        self.incoming = bytes;
        match received {
            Ok(()) => Ok(answer),
            Err(source) => Err(LinkError::Port {
                arm: self.arm.clone(),
                source,
            }),
        }
    }

    fn take_event(&mut self, event: Message) {
        let seq = match &event {
            Message::Completed(completed) => completed.seq,
            Message::Faulted(faulted) => faulted.seq,
            Message::Telemetry(telemetry) => telemetry.seq,
            Message::Pulse(latch) => latch.seq,
            _ => return,
        };
        let gap = self
            .last_event
            .map_or(0, |last| seq.wrapping_sub(last).wrapping_sub(1));
        // A number from before the last one: the controller has restarted, and counts anew.
        let gap = if gap > u32::MAX / 2 { 0 } else { gap };
        self.events_lost = self.events_lost.saturating_add(gap);
        self.last_event = Some(seq);
        match event {
            Message::Completed(completed) => self.keep_completed(completed),
            Message::Telemetry(telemetry) => self.telemetry = Some(telemetry),
            Message::Pulse(latch) if self.latches.len() < MAX_LATCHES => {
                self.latches.push_back(latch)
            }
            Message::Faulted(Faulted { code, axis, .. })
                if code.is_warning() && self.warnings.len() < MAX_WARNINGS =>
            {
                self.warnings.push((code, axis));
            }
            // A fault ends whatever was under way, and that says which fault it was.
            _ => {}
        }
    }

    fn keep_completed(&mut self, completed: Completed) {
        // One of the same number is of a request long ago.
        self.completed.retain(|c| c.request != completed.request);
        if self.completed.len() >= MAX_COMPLETED {
            self.completed.pop_front();
        }
        self.completed.push_back(completed);
    }

    fn confused(&self, what: &'static str) -> LinkError {
        LinkError::Confused {
            arm: self.arm.clone(),
            what,
        }
    }

    fn refused(&self, what: &'static str, refusal: RequestRefusal) -> LinkError {
        LinkError::Refused {
            arm: self.arm.clone(),
            what,
            refusal,
        }
    }
}

/// The first words of some bytes, for a person.
fn readable(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let shown = |c: char| if c.is_control() { ' ' } else { c };
    let words: String = text.chars().map(shown).collect();
    let line = words.split_whitespace().collect::<Vec<_>>().join(" ");
    line.chars().take(40).collect()
}

fn name_of(node: u8) -> &'static str {
    match node {
        NODE_LIGHT => "light arm",
        NODE_CAMERA => "camera arm",
        _ => "controller",
    }
}

/// Until the first hello is answered.
fn no_identity() -> Identity {
    Identity {
        protocol_min: 0,
        protocol_max: 0,
        schema_key: 0,
        firmware: [0; 3],
        git: Default::default(),
        board: Default::default(),
        config_crc: 0,
        boot_id: 0,
        reset: gonia_protocol::message::ResetReason::Unknown,
        last_panic: Default::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    /// What may be at a port that is not a controller's.
    struct Other {
        says: fn(&[u8]) -> Vec<u8>,
        pending: Vec<u8>,
        now_us: u64,
    }

    impl Transport for Other {
        fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.pending.extend((self.says)(bytes));
            Ok(())
        }

        fn receive(&mut self, out: &mut Vec<u8>, timeout_us: u64) -> io::Result<()> {
            self.now_us += timeout_us.max(1);
            out.append(&mut self.pending);
            Ok(())
        }

        fn now_us(&self) -> u64 {
            self.now_us
        }
    }

    #[test]
    fn silence_an_echo_and_another_device_have_each_their_own_sentence() {
        let silence: fn(&[u8]) -> Vec<u8> = |_| Vec::new();
        let echo: fn(&[u8]) -> Vec<u8> = <[u8]>::to_vec;
        let printer: fn(&[u8]) -> Vec<u8> = |_| b"start\r\nMarlin 2.1.2\r\n".to_vec();
        let noise: fn(&[u8]) -> Vec<u8> = |_| vec![0xfe, 0x80, 0x00, 0x37];
        for (says, expected) in [
            (
                silence,
                "light arm: no answer to hello; check power, cable and port",
            ),
            (echo, "light arm: what is sent comes back: an echo"),
            (
                printer,
                "light arm: something else answers (\"start Marlin 2.1.2",
            ),
            (noise, "and its baud rate"),
        ] {
            let other = Other {
                says,
                pending: Vec::new(),
                now_us: 0,
            };
            let error = RemoteController::connect_any(Box::new(other), "light arm");
            let error = error.err().unwrap().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn ends_that_nobody_claims_do_not_live_for_ever() {
        let sim = gonia_sim::rig::SimRig::new(1, gonia_sim::fault::FaultPlan::default());
        let port = sim.port(gonia_sim::fault::Arm::Light);
        let mut arm = RemoteController::connect_any(Box::new(port), "light arm").unwrap();
        for request in 0..u16::MAX {
            arm.keep_completed(Completed {
                seq: 0,
                request: request % 1000,
                outcome: gonia_protocol::message::RequestOutcome::Done,
                encoder_udeg: [0; 2],
                corrections: [0; 2],
            });
        }
        assert_eq!(arm.completed.len(), MAX_COMPLETED);
        // The newest stay.
        let last = (u16::MAX - 1) % 1000;
        assert!(arm.completed.iter().any(|c| c.request == last));
    }
}
