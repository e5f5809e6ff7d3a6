//! A browser that a test drives through its developer tools, over a pair of pipes.

use serde_json::{Value, json};
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// The browser does not take longer than this over anything.
const PATIENCE: Duration = Duration::from_secs(30);

/// A page in a browser without a window.
pub struct Page {
    child: Child,
    to: File,
    answers: Receiver<Value>,
    session: Option<String>,
    next: u64,
    /// Whatever went wrong on the page.
    pub failures: Vec<String>,
    _folder: tempfile::TempDir,
}

impl Page {
    /// Opens an address in a window of so many pixels.
    pub fn open(address: &str, [width, height]: [u32; 2]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let [to, from] = ["to", "from"].map(|name| folder.path().join(name));
        let made = Command::new("mkfifo").args([&to, &from]).status().unwrap();
        assert!(made.success());
        let browser = std::env::var("GONIA_BROWSER").unwrap_or_else(|_| "chromium".into());
        let child = Command::new("sh")
            .args(["-c", "exec \"$@\" 3<\"$0/to\" 4>\"$0/from\""])
            .arg(folder.path())
            .arg(browser)
            .args([
                "--headless",
                "--remote-debugging-pipe",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-quic",
                "--no-first-run",
                "--disable-background-networking",
                "--disable-component-update",
                "--disable-sync",
            ])
            .arg(format!(
                "--user-data-dir={}",
                folder.path().join("p").display()
            ))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // Each waits for its other end, in this order.
        let to = File::options().write(true).open(to).unwrap();
        let from = File::open(from).unwrap();
        let (tell, answers) = channel();
        std::thread::spawn(move || {
            for message in BufReader::new(from).split(0).map_while(Result::ok) {
                if tell
                    .send(serde_json::from_slice(&message).unwrap())
                    .is_err()
                {
                    return;
                }
            }
        });
        let mut page = Self {
            child,
            to,
            answers,
            session: None,
            next: 0,
            failures: Vec::new(),
            _folder: folder,
        };
        let target = page.command("Target.createTarget", json!({"url": "about:blank"}));
        let attach = json!({"targetId": target["targetId"], "flatten": true});
        let session = page.command("Target.attachToTarget", attach);
        page.session = session["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page", "Runtime", "Log"] {
            page.command(&format!("{domain}.enable"), json!({}));
        }
        let size =
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        page.command("Emulation.setDeviceMetricsOverride", size);
        page.command("Page.navigate", json!({"url": address}));
        page.until("document.readyState === 'complete'");
        page
    }

    /// What a script gives.
    pub fn evaluate(&mut self, script: &str) -> Value {
        let given = json!({"expression": script, "returnByValue": true, "awaitPromise": true});
        let answer = self.command("Runtime.evaluate", given);
        assert!(
            answer.get("exceptionDetails").is_none(),
            "{script}: {answer}"
        );
        answer["result"]["value"].clone()
    }

    /// Waits until a script gives true.
    pub fn until(&mut self, script: &str) {
        let began = Instant::now();
        while self.evaluate(script) != json!(true) {
            assert!(began.elapsed() < PATIENCE, "{script} stays false");
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Clicks in the middle of an element.
    pub fn click(&mut self, id: &str) {
        let place = self.evaluate(&format!(
            "(() => {{ const e = document.getElementById('{id}'); e.scrollIntoView(); \
             const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; }})()"
        ));
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({"type": kind, "x": place[0], "y": place[1], "button": "left", "clickCount": 1});
            self.command("Input.dispatchMouseEvent", event);
        }
    }

    /// Light or dark, and another size.
    pub fn look(&mut self, scheme: &str, [width, height]: [u32; 2]) {
        let feature = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        self.command("Emulation.setEmulatedMedia", feature);
        let size =
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.command("Emulation.setDeviceMetricsOverride", size);
    }

    /// The whole page as a PNG.
    pub fn picture(&mut self, path: &Path) {
        use base64::Engine as _;
        let whole = json!({"captureBeyondViewport": true});
        let answer = self.command("Page.captureScreenshot", whole);
        let png = base64::engine::general_purpose::STANDARD
            .decode(answer["data"].as_str().unwrap())
            .unwrap();
        std::fs::write(path, png).unwrap();
    }

    fn command(&mut self, method: &str, parameters: Value) -> Value {
        self.next += 1;
        let mut message = json!({"id": self.next, "method": method, "params": parameters});
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        self.to
            .write_all(format!("{message}\0").as_bytes())
            .unwrap();
        loop {
            let answer = self.answers.recv_timeout(PATIENCE).unwrap();
            match answer["method"].as_str() {
                Some("Runtime.exceptionThrown") => self.failures.push(answer.to_string()),
                Some("Log.entryAdded") if answer["params"]["entry"]["level"] == "error" => {
                    self.failures.push(answer.to_string());
                }
                _ => {}
            }
            if answer["id"] == json!(self.next) {
                assert!(answer.get("error").is_none(), "{method}: {answer}");
                return answer["result"].clone();
            }
        }
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
