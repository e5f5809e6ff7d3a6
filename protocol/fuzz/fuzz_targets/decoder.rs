//! Any bytes: nothing panics, and what is accepted is a message that can be sent again.
#![no_main]

use gonia_protocol::packet::{Decoder, encode};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut decoder = Decoder::new();
    for &byte in bytes {
        let Some(received) = decoder.push(byte) else {
            continue;
        };
        let Ok(message) = received.message else {
            continue;
        };
        let header = received.header;
        let packet = encode(header.node, header.request, &message).expect("it came in a packet");
        let mut again = Decoder::new();
        let twice = packet.iter().find_map(|&byte| again.push(byte));
        assert_eq!(twice.expect("a whole packet").message, Ok(message));
    }
});
