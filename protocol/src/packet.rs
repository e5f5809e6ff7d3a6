//! Bytes to messages and back.

use crate::message::{BodyError, Message};
use crate::{MAX_PACKET, PROTOCOL_VERSION, crc32c};

/// A packet as it stands on the wire, closing zero included.
pub type PacketBytes = heapless::Vec<u8, MAX_PACKET>;

const HEADER: usize = 5;
const CHECKSUM: usize = 4;
/// What fits between COBS' own byte and the closing zero (below 254 bytes COBS adds one).
const MAX_CONTENT: usize = MAX_PACKET - 3;

/// What stands before the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Protocol version of the sender.
    pub version: u8,
    /// Kind of the message.
    pub kind: u8,
    /// The controller that it goes to or comes from.
    pub node: u8,
    /// Number of the request that it is, or answers; 0 for an event.
    pub request: u16,
}

/// A message that is longer than a packet may be. No message of this crate is; the type is here
/// because a body's length is only known once it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLong;

/// The packet of a message, ready for the wire.
pub fn encode(node: u8, request: u16, message: &Message) -> Result<PacketBytes, TooLong> {
    let mut content = [0u8; MAX_CONTENT];
    let [low, high] = request.to_le_bytes();
    content[..HEADER].copy_from_slice(&[PROTOCOL_VERSION, message.kind(), node, low, high]);
    let room = &mut content[HEADER..MAX_CONTENT - CHECKSUM];
    let end = HEADER + message.write_body(room).ok_or(TooLong)?;
    let checksum = crc32c(&content[..end]).to_le_bytes();
    content[end..end + CHECKSUM].copy_from_slice(&checksum);

    let mut packet = PacketBytes::new();
    packet.resize_default(MAX_PACKET).map_err(|_| TooLong)?;
    let length = cobs::try_encode(&content[..end + CHECKSUM], &mut packet[..MAX_PACKET - 1])
        .map_err(|_| TooLong)?;
    packet[length] = 0;
    packet.truncate(length + 1);
    Ok(packet)
}

/// A packet whose checksum is right.
#[derive(Clone, Debug, PartialEq)]
pub struct Received {
    /// Its header.
    pub header: Header,
    /// Its message, or why there is none.
    pub message: Result<Message, BodyError>,
}

/// Counts of what came in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames with a right checksum.
    pub good: u32,
    /// Frames thrown away: too long, not COBS, too short, wrong checksum.
    pub bad: u32,
}

/// Finds packets in a stream of bytes that may begin anywhere and lose, gain or change any of them.
#[derive(Debug)]
pub struct Decoder {
    buffer: [u8; MAX_PACKET],
    length: usize,
    overrun: bool,
    counters: Counters,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder at the start of a stream.
    pub const fn new() -> Self {
        Self {
            buffer: [0; MAX_PACKET],
            length: 0,
            overrun: false,
            counters: Counters { good: 0, bad: 0 },
        }
    }

    /// What came in so far.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Takes one byte; returns a packet when that byte closes one.
    pub fn push(&mut self, byte: u8) -> Option<Received> {
        if byte != 0 {
            // The closing zero is not stored, so one byte less than a packet fits.
            if self.length < MAX_PACKET - 1 {
                self.buffer[self.length] = byte;
                self.length += 1;
            } else {
                self.overrun = true;
            }
            return None;
        }
        let length = core::mem::take(&mut self.length);
        let overrun = core::mem::take(&mut self.overrun);
        if length == 0 {
            // Zeros between packets: a sender may open with one to end a broken packet.
            return None;
        }
        let received = if overrun {
            None
        } else {
            open(&mut self.buffer[..length])
        };
        match received {
            Some(_) => self.counters.good = self.counters.good.wrapping_add(1),
            None => self.counters.bad = self.counters.bad.wrapping_add(1),
        }
        received
    }
}

/// The content of one COBS block, if it is a packet.
fn open(block: &mut [u8]) -> Option<Received> {
    let length = cobs::decode_in_place(block).ok()?;
    let content = block.get(..length)?;
    let (checked, checksum) = content.split_at_checked(length.checked_sub(CHECKSUM)?)?;
    if crc32c(checked).to_le_bytes() != checksum {
        return None;
    }
    let (&[version, kind, node, low, high], body) = checked.split_first_chunk::<HEADER>()?;
    Some(Received {
        header: Header {
            version,
            kind,
            node,
            request: u16::from_le_bytes([low, high]),
        },
        message: Message::read(kind, body),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn feed(decoder: &mut Decoder, bytes: &[u8]) -> heapless::Vec<Received, 8> {
        bytes.iter().filter_map(|&b| decoder.push(b)).collect()
    }

    #[test]
    fn a_packet_survives_the_way_there() {
        let packet = encode(1, 7, &Message::Stop).unwrap();
        let got = feed(&mut Decoder::new(), &packet);
        assert_eq!(got.len(), 1);
        assert_eq!(got[0].header.request, 7);
        assert_eq!(got[0].message, Ok(Message::Stop));
    }

    #[test]
    fn any_single_flipped_bit_is_noticed() {
        let packet = encode(2, 513, &Message::ReadLatch(3)).unwrap();
        for at in 0..packet.len() {
            for bit in 0..8 {
                let mut bent = packet.clone();
                bent[at] ^= 1 << bit;
                assert!(
                    feed(&mut Decoder::new(), &bent).is_empty(),
                    "byte {at} bit {bit}"
                );
            }
        }
    }

    #[test]
    fn a_stream_that_begins_amid_a_packet_recovers_with_the_next() {
        let packet = encode(1, 1, &Message::Home).unwrap();
        let mut decoder = Decoder::new();
        assert!(feed(&mut decoder, &packet[3..]).is_empty());
        assert_eq!(feed(&mut decoder, &packet).len(), 1);
        assert_eq!(decoder.counters(), Counters { good: 1, bad: 1 });
    }

    #[test]
    fn endless_noise_without_a_zero_does_not_overflow() {
        let mut decoder = Decoder::new();
        for _ in 0..10_000 {
            assert!(decoder.push(0xAA).is_none());
        }
        assert!(decoder.push(0).is_none());
        assert_eq!(decoder.counters().bad, 1);
    }
}
