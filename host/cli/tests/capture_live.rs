//! The live page as a browser asks for it, and what it must not do to a session.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;
#[path = "common/session.rs"]
mod session;
#[path = "common/watched.rs"]
mod watched;

use common::{gonia, text};
use session::{small_rig, write_small};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};
use watched::Watched;

const POSES: usize = 20;

/// One request; status and body.
fn ask(address: &str, request: &str, headers: &[(&str, &str)]) -> (u16, String) {
    let mut stream = TcpStream::connect(address).unwrap();
    let mut head = format!("{request} HTTP/1.1\r\nConnection: close\r\n");
    if !headers.iter().any(|(name, _)| *name == "Host") {
        head += &format!("Host: {address}\r\n");
    }
    for (name, value) in headers {
        head += &format!("{name}: {value}\r\n");
    }
    stream.write_all((head + "\r\n").as_bytes()).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let answer = String::from_utf8_lossy(&answer).into_owned();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    (head[9..12].parse().unwrap(), body.to_owned())
}

/// The whole state, once it says what is waited for.
fn state_with(address: &str, said: &str) -> String {
    let began = Instant::now();
    loop {
        let (status, body) = ask(address, "GET /state.json", &[]);
        assert_eq!(status, 200);
        if body.contains(said) {
            return body;
        }
        assert!(began.elapsed() < Duration::from_secs(20), "{said}: {body}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn done_of(state: &str) -> usize {
    let after = state.split("\"done\":").nth(1).unwrap();
    after.split(',').next().unwrap().parse().unwrap()
}

fn samples(folder: &Path) -> Vec<u8> {
    std::fs::read(folder.join("s/samples.npy")).unwrap()
}

#[test]
fn a_session_that_is_watched_paused_and_gone_on_with_gives_the_samples_of_one_left_alone() {
    let alone = tempfile::tempdir().unwrap();
    write_small(alone.path(), &small_rig(), POSES);
    let at = |name: &str| alone.path().join(name).to_str().unwrap().to_owned();
    let (s, rig, plan) = (at("s"), at("rig.toml"), at("plan.csv"));
    common::gonia_ok(&["capture", &s, "--rig", &rig, "--plan", &plan], "");

    let folder = tempfile::tempdir().unwrap();
    write_small(folder.path(), &small_rig(), POSES);
    let watched = Watched::start(folder.path());
    let (address, token) = (watched.address.as_str(), watched.token.as_str());
    // Before the first pose, so that it holds there, whatever this machine is busy with.
    let with_token = [("X-Gonia-Token", token)];
    assert_eq!(ask(address, "POST /pause", &with_token).0, 204);

    // One that takes in everything, and some that take in nothing.
    let mut events = TcpStream::connect(address).unwrap();
    let request = format!("GET /events HTTP/1.1\r\nHost: {address}\r\n\r\n");
    events.write_all(request.as_bytes()).unwrap();
    let reader = std::thread::spawn(move || {
        let mut all = Vec::new();
        // Reset or closed: the session is over.
        let _ = events.read_to_end(&mut all);
        String::from_utf8_lossy(&all).into_owned()
    });
    let _stalled = [(); 8].map(|()| {
        let mut stalled = TcpStream::connect(address).unwrap();
        stalled.write_all(request.as_bytes()).unwrap();
        stalled
    });

    let (status, page) = ask(address, "GET /", &[]);
    assert!(status == 200 && page.starts_with("<!DOCTYPE html>"));
    let strange = ask(address, "GET /", &[("Host", "evil.example")]);
    assert!(
        strange.0 == 403 && !strange.1.contains("html"),
        "{}",
        strange.1
    );
    for headers in [
        &[][..],
        &[("X-Gonia-Token", "0123")],
        &[with_token[0], ("Origin", "http://evil.example")],
    ] {
        for order in ["pause", "resume", "end"] {
            let refused = ask(address, &format!("POST /{order}"), headers);
            assert_eq!(refused.0, 403, "{order}: {}", refused.1);
        }
    }
    assert_eq!(ask(address, "GET /resume", &with_token).0, 405);
    assert_eq!(ask(address, "GET /nothing", &[]).0, 404);

    let held = state_with(address, "\"phase\":\"held\"");
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(done_of(&state_with(address, "held")), done_of(&held));
    assert_eq!(ask(address, "POST /resume", &with_token).0, 204);
    state_with(address, "\"frame\":{");
    assert_eq!(ask(address, "POST /pause", &with_token).0, 204);
    // In the middle of it: held means that the last shot's frame is kept too.
    let held = state_with(address, "\"phase\":\"held\"");
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(done_of(&state_with(address, "held")), done_of(&held));
    for picture in ["frame", "slice"] {
        let (status, body) = ask(address, &format!("GET /{picture}.png"), &[]);
        assert!(status == 200 && body.contains("PNG"), "{picture}");
    }
    assert_eq!(ask(address, "POST /resume", &with_token).0, 204);
    let output = watched.finish();
    assert!(output.0, "{}", output.1);
    assert!(samples(folder.path()) == samples(alone.path()));

    let told = reader.join().unwrap();
    let updates = told.matches("\ndata: {").count() + told.matches("\r\ndata: {").count();
    assert!(updates >= 3, "{told}");
    assert_eq!(told.matches("\"whole\":").count(), 1);
    assert!(
        told.contains("\"ended\":[\"finished\",\"every pose is done\"]"),
        "{told}"
    );
}

#[test]
fn an_order_to_end_ends_the_session_at_the_next_pose() {
    let folder = tempfile::tempdir().unwrap();
    write_small(folder.path(), &small_rig(), 400);
    let watched = Watched::start(folder.path());
    let token = [("X-Gonia-Token", watched.token.as_str())];
    state_with(&watched.address, "\"phase\":\"measuring\"");
    assert_eq!(ask(&watched.address, "POST /end", &token).0, 204);
    let (success, errors) = watched.finish();
    assert!(
        !success && errors.contains("poses: from the live page"),
        "{errors}"
    );
    let verdict = gonia_acquire::session::verify(&folder.path().join("s")).unwrap();
    assert_eq!((verdict.kills, verdict.broken().count()), (0, 0));
}

#[test]
fn an_address_that_is_taken_or_open_to_others_is_refused_before_anything_begins() {
    let folder = tempfile::tempdir().unwrap();
    write_small(folder.path(), &small_rig(), POSES);
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = taken.local_addr().unwrap().to_string();
    let s = folder.path().join("s");
    for (address, said) in [
        (taken.as_str(), "give another port"),
        ("0.0.0.0:0", "could be seen from other computers"),
        ("192.0.2.7:8080", "could be seen from other computers"),
    ] {
        let rig = folder.path().join("rig.toml");
        let command = ["capture", text(&s), "--rig", text(&rig), "--serve", address];
        let output = gonia(&command, "");
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{errors}");
        assert!(
            errors.lines().count() == 1 && errors.contains(said),
            "{errors}"
        );
    }
    assert!(!s.exists());
}
