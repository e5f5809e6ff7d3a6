//! What an encoder says beside its position.

use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{ControllerState, Message, RequestOutcome};
use gonia_protocol::settings::Axis;

use super::TestBench;
use crate::plant::EncoderSays;

/// Faults and warnings in the log, oldest first.
fn logged(bench: &mut TestBench) -> Vec<(FaultCode, Option<Axis>)> {
    let mut entries = Vec::new();
    for back in 0..=u8::MAX {
        let Ok(Message::LogIs(entry)) = bench.ask(&Message::ReadLog(back)) else {
            panic!("no log");
        };
        let Some(code) = entry.fault else { break };
        entries.insert(0, (code, entry.axis));
    }
    entries
}

#[test]
fn a_ring_that_warns_is_reported_once_and_the_arm_goes_on() {
    let mut bench = TestBench::near_home();
    bench.ask(&Message::Home).unwrap();
    bench
        .arm
        .axis(Axis::Phi)
        .let_encoder_say(EncoderSays::Warning);
    assert_eq!(bench.outcome(), RequestOutcome::Done);
    let warning = (FaultCode::ENCODER_WARNING, Some(Axis::Phi));
    assert_eq!(logged(&mut bench), [warning]);
    // It stays: no second report. It goes and comes back later: another one.
    bench.run_us(30_000_000);
    assert_eq!(logged(&mut bench).len(), 1);
    bench
        .arm
        .axis(Axis::Phi)
        .let_encoder_say(EncoderSays::Nothing);
    bench.run_us(11_000_000);
    bench
        .arm
        .axis(Axis::Phi)
        .let_encoder_say(EncoderSays::Warning);
    bench.run_us(1_000_000);
    assert_eq!(logged(&mut bench), [warning; 2]);
    assert_eq!(bench.state(), ControllerState::Idle);
}

#[test]
fn a_single_word_with_the_warning_bit_is_interference() {
    let mut bench = TestBench::near_home();
    bench.run_us(100_000);
    bench
        .arm
        .axis(Axis::Phi)
        .let_encoder_say(EncoderSays::Warning);
    bench.tick();
    bench
        .arm
        .axis(Axis::Phi)
        .let_encoder_say(EncoderSays::Nothing);
    bench.run_us(1_000_000);
    assert_eq!(logged(&mut bench), []);
}

#[test]
fn a_ring_in_error_is_a_fault_of_its_own() {
    let mut bench = TestBench::near_home();
    bench.ask(&Message::Home).unwrap();
    bench.run_us(300_000);
    bench
        .arm
        .axis(Axis::Theta)
        .let_encoder_say(EncoderSays::Error);
    let expected = FaultCode::ENCODER_INVALID;
    assert_eq!(bench.outcome(), RequestOutcome::Failed(expected));
    assert_eq!(logged(&mut bench), [(expected, Some(Axis::Theta))]);
}
