//! Whatever comes in on the wire: no panic, and nothing accepted whose checksum is wrong.

use gonia_protocol::message::{Message, Move};
use gonia_protocol::packet::{Decoder, encode};
use proptest::prelude::*;

/// Whether a block between two zeros is a packet, by a decoder that shares no code with the crate.
fn is_valid_block(block: &[u8]) -> bool {
    let mut content = Vec::new();
    let mut at = 0;
    while at < block.len() {
        let code = block[at] as usize;
        if code == 0 || at + code > block.len() {
            return false;
        }
        content.extend_from_slice(&block[at + 1..at + code]);
        at += code;
        if code != 255 && at < block.len() {
            content.push(0);
        }
    }
    if content.len() < 9 {
        return false;
    }
    let (checked, checksum) = content.split_at(content.len() - 4);
    let mut crc = !0u32;
    for &byte in checked {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0x82F6_3B78 & (crc & 1).wrapping_neg());
        }
    }
    (!crc).to_le_bytes() == checksum
}

proptest! {
    #[test]
    fn any_stream_is_survived_and_nothing_with_a_wrong_checksum_accepted(
        bytes in proptest::collection::vec(prop_oneof![any::<u8>(), Just(0u8), Just(3u8)], 0..2000)
    ) {
        let mut decoder = Decoder::new();
        let mut block = Vec::new();
        for byte in bytes {
            let accepted = decoder.push(byte).is_some();
            if byte == 0 {
                prop_assert!(!accepted || is_valid_block(&block));
                block.clear();
            } else {
                prop_assert!(!accepted);
                block.push(byte);
            }
        }
    }

    #[test]
    fn a_bent_packet_is_dropped_and_the_next_one_found(
        target in any::<[i32; 2]>(), request in any::<u16>(), at in 0usize..64, to in any::<u8>()
    ) {
        let message = Message::Move(Move { target_udeg: target });
        let packet = encode(1, request, &message).unwrap();
        prop_assert!(is_valid_block(&packet[..packet.len() - 1]));
        let mut bent = packet.clone();
        let at = at % bent.len();
        bent[at] = to;
        let mut decoder = Decoder::new();
        // The zero ends whatever the bent packet left open.
        let stream: Vec<u8> = bent.iter().copied().chain([0]).chain(packet.iter().copied()).collect();
        let got: Vec<_> = stream.into_iter().filter_map(|b| decoder.push(b)).collect();
        let expected = if bent == packet { 2 } else { 1 };
        prop_assert_eq!(got.len(), expected);
        let last = got.last().unwrap();
        prop_assert_eq!(last.header.request, request);
        prop_assert_eq!(last.message.as_ref(), Ok(&message));
    }
}
