// The sliders: slices through the reduced BRDF, and a lit sphere. No library, no network.
"use strict";
(() => {
  const root = document.getElementById("explorer");
  if (!root) return;
  const meta = JSON.parse(document.getElementById("explorer-meta").textContent);
  const text = atob(document.getElementById("explorer-cells").textContent.trim());
  const nT = meta.thetaDeg.length, nP = meta.nPhi, n = nT * nP, stepP = 360 / nP;
  const rad = Math.PI / 180;

  // One byte a channel on a logarithmic scale; pairs (light ≤ view) only, the rest is their mirror.
  const level = Array.from({ length: 256 }, (_, k) =>
    meta.least * Math.pow(meta.most / meta.least, k / 255));
  const pairs = n * (n + 1) / 2;
  const bytes = new Uint8Array(3 * pairs);
  for (let k = 0; k < bytes.length; k++) bytes[k] = text.charCodeAt(k);
  const index = (a, b) => a <= b ? a * n - (a * (a - 1)) / 2 + (b - a) : index(b, a);

  // The four nodes around a direction (degrees), with their weights.
  function corners(theta, phi) {
    const ts = meta.thetaDeg;
    let t = Math.min(Math.max(theta, 0), ts[nT - 1]) / ts[1];
    let t0 = Math.min(Math.floor(t), nT - 2);
    t -= t0;
    let p = (((phi % 360) + 360) % 360) / stepP;
    const p0 = Math.floor(p) % nP, p1 = (p0 + 1) % nP;
    p -= Math.floor(p);
    return [[t0 * nP + p0, (1 - t) * (1 - p)], [t0 * nP + p1, (1 - t) * p],
            [(t0 + 1) * nP + p0, t * (1 - p)], [(t0 + 1) * nP + p1, t * p]];
  }
  const out = [0, 0, 0];
  function lookup(light, view) {
    out[0] = out[1] = out[2] = 0;
    for (const [i, wi] of light) for (const [v, wv] of view) {
      const w = wi * wv;
      if (w <= 0) continue;
      const at = 3 * index(i, v);
      for (let c = 0; c < 3; c++) out[c] += w * level[bytes[at + c]];
    }
    return out;
  }
  const srgb = v => {
    v = Math.min(Math.max(v, 0), 1);
    return 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * Math.pow(v, 1 / 2.4) - 0.055);
  };
  const el = id => document.getElementById(id);
  const value = id => Number(el(id).value);
  const show = (id, words) => { el(id + "-value").textContent = words; };

  // Slices: two of four angles are axes, the others have sliders.
  const names = ["θi", "φi", "θv", "φv"];
  const most = k => k % 2 ? 360 : meta.thetaDeg[nT - 1];
  function drawSlice() {
    const x = value("axis-x"), y = value("axis-y");
    const rest = [0, 1, 2, 3].filter(k => k !== x && k !== y);
    const fixed = [value("rest-a"), value("rest-b")].map((share, j) => share * most(rest[j]));
    rest.forEach((k, j) => {
      el(["rest-a", "rest-b"][j] + "-name").textContent = names[k];
      show(["rest-a", "rest-b"][j], fixed[j].toFixed(0) + "°");
    });
    const canvas = el("slice"), g = canvas.getContext("2d");
    const W = canvas.width, left = 84, top = 14, side = W - left - 30;
    const style = getComputedStyle(root);
    g.clearRect(0, 0, W, canvas.height);
    const size = 180, image = g.createImageData(size, size), angle = [0, 0, 0, 0];
    rest.forEach((k, j) => { angle[k] = fixed[j]; });
    const gain = Math.pow(2, value("slice-exposure")) / meta.white;
    show("slice-exposure", "white at " + (1 / gain).toPrecision(3) + meta.unit);
    for (let row = 0; row < size; row++) for (let col = 0; col < size; col++) {
      angle[x] = (col + 0.5) / size * most(x);
      angle[y] = (1 - (row + 0.5) / size) * most(y);
      const f = lookup(corners(angle[0], angle[1]), corners(angle[2], angle[3]));
      const at = 4 * (row * size + col);
      for (let c = 0; c < 3; c++) image.data[at + c] = srgb(f[c] * gain);
      image.data[at + 3] = 255;
    }
    const small = document.createElement("canvas");
    small.width = small.height = size;
    small.getContext("2d").putImageData(image, 0, 0);
    g.imageSmoothingEnabled = false;
    g.drawImage(small, left, top, side, side);
    g.strokeStyle = style.getPropertyValue("--line");
    g.strokeRect(left, top, side, side);
    g.fillStyle = style.getPropertyValue("--ink");
    g.font = "19px system-ui, sans-serif";
    const ticks = k => k % 2 ? [0, 90, 180, 270, 360] : [0, 15, 30, 45, 60, 75];
    g.textAlign = "center";
    for (const t of ticks(x)) {
      const at = left + t / most(x) * side;
      g.fillRect(at, top + side, 1, 7);
      g.fillText(t + "°", at, top + side + 26);
    }
    g.fillText(names[x], left + side / 2, top + side + 50);
    g.textAlign = "right";
    for (const t of ticks(y)) {
      const at = top + side - t / most(y) * side;
      g.fillRect(left - 7, at, 7, 1);
      g.fillText(t + "°", left - 9, at + 6);
    }
    g.save();
    g.translate(20, top + side / 2);
    g.rotate(-Math.PI / 2);
    g.textAlign = "center";
    g.fillText(names[y], 0, 0);
    g.restore();
  }

  // A sphere under one light and a dim one from the viewer.
  function drawSphere() {
    const az = value("light-azimuth"), up = value("light-height"), turn = value("material-turn");
    show("light-azimuth", az + "°"); show("light-height", up + "°"); show("material-turn", turn + "°");
    const canvas = el("ball"), g = canvas.getContext("2d"), W = canvas.width;
    const image = g.createImageData(W, W);
    const cu = Math.cos(up * rad);
    const lights = [
      [[cu * Math.sin(az * rad), Math.sin(up * rad), cu * Math.cos(az * rad)], 1],
      [[0, 0.2, 0.98], 0.12]];
    const gain = 0.9 * Math.pow(2, value("ball-exposure")) / meta.white;
    show("ball-exposure", (value("ball-exposure") >= 0 ? "+" : "") + value("ball-exposure") + " stops");
    const ct = Math.cos(turn * rad), st = Math.sin(turn * rad);
    const angles = (v, t, b, normal) => {
      const a = v[0] * t[0] + v[1] * t[1] + v[2] * t[2], c = v[0] * b[0] + v[1] * b[1] + v[2] * b[2];
      const z = v[0] * normal[0] + v[1] * normal[1] + v[2] * normal[2];
      const lx = a * ct + c * st, ly = c * ct - a * st;
      return [z, Math.acos(Math.min(1, Math.max(-1, z))) / rad, Math.atan2(ly, lx) / rad];
    };
    for (let row = 0; row < W; row++) for (let col = 0; col < W; col++) {
      const x = (2 * (col + 0.5) / W - 1) / 0.97, y = -(2 * (row + 0.5) / W - 1) / 0.97;
      const z2 = 1 - x * x - y * y, at = 4 * (row * W + col);
      if (z2 <= 0) continue;
      const z = Math.sqrt(z2), s = 1 / Math.hypot(x, z);
      const normal = [x, y, z], t = [z * s, 0, -x * s];
      const b = [-x * y * s, (x * x + z * z) * s, -y * z * s];
      const view = angles([0, 0, 1], t, b, normal), seen = corners(view[1], view[2]);
      const sum = [0, 0, 0];
      for (const [towards, strength] of lights) {
        const light = angles(towards, t, b, normal);
        if (light[0] <= 0.001) continue;
        const f = lookup(corners(light[1], light[2]), seen), e = strength * light[0];
        for (let c = 0; c < 3; c++) sum[c] += f[c] * e;
      }
      for (let c = 0; c < 3; c++) image.data[at + c] = srgb(sum[c] * gain * 2);
      image.data[at + 3] = Math.min(255, 255 * z2 * W / 6);
    }
    g.putImageData(image, 0, 0);
  }

  function soon(draw) {
    let waits = false;
    return () => {
      if (waits) return;
      waits = true;
      requestAnimationFrame(() => { waits = false; draw(); });
    };
  }
  const slice = soon(drawSlice), ball = soon(drawSphere);
  for (const id of ["axis-x", "axis-y"]) el(id).addEventListener("change", event => {
    // Both axes the same makes no picture: the other one moves on.
    const other = el(id === "axis-x" ? "axis-y" : "axis-x");
    if (other.value === event.target.value) other.value = String((Number(other.value) + 1) % 4);
    slice();
  });
  for (const id of ["rest-a", "rest-b", "slice-exposure"]) el(id).addEventListener("input", slice);
  for (const id of ["light-azimuth", "light-height", "material-turn", "ball-exposure"])
    el(id).addEventListener("input", ball);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", slice);
  drawSlice();
  drawSphere();
  root.classList.add("ready");
})();
