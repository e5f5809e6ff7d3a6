// The live page: takes in what the session sends, draws it, and gives two orders.
"use strict";
(() => {
  const el = id => document.getElementById(id);
  const put = (id, text) => { el(id).textContent = text; };
  const count = n => n.toLocaleString("en");
  const TO_DO = 0, REFUSED = 3;

  // The token comes behind the #, which no browser sends; it is kept for this tab alone.
  let token = sessionStorage.getItem("token") || "";
  const given = /^#token=([0-9a-f]+)$/.exec(location.hash);
  if (given) {
    token = given[1];
    sessionStorage.setItem("token", token);
    history.replaceState(null, "", location.pathname);
  }
  el("ask").hidden = token !== "";
  el("token").addEventListener("input", event => { token = event.target.value.trim(); });

  let now = null;
  let whole = { plan: [] };
  let states = new Uint8Array(0);
  let maps = [];

  // One dot a direction; many poses share it.
  function directions(of) {
    const dots = new Map();
    const dotOfPose = whole.plan.map((pose, index) => {
      const [theta, phi] = of(pose);
      const key = theta.toFixed(2) + (theta < 0.005 ? "" : "," + phi.toFixed(2));
      if (!dots.has(key)) dots.set(key, { theta, phi, poses: [], done: 0, bad: 0 });
      dots.get(key).poses.push(index);
      return dots.get(key);
    });
    return { dots: [...dots.values()], dotOfPose };
  }
  function recount() {
    for (const map of maps) {
      for (const dot of map.dots) {
        dot.done = dot.bad = 0;
        for (const index of dot.poses) {
          if (states[index] !== TO_DO) dot.done++;
          if (states[index] >= REFUSED) dot.bad++;
        }
      }
    }
  }

  function draw(map) {
    const canvas = map.canvas, box = canvas.getBoundingClientRect();
    const ratio = devicePixelRatio || 1, size = Math.max(1, Math.round(box.width * ratio));
    if (canvas.width !== size || canvas.height !== size) canvas.width = canvas.height = size;
    const pen = canvas.getContext("2d"), style = getComputedStyle(document.documentElement);
    const ink = name => style.getPropertyValue("--" + name).trim();
    const radius = size / 2 - 30 * ratio;
    const at = (theta, phi) => {
      const r = radius * theta / 90, turn = phi * Math.PI / 180;
      return [size / 2 + r * Math.cos(turn), size / 2 - r * Math.sin(turn)];
    };
    // Not laid out yet.
    if (radius <= 0) return;
    pen.clearRect(0, 0, size, size);
    pen.lineWidth = ratio;
    pen.strokeStyle = ink("line");
    for (const theta of [30, 60, 90]) {
      pen.beginPath();
      pen.arc(size / 2, size / 2, radius * theta / 90, 0, 2 * Math.PI);
      pen.stroke();
    }
    pen.fillStyle = ink("soft");
    pen.font = 11 * ratio + "px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const beyond = 90 * (1 + 15 * ratio / radius);
    for (const phi of [0, 90, 180, 270]) pen.fillText(phi + "°", ...at(beyond, phi));
    const dotRadius = ratio * Math.max(2, Math.min(6.5, 90 / Math.sqrt(map.dots.length + 1)));
    for (const dot of map.dots) {
      const [x, y] = at(dot.theta, dot.phi), share = dot.done / dot.poses.length;
      pen.beginPath();
      pen.arc(x, y, dotRadius, 0, 2 * Math.PI);
      pen.fillStyle = ink("paper");
      pen.fill();
      pen.strokeStyle = dot.bad ? ink("bad") : share > 0 ? ink("bar") : ink("soft");
      pen.lineWidth = ratio * (dot.bad ? 2 : 1.2);
      pen.stroke();
      if (share > 0) {
        pen.beginPath();
        pen.moveTo(x, y);
        pen.arc(x, y, dotRadius, -Math.PI / 2, -Math.PI / 2 + 2 * Math.PI * share);
        pen.fillStyle = dot.bad ? ink("bad") : ink("bar");
        pen.fill();
      }
    }
    const here = now && now.current !== null && map.dotOfPose[now.current];
    if (here) {
      pen.beginPath();
      pen.arc(...at(here.theta, here.phi), dotRadius + 3.5 * ratio, 0, 2 * Math.PI);
      pen.strokeStyle = ink("mark");
      pen.lineWidth = 3 * ratio;
      pen.stroke();
    }
  }
  const drawAll = () => maps.forEach(draw);
  addEventListener("resize", drawAll);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);

  function duration(s) {
    if (s < 90) return s.toFixed(0) + " s";
    if (s < 5400) return (s / 60).toFixed(0) + " min";
    return (s / 3600).toFixed(1) + " h";
  }
  function show() {
    const n = now, soon = n.phase !== "measuring" ? "" : n.ends ? "ending" : n.held ? "pausing" : "";
    const word = n.ended ? n.ended[0] : soon || n.phase;
    put("phase", n.ended ? "ended: " + word : soon ? soon + " at the next pose" : word);
    el("phase").className = "pill " + word;
    put("what", whole.roles.length > 1 ? n.role + " of " + whole.roles.join(", then ") : n.role);
    el("reason").hidden = !n.ended;
    if (n.ended) put("reason", n.ended[1]);
    put("hold", n.held ? "Go on" : "Pause");
    el("hold").disabled = !!n.ended;
    el("end").disabled = !!n.ended || n.ends;

    put("done", count(n.done));
    put("done-what", "of " + count(n.planned) + " poses of the " + n.role + " done");
    put("left", n.left_s === null || n.ended ? "–" : duration(n.left_s));
    put("rate", "left" + (n.rate === null ? "" : n.rate < 1 ? ", " + (1 / n.rate).toFixed(1) + " s a pose"
      : ", " + n.rate.toFixed(1) + " poses a second"));
    put("pointing", n.last_deg.toFixed(4) + "°");
    put("pointing-what", "last pointing error; worst " + n.worst_deg.toFixed(4) + "°, limit " + whole.limit_deg + "°");
    put("bins", count(n.bins));
    put("bins-what", "bins filled (" + (100 * n.bins_share).toFixed(2) + " %), of " + count(n.samples) + " samples");

    if (n.frame) {
      const f = n.frame, marks = f.state === "locked"
        ? "found: lines within " + f.residual_px.toFixed(3) + " px, camera " + f.offset_deg.map(d => d.toFixed(4) + "°").join(" and ") + " from its reading (θ, φ)"
        : f.state === "refused" ? "refused: " + f.why : "at the arms' reading: " + f.why;
      picture("frame", "frame.png", f.version);
      put("frame-what", f.role + " pose " + f.index + ". Marks " + marks);
    }
    if (n.slice.filled > 0) {
      picture("slice", "slice.png", n.slice.version);
      put("slice-what", "θi = " + n.slice.theta_deg[0] + "°, θv = " + n.slice.theta_deg[1] + "°; φ of the view to the right, of the light upwards, 0 to 360°. "
        + (100 * n.slice.filled).toFixed(1) + " % of its bins are filled; dimmed: the nearest of them. Relative, under an ideal light.");
    }
    document.title = count(n.done) + " of " + count(n.planned) + " – " + whole.title + " – gonia";
    drawAll();
  }

  // One request a picture at a time, and no sooner than a second after the last.
  const pictures = {};
  function picture(id, address, version) {
    const image = el(id), p = pictures[id] ||= { shown: -1, wanted: -1, busy: false };
    p.wanted = version;
    if (p.busy || p.wanted === p.shown) return;
    p.busy = true;
    p.shown = p.wanted;
    const ended = ok => () => {
      image.hidden = !ok;
      setTimeout(() => { p.busy = false; picture(id, address, p.wanted); }, 1000);
    };
    image.onload = ended(true);
    image.onerror = ended(false);
    image.src = address + "?" + version;
  }

  function note(entry) {
    const item = document.createElement("li"), time = document.createElement("time");
    const at = new Date(entry.at_ms);
    time.dateTime = at.toISOString();
    time.textContent = at.toLocaleString("sv");
    item.append(time, entry.text);
    el("notes").prepend(item);
    while (el("notes").childElementCount > 200) el("notes").lastElementChild.remove();
    el("quiet").hidden = true;
  }

  function take(update) {
    const another = now && now.role !== update.role;
    now = update;
    if (update.whole) {
      whole = update.whole;
      states = new Uint8Array(whole.plan.length);
      maps = [["light", pose => pose.slice(0, 2)], ["view", pose => pose.slice(2)]]
        .map(([id, of]) => ({ canvas: el(id), ...directions(of) }));
      el("notes").textContent = "";
      put("title", whole.title);
      put("program", whole.program);
    }
    for (const [index, state] of update.poses) states[index] = state;
    if (update.whole || update.poses.length || another) recount();
    update.notes.forEach(note);
    show();
  }

  const events = new EventSource("events");
  events.onmessage = event => take(JSON.parse(event.data));
  events.onerror = () => {
    if (now && now.ended) { events.close(); return; }
    put("phase", "no connection to the session");
    el("phase").className = "pill lost";
    el("hold").disabled = el("end").disabled = true;
  };

  async function order(what) {
    put("answer", "");
    try {
      const answer = await fetch(what, { method: "POST", headers: { "x-gonia-token": token } });
      if (answer.status === 403) {
        el("ask").hidden = false;
        put("answer", "The token is needed: gonia capture printed it at its start.");
      } else if (answer.ok) {
        el("ask").hidden = true;
        sessionStorage.setItem("token", token);
      } else {
        put("answer", "The session answered " + answer.status + ".");
      }
    } catch {
      put("answer", "The session does not answer.");
    }
  }
  el("hold").addEventListener("click", () => order(now && now.held ? "resume" : "pause"));
  el("end").addEventListener("click", () => {
    if (confirm("End the session at the next pose? gonia capture --resume goes on later.")) order("end");
  });
})();
