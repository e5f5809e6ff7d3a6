//! The wire's end of a controller: bytes to requests, answers and events to frames.

use gonia_protocol::frame::{Decoder, FrameBytes, Received, encode};
use gonia_protocol::link::{Arrival, Responder};
use gonia_protocol::message::{Identity, Message, Refusal, ResetReason};
use gonia_protocol::{NODE_ANY, PROTOCOL_VERSION, SCHEMA_KEY};
use heapless::Deque;

use crate::controller::Controller;
use crate::hardware::Hardware;

/// Who a controller is that has just started. Git state, versions and schema are this firmware's.
pub fn identity(board: &str, boot_id: u32, reset: ResetReason, last_panic: &str) -> Identity {
    Identity {
        protocol_min: PROTOCOL_VERSION,
        protocol_max: PROTOCOL_VERSION,
        schema_key: SCHEMA_KEY,
        firmware: crate::VERSION,
        git: crate::git_state(),
        board: cut(board),
        config_crc: 0,
        boot_id,
        reset,
        last_panic: cut(last_panic),
    }
}

/// As much of a text as fits, without what is not ASCII.
fn cut<const N: usize>(text: &str) -> heapless::String<N> {
    text.chars().filter(char::is_ascii).take(N).collect()
}

/// Frames that may wait for the wire.
const OUTBOX: usize = 12;

/// A controller with its wire.
#[derive(Debug)]
pub struct Node {
    address: u8,
    identity: Identity,
    controller: Controller,
    decoder: Decoder,
    responder: Responder,
    outbox: Deque<FrameBytes, OUTBOX>,
}

impl Node {
    /// A controller that answers to this address. The checksum of the settings in `identity` is
    /// kept up to date here.
    pub fn new(address: u8, identity: Identity, controller: Controller) -> Self {
        Self {
            address,
            identity,
            controller,
            decoder: Decoder::new(),
            responder: Responder::new(),
            outbox: Deque::new(),
        }
    }

    /// The controller behind the wire.
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// When [`Self::poll`] must be called next, µs.
    pub fn wake_us(&self) -> u64 {
        self.controller.wake_us()
    }

    /// Does whatever is due.
    pub fn poll(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        self.controller.poll(now_us, hardware);
        self.collect_events();
    }

    /// Takes one byte of the wire, and executes the request that it closes.
    pub fn receive(&mut self, byte: u8, now_us: u64, hardware: &mut impl Hardware) {
        if let Some(received) = self.decoder.push(byte) {
            self.serve(&received, now_us, hardware);
            self.collect_events();
        }
    }

    /// The other controller has raised the trigger wire.
    pub fn trigger_edge(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        self.controller.trigger_edge(now_us, hardware);
        self.collect_events();
    }

    /// The next frame for the wire.
    pub fn take_frame(&mut self) -> Option<FrameBytes> {
        self.outbox.pop_front()
    }

    fn serve(&mut self, received: &Received, now_us: u64, hardware: &mut impl Hardware) {
        let header = &received.header;
        let is_hello = matches!(received.message, Ok(Message::Hello(_)));
        let is_mine = header.node == self.address || (header.node == NODE_ANY && is_hello);
        if !is_mine || header.kind >= 0x80 {
            return;
        }
        if let Ok(Message::Heartbeat) = received.message {
            self.controller.renew_lease(now_us);
            return;
        }
        if let Ok(Message::Hello(hello)) = &received.message {
            self.responder.hello(hello.session);
        }
        match self.responder.sort(header.request) {
            Arrival::Stray => return,
            Arrival::Repeat(answer) => {
                let again = FrameBytes::from_slice(answer).unwrap_or_default();
                self.send(again);
                return;
            }
            Arrival::New => {}
        }
        let answer = self.answer(received, now_us, hardware);
        // No message of the protocol is too long for a frame.
        if let Ok(frame) = self.responder.answer(self.address, header.request, &answer) {
            let frame = FrameBytes::from_slice(frame).unwrap_or_default();
            self.send(frame);
        }
    }

    fn answer(
        &mut self,
        received: &Received,
        now_us: u64,
        hardware: &mut impl Hardware,
    ) -> Message {
        let header = &received.header;
        if !Message::is_always_answered(header.kind) {
            if header.version != PROTOCOL_VERSION {
                return Message::Refused(Refusal::Version);
            }
            if !self.responder.has_session() {
                return Message::Refused(Refusal::NoSession);
            }
        }
        let message = match &received.message {
            Ok(Message::Hello(_)) => {
                self.identity.config_crc = self.controller.settings().crc();
                return Message::Identity(self.identity.clone());
            }
            Ok(message) => message,
            Err(_) => return Message::Refused(Refusal::NotUnderstood),
        };
        match self
            .controller
            .execute(now_us, header.request, message, hardware)
        {
            Ok(Message::Status(mut status)) => {
                let counters = self.decoder.counters();
                status.frames_good = counters.good;
                status.frames_bad = counters.bad;
                Message::Status(status)
            }
            Ok(answer) => answer,
            Err(refusal) => Message::Refused(refusal),
        }
    }

    fn collect_events(&mut self) {
        while let Some(event) = self.controller.take_event() {
            if let Ok(frame) = encode(self.address, 0, &event) {
                self.send(frame);
            }
        }
    }

    /// A frame that finds no room is lost: the host repeats its request, or sees a gap in the
    /// numbers of the events.
    fn send(&mut self, frame: FrameBytes) {
        let _ = self.outbox.push_back(frame);
    }
}
