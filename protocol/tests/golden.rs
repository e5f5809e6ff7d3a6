//! The bytes of every message. If a test here fails, the wire has changed: raise
//! `PROTOCOL_VERSION` where an older peer would misread it, and put the new bytes in.

#![allow(clippy::unwrap_used)]

use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::*;
use gonia_protocol::packet::{Decoder, encode};
use gonia_protocol::settings::{Axis, MEANINGS};
use gonia_protocol::{NODE_LIGHT, SCHEMA_KEY, crc32c};

const REQUEST: u16 = 0x0102;

fn status() -> Status {
    let axis = |n: i32| AxisStatus {
        commanded_udeg: 1_000_000 * n,
        encoder_udeg: 1_000_123 * n,
        following_udeg: 17 * n,
        corrections: 3,
        missed_steps: 32,
    };
    Status {
        time_us: 7_654_321,
        state: ControllerState::Fault(FaultCode::HOST_WATCHDOG),
        homed: true,
        axes: [axis(1), axis(-2)],
        last: Some((REQUEST, RequestOutcome::Failed(FaultCode::HOST_WATCHDOG))),
        packets_good: 1000,
        packets_bad: 2,
        config_crc: 0xDEAD_BEEF,
    }
}

fn latch(seq: u32) -> Latch {
    Latch {
        seq,
        request: REQUEST,
        pulse: 1,
        time_us: 123_456_789,
        encoder_udeg: [15_000_001, -59_999_999],
        within: true,
    }
}

/// Every message once, with its packet in hexadecimal. A table, so longer than a function should be.
// long: a table, the bytes of every message.
fn golden() -> Vec<(Message, &'static str)> {
    let setting = Setting {
        axis: Axis::Phi,
        key: 7,
        value: 15_000_000,
    };
    let identity = Identity {
        protocol_min: 1,
        protocol_max: 1,
        // Not the real one, which depends on these very bytes.
        schema_key: 0x1234_5678,
        firmware: [0, 1, 0],
        git: "a1b2c3d4+".try_into().unwrap(),
        board: "qemu-mps2".try_into().unwrap(),
        config_crc: 0xCAFE_F00D,
        boot_id: 77,
        reset: ResetReason::BrownOut,
        last_panic: "index out of bounds".try_into().unwrap(),
    };
    vec![
        (
            Message::Hello(Hello {
                session: 0xABCD_0123,
            }),
            "0f0101010201a382b4de0a600a765a00",
        ),
        (Message::GetStatus, "0a01020102018b1b6bb200"),
        (Message::Stop, "0a010301020133b12e6f00"),
        (Message::EStop, "0a0104010201f9092e7600"),
        (Message::Heartbeat, "0a010501020141a36bab00"),
        (Message::ClearFault, "0a0106010201782a49c900"),
        (Message::Home, "0a0107010201c0800c1400"),
        (
            Message::Move(Move {
                target_udeg: [75_000_000, -1],
            }),
            "0f010801020180a3c347018d0c8abe00",
        ),
        (
            Message::RequestTrigger(TriggerRequest {
                trigger: TriggerRole::Follower,
                exposures_us: [1000, 16_000].into_iter().collect(),
                gap_us: 500,
            }),
            "1201090102010102e807807df403218d8a1b00",
        ),
        (Message::Fire, "0a010a0102016d782f4400"),
        (Message::Disarm, "0a010b010201d5d26a9900"),
        (Message::ReadLatch(2), "0b010c0102010287b28bfd00"),
        (
            Message::GetSetting(SettingName {
                axis: Axis::Theta,
                key: 13,
            }),
            "06010d010201060d5490e17300",
        ),
        (
            Message::SetSetting(setting.clone()),
            "10010e01020101078087a70e148e7e7d00",
        ),
        (Message::SaveSettings, "0a010f01020126e348e200"),
        (Message::ReadLog(4), "0b0110010201049d812a7100"),
        (
            Message::Identity(identity),
            "0d01810102010101f8acd191010201340961316232633364342b0971656d752d6d7073328de0fbd70c4d0113696e646578206f7574206f6620626f756e6473bcabf8bb00",
        ),
        (
            Message::Status(status()),
            "320182010201b197d30307080180897af68a7a220320ff91f401eb95f4014303200182020208e80702effdb6f50d5c16e6ee00",
        ),
        (Message::Accepted, "0a01830102010c788e3d00"),
        (
            Message::Refused(RequestRefusal::OutsideWindow(Axis::Phi, -31_000)),
            "0f01840102010701afe403683c525300",
        ),
        (
            Message::SettingIs(setting),
            "10018501020101078087a70e20f4ad1900",
        ),
        (
            Message::LatchIs(latch(0)),
            "06018601020115820201959aef3a8287a70efd9b9c39015aa7e96100",
        ),
        (
            Message::LogIs(LogEntry {
                time_us: 99,
                fault: Some(FaultCode::ENCODER_JUMP),
                axis: Some(Axis::Phi),
            }),
            "0f018701020163010201015d83a02800",
        ),
        (
            Message::Completed(Completed {
                seq: 300,
                request: REQUEST,
                outcome: RequestOutcome::Done,
                encoder_udeg: [1, -1],
                corrections: [0, 2],
            }),
            "0a01c1010201ac0282020302010602302d306a00",
        ),
        (
            Message::Faulted(Faulted {
                seq: 301,
                code: FaultCode::FOLLOWING_ERROR,
                axis: Some(Axis::Theta),
            }),
            "0a01c2010201ad0203010564e368ea00",
        ),
        (
            Message::Telemetry(Telemetry {
                seq: 302,
                time_us: 5,
                state: ControllerState::Moving,
                commanded_udeg: [2, -2],
                encoder_udeg: [3, -3],
            }),
            "1201c3010201ae02050404030605d36116ea00",
        ),
        (
            Message::Pulse(latch(303)),
            "1c01c4010201af02820201959aef3a8287a70efd9b9c39019ef4970100",
        ),
        (
            Message::Refused(RequestRefusal::CountRate(20_834, 20_000)),
            "1101840102010be2a201a09c0119e8092900",
        ),
        (
            Message::Refused(RequestRefusal::NoPins),
            "0b01840102010c6dd336fa00",
        ),
    ]
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[test]
fn every_message_has_its_golden_bytes() {
    for (message, expected) in golden() {
        let packet = encode(NODE_LIGHT, REQUEST, &message).unwrap();
        assert_eq!(hex(&packet), expected, "{message:?}");
    }
}

#[test]
fn every_golden_packet_is_read_back() {
    for (message, expected) in golden() {
        let mut decoder = Decoder::new();
        let bytes = (0..expected.len())
            .step_by(2)
            .map(|i| u8::from_str_radix(&expected[i..i + 2], 16));
        let got: Vec<_> = bytes.filter_map(|b| decoder.push(b.unwrap())).collect();
        assert_eq!(got.len(), 1);
        assert_eq!(got[0].header.request, REQUEST);
        assert_eq!(got[0].message, Ok(message));
    }
}

#[test]
fn every_kind_stands_in_the_golden_list() {
    let listed: Vec<u8> = golden().iter().map(|(message, _)| message.kind()).collect();
    for kind in 0..=255u8 {
        // A packet of a known kind with an impossible body is malformed, of an unknown kind unknown.
        let mut content = vec![1, kind, NODE_LIGHT, 1, 0];
        content.extend([0xFF; 40]);
        content.extend(crc32c(&content).to_le_bytes());
        let mut block = vec![0; 64];
        let length = cobs::encode(&content, &mut block);
        let mut decoder = Decoder::new();
        block.truncate(length);
        block.push(0);
        let received = block.into_iter().find_map(|b| decoder.push(b)).unwrap();
        let known = received.message != Err(BodyError::UnknownKind);
        assert_eq!(known, listed.contains(&kind), "kind {kind:#04x}");
    }
}

#[test]
fn the_schema_key_is_that_of_the_golden_bytes() {
    let all: String = golden().iter().map(|(_, bytes)| *bytes).collect();
    assert_eq!(
        SCHEMA_KEY,
        crc32c(all.as_bytes()),
        "{:#010x}",
        crc32c(all.as_bytes())
    );
}

/// Settings are known by their numbers, on the wire and in flash: new ones come at the end.
#[test]
fn no_setting_has_ever_changed_its_number_or_its_unit() {
    let listed: Vec<String> = MEANINGS
        .iter()
        .map(|m| {
            format!("{} {} {}", m.key.number(), m.name, m.unit)
                .trim_end()
                .to_owned()
        })
        .collect();
    let frozen = [
        "0 steps_per_turn steps",
        "1 encoder_counts_per_turn counts",
        "2 encoder_zero counts",
        "3 soft_min µdeg",
        "4 soft_max µdeg",
        "5 home_angle µdeg",
        "6 home_tolerance µdeg",
        "7 max_speed µdeg/s",
        "8 acceleration µdeg/s²",
        "9 home_fast_speed µdeg/s",
        "10 home_slow_speed µdeg/s",
        "11 home_backoff µdeg",
        "12 backlash_takeup µdeg",
        "13 in_position_window µdeg",
        "14 settling_time µs",
        "15 settling_timeout µs",
        "16 max_corrections",
        "17 following_limit µdeg",
        "18 trigger_window µdeg",
        "19 host_watchdog µs",
        "20 telemetry µs",
        "21 step_loss_limit µdeg",
        "22 encoder_cos1 µdeg",
        "23 encoder_sin1 µdeg",
        "24 encoder_cos2 µdeg",
        "25 encoder_sin2 µdeg",
        "26 jerk_time µs",
        "27 worm_turn µdeg",
        "28 gear_cos µdeg",
        "29 gear_sin µdeg",
        "30 motor_reversed",
        "31 encoder_reversed",
        "32 home_probe µdeg",
        "33 home_normally_closed",
        "34 driver_alarm",
        "35 brake_time µs",
        "36 encoder_kind",
        "37 driver_kind",
        "38 driver_address",
        "39 run_current mA",
        "40 hold_current mA",
        "41 microsteps",
        "42 sense_resistor mΩ",
    ];
    assert_eq!(listed, frozen);
}
