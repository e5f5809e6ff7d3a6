//! Both ends of the link with a wire that does what the fuzzer wants, in whole packets: what is
//! executed is what was asked, in its order, and never twice.
#![no_main]

use gonia_protocol::link::{
    IncomingPacket, IncomingRequest, NextAction, Requester, Responder, RetryPolicy,
};
use gonia_protocol::message::{Message, Move};
use gonia_protocol::packet::{Decoder, PacketBytes};
use libfuzzer_sys::fuzz_target;

const RETRY: RetryPolicy = RetryPolicy {
    retry_us: 10,
    tries: 5,
};

fuzz_target!(|deeds: &[u8]| {
    let mut host = Requester::new(1, 0, RETRY);
    let mut device = Responder::new();
    device.hello(1);
    let (mut to_device, mut to_host) = (Vec::<PacketBytes>::new(), Vec::<PacketBytes>::new());
    let (mut asked, mut done, mut now_us) = (0, Vec::new(), 0);
    for deed in deeds {
        match deed % 6 {
            // The host asks for the next thing, if nothing is under way.
            0 if host.poll(now_us) == NextAction::Nothing => {
                asked += 1;
                let message = Message::Move(Move {
                    target_udeg: [asked, 0],
                });
                let (_, packet) = host.begin(&message, now_us).expect("short");
                to_device.push(PacketBytes::from_slice(packet).expect("short"));
            }
            1 => {
                now_us += 10;
                if let NextAction::Repeat(packet) = host.poll(now_us) {
                    to_device.push(PacketBytes::from_slice(packet).expect("short"));
                }
            }
            2 if !to_device.is_empty() => drop(to_device.remove(0)),
            3 if !to_host.is_empty() => drop(to_host.remove(0)),
            // A packet arrives; the fuzzer chooses whether it also stays under way.
            4 if !to_device.is_empty() => {
                let packet = to_device[0].clone();
                if deed & 0x80 == 0 {
                    to_device.remove(0);
                }
                serve(&packet, &mut device, &mut done, &mut to_host);
            }
            5 if !to_host.is_empty() => {
                let packet = to_host.remove(0);
                let mut decoder = Decoder::new();
                let received = packet.iter().find_map(|&byte| decoder.push(byte));
                if host.sort(&received.expect("whole").header) == IncomingPacket::Answer {
                    assert_eq!(done.last(), Some(&asked), "answered and not done");
                }
            }
            _ => {}
        }
    }
    assert!(done.windows(2).all(|pair| pair[0] < pair[1]), "{done:?}");
});

fn serve(
    packet: &PacketBytes,
    device: &mut Responder,
    done: &mut Vec<i32>,
    to_host: &mut Vec<PacketBytes>,
) {
    let mut decoder = Decoder::new();
    let received = packet.iter().find_map(|&byte| decoder.push(byte));
    let received = received.expect("a whole packet");
    let answer = match device.sort(received.header.request) {
        IncomingRequest::Stray => return,
        IncomingRequest::Repeat(answer) => PacketBytes::from_slice(answer),
        IncomingRequest::New => {
            if let Ok(Message::Move(to)) = received.message {
                done.push(to.target_udeg[0]);
            }
            let answer = device.answer(1, received.header.request, &Message::Accepted);
            PacketBytes::from_slice(answer.expect("short"))
        }
    };
    to_host.push(answer.expect("short"));
}
