// The page: its connection, the picture, the curves, the effects.

import { Driver } from "./drive.js";
import { Plot, nice } from "./plots.js";

const WINDOW_S = 8; // length of the past in the curves of a drive
const WHEELS = ["front left", "front right", "rear left", "rear right"];
const byId = (id) => document.getElementById(id);
let socket = null, driver = null, plots = [], camera = null;
let past = { time: [] }, limit = 100, log = null, looked = null;

const send = (message) => { if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message)); };

function connect() {
  socket = new WebSocket(`ws://${location.host}${location.pathname}live`);
  socket.binaryType = "blob";
  socket.onopen = () => { byId("state").textContent = "connected"; };
  socket.onclose = () => {
    byId("state").textContent = "the program that showed this page has ended";
    setTimeout(connect, 2000);
  };
  socket.onmessage = ({ data }) => {
    if (data instanceof Blob) { show(data); return; }
    const message = JSON.parse(data);
    ({ hello, motion, effects, reset: clear, note })[message.type]?.(message);
  };
}

function show(blob) {
  const picture = byId("picture"), address = URL.createObjectURL(blob);
  picture.onload = picture.onerror = () => { URL.revokeObjectURL(address); send({ type: "seen" }); };
  picture.src = address;
}

function note({ text }) {
  byId("note").textContent = text;
  byId("note").hidden = false;
  clearTimeout(note.timer);
  note.timer = setTimeout(() => { byId("note").hidden = true; }, 8000);
}

function hello(message) {
  const replay = message.mode === "replay";
  byId("title").textContent = replay ? `${message.log} and its simulation` : "The live robot";
  byId("scene").hidden = message.cameras.length === 0;
  byId("drive").hidden = replay;
  byId("time").hidden = !replay;
  if (camera === null || byId("camera").options.length !== message.cameras.length) {
    byId("camera").replaceChildren(...message.cameras.map((name) => new Option(name)));
    camera = message.camera;
    byId("camera").value = camera.name;
  }
  effects(message);
  byId(replay ? "left_column" : "right_column").append(byId("effects_box"));
  if (replay) { load(message); return; }
  limit = message.fastest_rpm;
  clear();
  driver ??= new Driver(send, message);
}

// ---- driving

function clear() {
  past = { time: [], sent: WHEELS.map(() => []), wheels: WHEELS.map(() => []) };
  byId("plots").replaceChildren();
  plots = WHEELS.map((name, i) => new Plot(byId("plots"), name, [
    { colour: "--commanded", stairs: true, values: past.sent[i] },
    { colour: "--actual", values: past.wheels[i] },
  ]));
  drawPast();
}

function motion(message) {
  message.time_s.forEach((t, row) => {
    past.time.push(t);
    WHEELS.forEach((_, i) => {
      past.sent[i].push(message.sent_rpm[row][i]);
      past.wheels[i].push(message.wheels_rpm[row][i]);
    });
  });
  const old = past.time.findIndex((t) => t >= past.time.at(-1) - WINDOW_S);
  if (old > 60) for (const column of [past.time, ...past.sent, ...past.wheels]) column.splice(0, old);
  const [v, theta, vc] = message.command, [vx, vy, rate] = message.twist, [x, y, yaw] = message.pose;
  const texts = {
    v: `${v.toFixed(0)} rpm`, theta: `${theta.toFixed(0)}°`, vc: `${vc.toFixed(0)} rpm`,
    vx: `${vx.toFixed(2)} m/s`, vy: `${vy.toFixed(2)} m/s`, rate: `${degrees(rate).toFixed(0)} °/s`,
    x: `${x.toFixed(2)} m`, y: `${y.toFixed(2)} m`, yaw: `${degrees(yaw).toFixed(0)}°`,
  };
  for (const [id, text] of Object.entries(texts)) byId(id).textContent = text;
  requestDraw(drawPast);
}

const degrees = (radians) => (radians * 180) / Math.PI;

function drawPast() {
  const end = Math.max(WINDOW_S, past.time.at(-1) ?? 0);
  plots.forEach((plot, i) => {
    const last = past.wheels[i].at(-1);
    plot.value.textContent = last === undefined ? "" : `${last.toFixed(1)} of ${past.sent[i].at(-1).toFixed(1)} rpm`;
    plot.draw(past.time, end - WINDOW_S, end, limit);
  });
}

function requestDraw(draw) {
  if (requestDraw.waiting) return;
  requestDraw.waiting = requestAnimationFrame(() => { requestDraw.waiting = 0; draw(); });
}

// ---- a log beside its simulation

function load(message) {
  const first = log === null;
  log = message;
  byId("curves_title").textContent = "Measured and simulated";
  byId("first_curve").textContent = "measured";
  byId("second_curve").textContent = "simulated";
  byId("third_curve").hidden = false;
  byId("ghosts").hidden = message.cameras.length === 0;
  byId("when").max = message.time_s.at(-1);
  byId("plots").replaceChildren();
  plots = message.channels.map(({ label, unit, rms, measured, simulated }) => {
    const difference = measured.map((value, i) => (value === null || simulated[i] === null ? null : value - simulated[i]));
    const plot = new Plot(byId("plots"), `${label} [${unit}]`, [
      { colour: "--commanded", values: measured },
      { colour: "--actual", values: simulated },
      { colour: "--difference", values: difference, own: true },
    ]);
    plot.canvas.style.height = "150px";
    plot.value.textContent = `rms ${Number(rms.toPrecision(3))}`;
    const all = [...measured, ...simulated].filter((value) => value !== null);
    plot.limit = nice(Math.max(1e-6, ...all.map(Math.abs)));
    plot.lowest = Math.min(...all) < -0.05 * plot.limit ? -plot.limit : 0;
    return plot;
  });
  if (first) {
    byId("when").addEventListener("input", () => look(Number(byId("when").value)));
    byId("play").addEventListener("click", () => play(byId("play").textContent === "play"));
  }
  look(Number(byId("when").value));
}

function look(seconds) {
  byId("when").value = seconds;
  byId("when_shown").textContent = `${seconds.toFixed(2)} of ${log.time_s.at(-1).toFixed(2)} s`;
  requestDraw(() => {
    const end = log.time_s.at(-1);
    for (const plot of plots) plot.draw(log.time_s, 0, end, plot.limit, looked, plot.lowest);
  });
  if (looked !== seconds) send({ type: "look", time_s: seconds });
  looked = seconds;
}

function play(on) {
  byId("play").textContent = on ? "pause" : "play";
  if (!on) return;
  let last = null;
  const end = log.time_s.at(-1);
  if (looked >= end - 0.01) look(0);
  const step = (now) => {
    if (byId("play").textContent === "play") return;
    look(Math.min(end, looked + (last === null ? 0 : (now - last) / 1000)));
    last = now;
    if (looked >= end) play(false);
    else requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}

// ---- effects and camera

function effects({ effects: rows }) {
  byId("effects").replaceChildren(...rows.map((row) => {
    const label = document.createElement("label"), box = document.createElement("input");
    const text = document.createElement("span"), why = document.createElement("small");
    Object.assign(box, { type: "checkbox", checked: row.on, disabled: row.why_not !== "", name: row.name });
    box.addEventListener("change", () => {
      byId("state").textContent = `${box.checked ? "on" : "off"}: ${row.name}`;
      send({ type: "effect", name: row.name, on: box.checked });
      box.blur();
    });
    text.textContent = row.label + (row.in_model ? ", in the model" : "");
    label.title = row.summary;
    label.classList.toggle("not", box.disabled);
    why.textContent = row.why_not;
    label.append(box, text, ...(row.why_not ? [why] : []));
    return label;
  }));
}

byId("camera").addEventListener("change", () => { look_from({ name: byId("camera").value }); byId("camera").blur(); });
const look_from = (change) => { Object.assign(camera, change); send({ type: "camera", ...camera }); };
const picture = byId("picture");
picture.addEventListener("pointermove", (event) => {
  if (event.buttons !== 1 || camera?.name !== "around") return;
  look_from({ azimuth: camera.azimuth - 0.4 * event.movementX, elevation: tilt(camera.elevation - 0.3 * event.movementY) });
});
const tilt = (elevation) => Math.min(-3, Math.max(-89, elevation));
picture.addEventListener("wheel", (event) => {
  event.preventDefault();
  const distance = camera.distance * Math.exp(0.001 * event.deltaY);
  look_from({ distance: Math.min(12, Math.max(0.8, distance)) });
}, { passive: false });
addEventListener("resize", () => (log ? look(looked) : drawPast()));

connect();
