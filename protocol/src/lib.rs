//! All that travels on the wire between the host and the arm controllers. No I/O.
//!
//! A packet is COBS(header, postcard body, CRC-32C) and a zero byte, at most [`MAX_PACKET`] bytes.
//! The header is five bytes: protocol version, kind, node, request id (little endian). Acknowledged
//! means accepted; that something is *done* is an event of its own ([`message::Completed`]).
//!
//! | room | subject |
//! |---|---|
//! | [`message`] | every message, its kind and its body |
//! | [`packet`] | bytes to messages and back |
//! | [`link`] | request ids, retransmission, exactly-once execution; both ends, no clock |
//! | [`settings`] | the keys of a controller's settings, their units, ranges and defaults |
//! | [`fault`] | fault codes, numbered for ever |
#![no_std]

pub mod fault;
pub mod link;
pub mod message;
pub mod packet;
pub mod settings;

/// Version of the protocol this crate speaks. Raised when a packet of an older version can no
/// longer be understood; `Hello`, its answer, `Stop` and `EStop` keep their layout across versions.
pub const PROTOCOL_VERSION: u8 = 1;

/// CRC-32C over the golden bytes of every message: two builds with the same key agree on every
/// layout. A test recomputes it, so a change of layout cannot pass unseen.
pub const SCHEMA_KEY: u32 = 0xde7b_6a18;

/// Bits per second of the serial line, on every board and on the host.
pub const BAUD: u32 = 921_600;

/// Longest packet on the wire, the closing zero byte included.
pub const MAX_PACKET: usize = 256;

/// Any controller on this wire; only `Hello` may be sent to it.
pub const NODE_ANY: u8 = 0;
/// The controller of the light arm.
pub const NODE_LIGHT: u8 = 1;
/// The controller of the camera arm.
pub const NODE_CAMERA: u8 = 2;

/// CRC-32C (Castagnoli: polynomial 0x1EDC6F41, reflected, start and end XOR all ones) of some bytes: the
/// checksum of packets, of stored settings and of the host's files.
///
/// ```
/// assert_eq!(gonia_protocol::crc32c(b"123456789"), 0xE306_9283);
/// ```
pub fn crc32c(bytes: &[u8]) -> u32 {
    const CASTAGNOLI: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI);
    CASTAGNOLI.checksum(bytes)
}
