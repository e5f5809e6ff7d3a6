//! Request ids, retransmission and exactly-once execution. No clock and no I/O: time comes in as
//! an argument, bytes go out as a return value.
//!
//! One request is under way at a time. The [`Requester`] repeats it until an answer with its id
//! comes; the [`Responder`] keeps its last answer, so that a repeat is answered and not executed
//! again. Ids rise; one that is not newer than the last is a stray that was long under way.

use crate::message::Message;
use crate::packet::{Header, PacketBytes, TooLong, encode};

/// When a requester repeats and gives up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RetryPolicy {
    /// Time to the first repeat, µs.
    pub retry_us: u64,
    /// Sends of one request, the first included.
    pub tries: u32,
}

impl Default for RetryPolicy {
    /// 50 ms and 20 tries: a packet takes 3 ms at 921,600 baud, and after a second
    /// nobody is there.
    fn default() -> Self {
        Self {
            retry_us: 50_000,
            tries: 20,
        }
    }
}

/// How many times longer than usual a request may take: erasing flash stalls a controller for up to half a
/// second, and more where its sectors are large.
fn patience(message: &Message) -> u32 {
    match message {
        Message::SaveSettings => 4,
        _ => 1,
    }
}

/// The host's end.
#[derive(Debug)]
pub struct Requester {
    node: u8,
    retry: RetryPolicy,
    last_id: u16,
    pending: Option<Pending>,
    repeats: u32,
}

#[derive(Debug)]
struct Pending {
    id: u16,
    packet: PacketBytes,
    due_us: u64,
    tries_left: u32,
}

/// What a requester has to do next.
#[derive(Debug, PartialEq)]
pub enum NextAction<'a> {
    /// No request is under way.
    Nothing,
    /// Wait for bytes until this time.
    WaitUntil(u64),
    /// Send these bytes again.
    Repeat(&'a [u8]),
    /// There was no answer; the request is given up.
    GiveUp,
}

/// What a packet is to a requester.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IncomingPacket {
    /// The answer that it waits for; the request is over.
    Answer,
    /// An event.
    Event,
    /// Neither: the second answer to a repeated request, or a packet of another node.
    Stray,
}

impl Requester {
    /// A requester for one controller; ids count on from `first_id`.
    pub fn new(node: u8, first_id: u16, retry: RetryPolicy) -> Self {
        Self {
            node,
            retry,
            last_id: first_id,
            pending: None,
            repeats: 0,
        }
    }

    /// The controller that it talks to.
    pub fn node(&self) -> u8 {
        self.node
    }

    /// From now on talks to this controller.
    pub fn set_node(&mut self, node: u8) {
        self.node = node;
    }

    /// How often a request had to be sent again so far.
    pub fn repeats(&self) -> u32 {
        self.repeats
    }

    /// Begins a request, giving up one that was under way. Returns its id and the bytes to send.
    pub fn begin(&mut self, message: &Message, now_us: u64) -> Result<(u16, &[u8]), TooLong> {
        // 0 is the id of events.
        self.last_id = self.last_id.checked_add(1).unwrap_or(1);
        let packet = encode(self.node, self.last_id, message)?;
        let pending = self.pending.insert(Pending {
            id: self.last_id,
            packet,
            due_us: now_us + self.retry.retry_us,
            tries_left: (self.retry.tries * patience(message)).saturating_sub(1),
        });
        Ok((pending.id, &pending.packet))
    }

    /// What to do at this time.
    pub fn poll(&mut self, now_us: u64) -> NextAction<'_> {
        let Some(pending) = &mut self.pending else {
            return NextAction::Nothing;
        };
        if now_us < pending.due_us {
            return NextAction::WaitUntil(pending.due_us);
        }
        if pending.tries_left == 0 {
            self.pending = None;
            return NextAction::GiveUp;
        }
        pending.tries_left -= 1;
        pending.due_us = now_us + self.retry.retry_us;
        self.repeats += 1;
        match &self.pending {
            Some(pending) => NextAction::Repeat(&pending.packet),
            None => NextAction::Nothing,
        }
    }

    /// Sorts an incoming packet by its header.
    pub fn sort(&mut self, header: &Header) -> IncomingPacket {
        if self.node != crate::NODE_ANY && header.node != self.node {
            return IncomingPacket::Stray;
        }
        if header.kind >= 0xC0 {
            return IncomingPacket::Event;
        }
        match &self.pending {
            Some(pending) if header.kind >= 0x80 && header.request == pending.id => {
                self.pending = None;
                IncomingPacket::Answer
            }
            _ => IncomingPacket::Stray,
        }
    }
}

/// The controller's end.
#[derive(Debug, Default)]
pub struct Responder {
    session: Option<u32>,
    last_id: u16,
    last_answer: PacketBytes,
}

/// What a request is to a responder.
#[derive(Debug, PartialEq)]
pub enum IncomingRequest<'a> {
    /// Execute it, then [`Responder::answer`].
    New,
    /// It was executed before: send this answer again.
    Repeat(&'a [u8]),
    /// Older than the last one: ignore it.
    Stray,
}

impl Responder {
    /// A responder without a session.
    pub const fn new() -> Self {
        Self {
            session: None,
            last_id: 0,
            last_answer: PacketBytes::new(),
        }
    }

    /// Whether a host has said `Hello` since the start.
    pub fn has_session(&self) -> bool {
        self.session.is_some()
    }

    /// Sorts an incoming request.
    pub fn sort(&self, id: u16) -> IncomingRequest<'_> {
        if self.last_answer.is_empty() {
            return IncomingRequest::New;
        }
        match id.wrapping_sub(self.last_id) as i16 {
            0 => IncomingRequest::Repeat(&self.last_answer),
            newer if newer > 0 => IncomingRequest::New,
            _ => IncomingRequest::Stray,
        }
    }

    /// A `Hello` came. A session not seen before starts a new count of ids; returns whether it did.
    pub fn hello(&mut self, session: u32) -> bool {
        let new = self.session != Some(session);
        if new {
            self.session = Some(session);
            self.last_answer.clear();
        }
        new
    }

    /// Stores the answer to a request, and returns it to be sent.
    pub fn answer(&mut self, node: u8, id: u16, message: &Message) -> Result<&[u8], TooLong> {
        self.last_answer = encode(node, id, message)?;
        self.last_id = id;
        Ok(&self.last_answer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RETRY: RetryPolicy = RetryPolicy {
        retry_us: 100,
        tries: 3,
    };

    fn header(kind: u8, request: u16) -> Header {
        Header {
            version: 1,
            kind,
            node: 1,
            request,
        }
    }

    #[test]
    fn a_request_is_repeated_and_then_given_up() {
        let mut link = Requester::new(1, 0, RETRY);
        let (_, first) = link.begin(&Message::Home, 0).unwrap();
        let first = PacketBytes::from_slice(first).unwrap();
        assert_eq!(link.poll(99), NextAction::WaitUntil(100));
        assert_eq!(link.poll(100), NextAction::Repeat(&first));
        assert_eq!(link.poll(200), NextAction::Repeat(&first));
        assert_eq!(link.poll(300), NextAction::GiveUp);
        assert_eq!(link.poll(301), NextAction::Nothing);
        assert_eq!(link.repeats(), 2);
    }

    #[test]
    fn a_save_is_waited_for_longer() {
        let mut link = Requester::new(1, 0, RETRY);
        link.begin(&Message::SaveSettings, 0).unwrap();
        let sends = (1..100).take_while(|i| link.poll(i * 100) != NextAction::GiveUp);
        assert_eq!(sends.count(), 4 * RETRY.tries as usize - 1);
    }

    #[test]
    fn only_the_answer_to_the_request_under_way_ends_it() {
        let mut link = Requester::new(1, 41, RETRY);
        let (id, _) = link.begin(&Message::Home, 0).unwrap();
        assert_eq!(id, 42);
        assert_eq!(link.sort(&header(0x83, 41)), IncomingPacket::Stray);
        assert_eq!(link.sort(&header(0xC1, 42)), IncomingPacket::Event);
        assert_eq!(
            link.sort(&Header {
                node: 2,
                ..header(0x83, 42)
            }),
            IncomingPacket::Stray
        );
        assert_eq!(link.sort(&header(0x83, 42)), IncomingPacket::Answer);
        assert_eq!(link.sort(&header(0x83, 42)), IncomingPacket::Stray);
    }

    #[test]
    fn a_repeat_gets_the_same_answer_and_an_old_one_none() {
        let mut device = Responder::new();
        assert!(device.hello(5));
        assert_eq!(device.sort(9), IncomingRequest::New);
        let answer =
            PacketBytes::from_slice(device.answer(1, 9, &Message::Accepted).unwrap()).unwrap();
        assert_eq!(device.sort(9), IncomingRequest::Repeat(&answer));
        assert_eq!(device.sort(8), IncomingRequest::Stray);
        assert_eq!(device.sort(10), IncomingRequest::New);
        assert!(
            !device.hello(5),
            "a repeated Hello does not start a new session"
        );
        assert_eq!(device.sort(9), IncomingRequest::Repeat(&answer));
        assert!(device.hello(6));
        assert_eq!(device.sort(1), IncomingRequest::New);
    }

    #[test]
    fn ids_go_round_without_using_the_id_of_events() {
        let mut link = Requester::new(1, u16::MAX - 1, RETRY);
        assert_eq!(link.begin(&Message::Home, 0).unwrap().0, u16::MAX);
        assert_eq!(link.begin(&Message::Home, 0).unwrap().0, 1);
        let mut device = Responder::new();
        device.answer(1, u16::MAX, &Message::Accepted).unwrap();
        assert_eq!(device.sort(1), IncomingRequest::New);
    }
}
