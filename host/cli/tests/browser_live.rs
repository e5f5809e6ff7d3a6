//! The live page in a real browser: the map fills, and its button pauses the session.
//!
//! `cargo xtask test` runs this where Chromium is or can be had; `GONIA_BROWSER` names the program. With
//! `GONIA_PICTURES` a folder, it leaves pictures of the page there.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

#[path = "common/devtools.rs"]
mod devtools;
#[path = "common/session.rs"]
mod session;
#[path = "common/watched.rs"]
mod watched;

use devtools::Page;
use serde_json::json;
use session::{small_rig, write_small};
use std::path::Path;
use std::time::Duration;
use watched::Watched;

const WIDE: [u32; 2] = [1200, 900];
const PHONE: [u32; 2] = [390, 844];
const MAP: &str = "document.getElementById('light').toDataURL()";

fn text_of(id: &str) -> String {
    format!("document.getElementById('{id}').textContent")
}

#[test]
#[ignore = "needs a browser; cargo xtask test runs it"]
// long: one session, watched from its first pose to its end.
fn the_page_opens_without_an_error_its_map_fills_and_its_button_pauses() {
    let folder = tempfile::tempdir().unwrap();
    let mut rig = small_rig();
    rig.session.as_mut().unwrap().reference = false;
    write_small(folder.path(), &rig, 2000);
    let watched = Watched::start(folder.path());
    let address = format!("http://{}/#token={}", watched.address, watched.token);
    let mut page = Page::open(&address, WIDE);
    let (phase, hold) = (text_of("phase"), text_of("hold"));

    // It fills.
    page.until(&format!(
        "{phase} === 'measuring' && Number({}) > 5",
        text_of("done")
    ));
    let before = page.evaluate(MAP);
    page.until(&format!("{MAP} !== '{}'", before.as_str().unwrap()));
    for id in ["frame", "slice"] {
        page.until(&format!(
            "!document.getElementById('{id}').hidden && document.getElementById('{id}').naturalWidth > 0"
        ));
    }
    // The token went behind the #, and is not left there.
    assert_eq!(page.evaluate("location.hash"), json!(""));

    // It pauses, and goes on.
    assert_eq!(page.evaluate(&hold), json!("Pause"));
    page.click("hold");
    page.until(&format!("{phase} === 'held' && {hold} === 'Go on'"));
    let done = page.evaluate(&text_of("done"));
    std::thread::sleep(Duration::from_millis(600));
    assert_eq!(page.evaluate(&text_of("done")), done);
    if let Ok(pictures) = std::env::var("GONIA_PICTURES") {
        for (name, scheme, size) in [
            ("light", "light", WIDE),
            ("dark", "dark", WIDE),
            ("phone", "light", PHONE),
            ("phone_dark", "dark", PHONE),
        ] {
            page.look(scheme, size);
            std::thread::sleep(Duration::from_millis(300));
            page.picture(&Path::new(&pictures).join(format!("{name}.png")));
        }
    }
    // Nothing sticks out of a telephone.
    page.look("dark", PHONE);
    page.until("document.documentElement.scrollWidth <= innerWidth");
    page.click("hold");
    page.until(&format!(
        "{phase} === 'measuring' && {} !== '{}'",
        text_of("done"),
        done.as_str().unwrap()
    ));

    // Somebody without the token is asked for it, and the session does not hear of the order.
    let mut stranger = Page::open(&format!("http://{}/", watched.address), PHONE);
    stranger.until(&format!("{phase} === 'measuring'"));
    stranger.click("hold");
    stranger.until(&format!(
        "{}.includes('token is needed')",
        text_of("answer")
    ));
    assert_eq!(stranger.evaluate(&phase), json!("measuring"));
    // The browser itself notes that an order was refused; nothing else went wrong.
    let others = |f: &&String| !f.contains("403");
    assert_eq!(
        stranger.failures.iter().filter(others).count(),
        0,
        "{:?}",
        stranger.failures
    );
    stranger.evaluate(&format!(
        "(() => {{ const t = document.getElementById('token'); t.value = '{}'; \
         t.dispatchEvent(new Event('input')); }})()",
        watched.token
    ));
    stranger.evaluate("window.confirm = () => true; 0");
    stranger.click("end");
    page.until(&format!("{phase} === 'ended: paused'"));
    let (success, errors) = watched.finish();
    assert!(
        !success && errors.contains("from the live page"),
        "{errors}"
    );
    assert!(page.failures.is_empty(), "{:?}", page.failures);
}
