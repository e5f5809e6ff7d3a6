//! Trigger pulses, out and in.

use anyhow::{Result, ensure};
use gonia_protocol::message::{Message, RequestOutcome, TriggerRequest, TriggerRole};

use crate::bench::Command;
use crate::chips::lock;
use crate::rig::Rig;

/// From shorter than an interrupt is late to longer than the timer counts.
const EXPOSURES_US: [u32; 6] = [20, 250, 1_234, 4_000, 70_000, 333_333];
const GAP_US: u32 = 3_000;
/// What a pulse and its time stamp may be off, ns.
const TOLERANCE_NS: i64 = 1_000;

fn request(trigger: TriggerRole) -> Message {
    Message::RequestTrigger(TriggerRequest {
        trigger,
        exposures_us: EXPOSURES_US.into_iter().collect(),
        gap_us: GAP_US,
    })
}

/// A train that the chip gives. The arm rests at a pose.
pub fn train(rig: &mut Rig) -> Result<String> {
    rig.latches.clear();
    rig.begin(&request(TriggerRole::Source))?;
    let id = rig.begin(&Message::Fire)?;
    let outcome = rig.outcome(id, 5_000_000)?;
    ensure!(outcome == RequestOutcome::Done, "it ended as {outcome:?}");
    let edges = lock(&rig.world).trigger.clone();
    ensure!(
        edges.len() == 2 * EXPOSURES_US.len(),
        "{} edges for {} pulses",
        edges.len(),
        EXPOSURES_US.len()
    );
    let (mut worst_ns, mut widths) = (0, Vec::new());
    for (pulse, &us) in edges.chunks_exact(2).zip(&EXPOSURES_US) {
        let width_ns = (pulse[1].0 - pulse[0].0) as i64;
        worst_ns = (width_ns - i64::from(us) * 1000).abs().max(worst_ns);
        widths.push(format!("{:.1}", width_ns as f64 * 1e-3));
    }
    let widths = widths.join(", ");
    ensure!(
        worst_ns <= TOLERANCE_NS,
        "pulses of {widths} µs for {EXPOSURES_US:?}"
    );
    let rises: Vec<u64> = edges
        .iter()
        .filter(|edge| edge.1)
        .map(|edge| edge.0)
        .collect();
    let stamps: Vec<u64> = rig.latches.iter().map(|latch| latch.time_us).collect();
    let late_ns = apart_ns(&rises, &stamps)?;
    Ok(format!(
        "pulses of {widths} µs, stamped within {late_ns} ns"
    ))
}

/// A train that the other arm gives.
pub fn follows(rig: &mut Rig) -> Result<String> {
    rig.latches.clear();
    let id = rig.begin(&request(TriggerRole::Follower))?;
    let mut rises = Vec::new();
    for us in EXPOSURES_US {
        // Not in step with the control ticks.
        rig.run_us(2_777)?;
        rises.push(rig.now_us() * 1000);
        rig.act(Command::TriggerIn(true))?;
        rig.run_us(u64::from(us))?;
        rig.act(Command::TriggerIn(false))?;
    }
    let outcome = rig.outcome(id, 1_000_000)?;
    ensure!(outcome == RequestOutcome::Done, "it ended as {outcome:?}");
    let stamps: Vec<u64> = rig.latches.iter().map(|latch| latch.time_us).collect();
    let late_ns = apart_ns(&rises, &stamps)?;
    Ok(format!("{} captured within {late_ns} ns", stamps.len()))
}

/// How far the differences of time stamps are from those of edges, ns. The chip's clock began at its start.
fn apart_ns(edges_ns: &[u64], stamps_us: &[u64]) -> Result<i64> {
    ensure!(
        edges_ns.len() == stamps_us.len(),
        "{} latches for {} pulses",
        stamps_us.len(),
        edges_ns.len()
    );
    let (Some(&edge), Some(&stamp)) = (edges_ns.first(), stamps_us.first()) else {
        return Ok(0);
    };
    let apart = edges_ns
        .iter()
        .zip(stamps_us)
        .map(|(&at, &us)| ((at as i64 - edge as i64) - (us as i64 - stamp as i64) * 1000).abs());
    let worst = apart.max().unwrap_or(0);
    ensure!(
        worst <= TOLERANCE_NS,
        "time stamps are up to {worst} ns off"
    );
    Ok(worst)
}
