//! Whole sessions: the host's capture over the real codec, the real firmware core, the simulated
//! plant, in virtual time.

#![allow(clippy::unwrap_used)]

use gonia_acquire::capture::{
    Arms, POINTING_LIMIT_DEG, SETTLE_TIME_S, SessionSummary, Shot, ShotOutcome, move_time_s,
    nearest_turn_deg, run_session,
};
use gonia_brdf::Pose;
use gonia_protocol::settings::Axis;
use gonia_sim::fault::{Arm, FaultPlan, WireFaults};
use gonia_sim::rig::SimRig;
use gonia_tests::poses::{of_the_paper, scattered, true_error_deg};

/// What a session brought, and where the arms truly were at each kept shot.
struct Session {
    rig: SimRig,
    shots: Vec<(Shot, Pose)>,
    refused: Vec<String>,
    summary: SessionSummary,
}

fn run(seed: u64, faults: FaultPlan, poses: &[Pose]) -> Session {
    let rig = SimRig::new(seed, faults);
    let port = |arm| Box::new(rig.port(arm));
    let mut arms = Arms::connect(port(Arm::Light), port(Arm::Camera)).unwrap();
    let (mut shots, mut refused) = (Vec::new(), Vec::new());
    let summary = run_session(&mut arms, poses, &mut |outcome| {
        match outcome {
            ShotOutcome::Kept(shot) => shots.push((shot, rig.true_pose_at_last_trigger().unwrap())),
            ShotOutcome::Refused { reason, .. } => refused.push(reason),
        }
        Ok(())
    })
    .unwrap();
    Session {
        rig,
        shots,
        refused,
        summary,
    }
}

#[test]
fn without_faults_every_pose_is_kept_and_truly_there() {
    let poses = scattered(150);
    let session = run(7, FaultPlan::default(), &poses);
    assert_eq!(session.refused, Vec::<String>::new());
    assert_eq!(session.shots.len(), poses.len());
    for (i, (shot, truth)) in session.shots.iter().enumerate() {
        assert_eq!(shot.index, i);
        assert!(shot.pointing_error_deg <= 0.01, "{shot:?}");
        let error = true_error_deg(&poses[i], truth);
        assert!(error <= POINTING_LIMIT_DEG, "pose {i}: {error}");
        // The host sees encoders, which are not the truth.
        assert_ne!(shot.encoder, *truth);
    }
    assert_eq!(
        (
            session.summary.events_lost,
            session.summary.requests_repeated
        ),
        (0, 0)
    );
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let faults = || FaultPlan {
        wire: WireFaults {
            flip: 1e-3,
            ..WireFaults::default()
        },
        ..FaultPlan::default()
    };
    let poses = scattered(10);
    let traces: Vec<u64> = [1, 1, 2]
        .map(|seed| run(seed, faults(), &poses).rig.trace())
        .to_vec();
    assert_eq!(traces[0], traces[1]);
    assert_ne!(traces[0], traces[2]);
}

/// `cargo xtask figures pointing` writes its figures into the book.
#[test]
#[ignore = "takes a minute; prints figures"]
fn material_and_reference_of_the_papers_plan_are_measured() {
    let mut poses = of_the_paper();
    poses.extend(poses.clone());
    let began = std::time::Instant::now();
    let session = run(1, FaultPlan::default(), &poses);
    let seconds = began.elapsed().as_secs_f64();
    let mut errors: Vec<f64> = session
        .shots
        .iter()
        .map(|(shot, truth)| true_error_deg(&poses[shot.index], truth))
        .collect();
    errors.sort_by(f64::total_cmp);
    println!("{:?}", session.summary);
    println!(
        "{} poses, {:.2} h virtual, {seconds:.1} s; true error p50 {:.4}° p99 {:.4}° max {:.4}°",
        poses.len(),
        session.summary.duration_us as f64 / 3.6e9,
        errors[errors.len() / 2],
        errors[errors.len() * 99 / 100],
        errors[errors.len() - 1],
    );
    assert_eq!(session.shots.len(), poses.len());
    assert!(errors[errors.len() - 1] <= POINTING_LIMIT_DEG);
}

#[test]
fn the_planners_times_are_those_of_the_arms() {
    let poses = scattered(60);
    let session = run(3, FaultPlan::default(), &poses);
    let triggers = session.rig.triggers();
    let mut predicted_s = 0.0;
    let mut phi = [triggers[0].light_deg[1], triggers[0].camera_deg[1]];
    for pair in poses.windows(2) {
        let mut slowest_s: f64 = 0.0;
        let arms = [(pair[0].light, pair[1].light), (pair[0].view, pair[1].view)];
        for (phi, (from, to)) in phi.iter_mut().zip(arms) {
            let next = nearest_turn_deg(*phi, to.phi_deg(), [-185.0, 545.0]).unwrap();
            slowest_s = slowest_s
                .max(move_time_s(Axis::Phi, *phi, next))
                .max(move_time_s(Axis::Theta, from.theta_deg(), to.theta_deg()));
            *phi = next;
        }
        predicted_s += slowest_s + SETTLE_TIME_S;
    }
    let took_s = (triggers[59].time_us - triggers[0].time_us) as f64 * 1e-6;
    assert!(
        (took_s / predicted_s - 1.0).abs() < 0.05,
        "{took_s} {predicted_s}"
    );
}
