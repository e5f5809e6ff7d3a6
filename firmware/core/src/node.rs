//! The wire's end of a controller: bytes to requests, answers and events to packets.

use gonia_protocol::link::{IncomingRequest, Responder};
use gonia_protocol::message::{Identity, Message, RequestRefusal, ResetReason};
use gonia_protocol::packet::{Decoder, PacketBytes, Received, encode};
use gonia_protocol::{NODE_ANY, PROTOCOL_VERSION, SCHEMA_KEY};
use heapless::Deque;

use crate::controller::ArmController;
use crate::hardware::Hardware;

/// Identity of a controller that has just started. Git state, versions and schema are this firmware's.
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
pub struct ControllerNode {
    address: u8,
    identity: Identity,
    controller: ArmController,
    decoder: Decoder,
    responder: Responder,
    outbox: Deque<PacketBytes, OUTBOX>,
}

impl ControllerNode {
    /// A controller that answers to this address. The checksum of the settings in `identity` is
    /// kept up to date here.
    pub fn new(address: u8, identity: Identity, controller: ArmController) -> Self {
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
    pub fn controller(&self) -> &ArmController {
        &self.controller
    }

    /// When [`Self::poll`] must be called next, µs.
    pub fn wake_us(&self) -> u64 {
        self.controller.wake_us()
    }

    /// Does whatever is due.
    #[inline(never)] // Flash: apart from the state machine of the main task, code is smaller.
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

    /// The other controller raised the trigger wire at `edge_us`.
    #[inline(never)] // Flash: apart from the state machine of the main task, code is smaller.
    pub fn trigger_edge(&mut self, now_us: u64, edge_us: u64, hardware: &mut impl Hardware) {
        self.controller.trigger_edge(now_us, edge_us, hardware);
        self.collect_events();
    }

    /// The next packet for the wire.
    pub fn take_packet(&mut self) -> Option<PacketBytes> {
        self.outbox.pop_front()
    }

    #[inline(never)] // Flash: apart from the state machine of the main task, code is smaller.
    fn serve(&mut self, received: &Received, now_us: u64, hardware: &mut impl Hardware) {
        let header = &received.header;
        let is_hello = matches!(received.message, Ok(Message::Hello(_)));
        let is_mine = header.node == self.address || (header.node == NODE_ANY && is_hello);
        if !is_mine || header.kind >= 0x80 {
            return;
        }
        if let Ok(Message::Heartbeat) = received.message {
            self.controller.restart_host_watchdog(now_us);
            return;
        }
        if let Ok(Message::Hello(hello)) = &received.message {
            self.responder.hello(hello.session);
        }
        match self.responder.sort(header.request) {
            IncomingRequest::Stray => return,
            IncomingRequest::Repeat(answer) => {
                let again = PacketBytes::from_slice(answer).unwrap_or_default();
                self.send(again);
                return;
            }
            IncomingRequest::New => {}
        }
        let answer = self.answer(received, now_us, hardware);
        // No message of the protocol is too long for a packet.
        if let Ok(packet) = self.responder.answer(self.address, header.request, &answer) {
            let packet = PacketBytes::from_slice(packet).unwrap_or_default();
            self.send(packet);
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
                return Message::Refused(RequestRefusal::Version);
            }
            if !self.responder.has_session() {
                return Message::Refused(RequestRefusal::NoSession);
            }
        }
        let message = match &received.message {
            Ok(Message::Hello(_)) => {
                self.identity.config_crc = self.controller.settings().crc();
                return Message::Identity(self.identity.clone());
            }
            Ok(message) => message,
            Err(_) => return Message::Refused(RequestRefusal::NotUnderstood),
        };
        match self
            .controller
            .execute(now_us, header.request, message, hardware)
        {
            Ok(Message::Status(mut status)) => {
                let counters = self.decoder.counters();
                status.packets_good = counters.good;
                status.packets_bad = counters.bad;
                Message::Status(status)
            }
            Ok(answer) => answer,
            Err(refusal) => Message::Refused(refusal),
        }
    }

    fn collect_events(&mut self) {
        while let Some(event) = self.controller.take_event() {
            if let Ok(packet) = encode(self.address, 0, &event) {
                self.send(packet);
            }
        }
    }

    /// A packet that finds no room is lost: the host repeats its request, or sees a gap in the
    /// numbers of the events.
    fn send(&mut self, packet: PacketBytes) {
        let _ = self.outbox.push_back(packet);
    }
}
