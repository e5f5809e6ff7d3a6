//! An old host on new firmware, and a new host on old firmware: nothing moves, and who it is, its log
//! and a stop are there all the same.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::io;

use gonia_acquire::link::{LinkError, RemoteController, Transport};
use gonia_protocol::message::{
    Hello, Message, Move, RequestRefusal, Setting, TriggerRequest, TriggerRole,
};
use gonia_protocol::packet::{Decoder, encode};
use gonia_protocol::settings::{Axis, Key};
use gonia_protocol::{NODE_LIGHT, PROTOCOL_VERSION, SCHEMA_KEY, crc32c};
use gonia_sim::fault::{Arm, FaultPlan};
use gonia_sim::rig::{SimPort, SimRig};

/// Everything that would change something.
fn motions() -> Vec<Message> {
    vec![
        Message::Home,
        Message::Move(Move {
            target_udeg: [0, 0],
        }),
        Message::RequestTrigger(TriggerRequest {
            trigger: TriggerRole::Source,
            exposures_us: [1000].into_iter().collect(),
            gap_us: 500,
        }),
        Message::Fire,
        Message::ClearFault,
        Message::SetSetting(Setting {
            axis: Axis::Phi,
            key: Key::MaxSpeed.number(),
            value: 1_000_000,
        }),
        Message::SaveSettings,
    ]
}

/// The packet that a host of another version would send.
fn packet_of(version: u8, request: u16, message: &Message) -> Vec<u8> {
    let packet = encode(NODE_LIGHT, request, message).unwrap();
    let mut body = cobs::decode_vec(&packet[..packet.len() - 1]).unwrap();
    let checked = body.len() - 4;
    body[0] = version;
    let crc = crc32c(&body[..checked]);
    body[checked..].copy_from_slice(&crc.to_le_bytes());
    let mut packet = cobs::encode_vec(&body);
    packet.push(0);
    packet
}

/// Asks a controller of this firmware.
fn ask(port: &SimPort, request: u16, packet: &[u8]) -> Message {
    port.send(packet);
    let mut decoder = Decoder::new();
    for _ in 0..100 {
        let mut bytes = Vec::new();
        port.receive(&mut bytes, 10_000);
        let mut packets = bytes.iter().filter_map(|&byte| decoder.push(byte));
        if let Some(answer) = packets.find(|packet| packet.header.request == request) {
            return answer.message.unwrap();
        }
    }
    panic!("no answer to request {request}");
}

#[test]
fn new_firmware_refuses_every_motion_of_a_host_of_another_version() {
    for version in [0, PROTOCOL_VERSION + 1, u8::MAX] {
        let rig = SimRig::new(3, FaultPlan::default());
        let (port, before) = (rig.port(Arm::Light), rig.true_deg(Arm::Light));
        let mut request = 0;
        let mut ask = |message: &Message| {
            request += 1;
            ask(&port, request, &packet_of(version, request, message))
        };
        let hello = ask(&Message::Hello(Hello { session: 7 }));
        let Message::Identity(identity) = hello else {
            panic!("{hello:?}");
        };
        assert_eq!(identity.schema_key, SCHEMA_KEY);
        for message in motions() {
            assert_eq!(
                ask(&message),
                Message::Refused(RequestRefusal::Version),
                "{message:?}"
            );
        }
        assert!(matches!(ask(&Message::GetStatus), Message::Status(_)));
        assert!(matches!(ask(&Message::ReadLog(0)), Message::LogIs(_)));
        assert_eq!(ask(&Message::Stop), Message::Accepted);
        assert_eq!(ask(&Message::EStop), Message::Accepted);
        assert_eq!(rig.true_deg(Arm::Light), before);
    }
}

/// A controller whose firmware is of another time: its identity says so.
struct Other {
    port: SimPort,
    decoder: Decoder,
    version: u8,
    schema_key: u32,
    /// Kinds of what the host has sent.
    sent: std::sync::Arc<std::sync::Mutex<Vec<u8>>>,
}

impl Transport for Other {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut decoder = Decoder::new();
        let packets = bytes.iter().filter_map(|&byte| decoder.push(byte));
        self.sent
            .lock()
            .unwrap()
            .extend(packets.map(|packet| packet.header.kind));
        self.port.send(bytes);
        Ok(())
    }

    fn receive(&mut self, out: &mut Vec<u8>, timeout_us: u64) -> io::Result<()> {
        let mut bytes = Vec::new();
        self.port.receive(&mut bytes, timeout_us);
        for byte in bytes {
            let Some(received) = self.decoder.push(byte) else {
                continue;
            };
            let mut message = received.message.unwrap();
            if let Message::Identity(identity) = &mut message {
                (identity.protocol_min, identity.protocol_max) = (self.version, self.version);
                identity.schema_key = self.schema_key;
            }
            out.extend(encode(received.header.node, received.header.request, &message).unwrap());
        }
        Ok(())
    }

    fn now_us(&self) -> u64 {
        self.port.now_us()
    }
}

#[test]
fn a_new_host_does_not_move_old_firmware_and_still_gets_its_log_and_stops_it() {
    for (version, schema_key) in [
        (PROTOCOL_VERSION - 1, SCHEMA_KEY),
        (PROTOCOL_VERSION + 1, SCHEMA_KEY),
        (PROTOCOL_VERSION, SCHEMA_KEY ^ 1),
    ] {
        let rig = SimRig::new(3, FaultPlan::default());
        let before = rig.true_deg(Arm::Light);
        let sent = std::sync::Arc::default();
        let other = || {
            Box::new(Other {
                port: rig.port(Arm::Light),
                decoder: Decoder::new(),
                version,
                schema_key,
                sent: std::sync::Arc::clone(&sent),
            })
        };
        let refused = RemoteController::connect(other(), NODE_LIGHT).err();
        assert!(matches!(refused, Some(LinkError::Version { .. })));

        let mut arm = RemoteController::connect_for_service(other(), NODE_LIGHT).unwrap();
        assert_eq!(arm.identity().schema_key, schema_key);
        assert_eq!(arm.identity().board.as_str(), "sim");
        assert_eq!(arm.log().unwrap(), []);
        arm.status().unwrap();
        let is_refused =
            |error: Option<LinkError>| matches!(error, Some(LinkError::Version { .. }));
        assert!(is_refused(arm.home().err()));
        assert!(is_refused(arm.move_to([0, 0]).err()));
        assert!(is_refused(arm.fire().err()));
        assert!(is_refused(arm.clear_fault().err()));
        assert!(is_refused(arm.save_settings().err()));
        assert!(is_refused(
            arm.set_setting(Axis::Phi, Key::MaxSpeed, 1_000_000).err()
        ));
        arm.stop().unwrap();
        arm.emergency_stop().unwrap();
        assert_eq!(rig.true_deg(Arm::Light), before);
        let kinds: Vec<u8> = sent.lock().unwrap().clone();
        assert!(kinds.into_iter().all(Message::is_always_answered));
    }
}
