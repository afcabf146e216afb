"use strict";
// News come as parts; the latest of each is kept in `live`, and drawn when the browser next draws.

const live = { parts: {}, trail: [], seen: 0, frames: 0, drawn: {}, undrawn: true };
const STALE_S = 1.0, AGAIN_MS = 500;
const $ = (id) => document.getElementById(id);
const token = location.hash.slice(1);

function put(id, text, kind = "") {
  const element = $(id);
  if (element.textContent !== text) element.textContent = text;
  if (element.className !== kind && element.tagName === "OUTPUT") element.className = kind;
}

function banner(id, text) {
  $(id).hidden = !text;
  if (text) put(id, text);
}

const percent = (share) => (share === null ? "-" : `${(100 * share).toFixed(0)} %`);
const theta = (values) => live.parts.learning.params.map((p, i) => `${p.symbol}  ${short(values[i])} ${p.unit}`);

// ---- news

function connect() {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/news`);
  socket.onmessage = ({ data }) => {
    const { part, data: value } = JSON.parse(data);
    live.parts[part] = value;
    live.seen = performance.now();
    if (part === "now") { live.frames += 1; follow(value); }
    (SHOW[part] || (() => {}))(value);
  };
  socket.onclose = () => setTimeout(connect, AGAIN_MS);
}

// The trail is that of one flight: it begins anew when the vehicle leaves the floor, or a replay begins again.
function follow(now) {
  const moment = now.vehicle || now.replay, before = live.moment;
  if (moment && moment.p_W_m[0] !== null) {
    const jumped = before && Math.hypot(...moment.p_W_m.map((value, i) => value - before.p_W_m[i])) > 0.5;
    const begins = before && now.vehicle && now.vehicle.flies && !before.flies;
    if (jumped || begins || !before) live.trail = [];
    live.trail.push(moment.p_W_m);
    if (live.trail.length > TRAIL_MAX) live.trail.shift();
    live.moment = moment;
    live.undrawn = true;
  }
}

const SHOW = {
  room(room) {
    live.undrawn = true;
    put("experiment", room.site ? `${room.experiment} at ${room.site.name}` : room.experiment);
    document.title = `ivl: ${room.experiment}`;
  },
  stream: (url) => put("stream", url),
  log(lines) {
    const box = $("log"), atEnd = box.scrollHeight - box.scrollTop - box.clientHeight < 30;
    put("log", lines.join("\n"));
    if (atEnd) box.scrollTop = box.scrollHeight;
  },
  now(now) {
    put("clock", now.clock);
    put("stage", now.stage);
    banner("asked", now.asked && `At the terminal: ${now.asked.trim()}`);
    if (now.vehicle) showVehicle(now.vehicle); else showNoVehicle(now);
    showStop(now);
    document.body.dataset.ready = "true";
  },
  learning: showLearning,
  upcoming: () => live.parts.learning && showNext(live.parts.learning),
  landing: showLanding,
};

// ---- the vehicle

function showVehicle(v) {
  put("phase", v.phase, v.phase === "aborted" ? "bad" : v.flies ? "good" : "");
  put("rule", v.stopped || (v.rule && `rule: ${v.rule}`) || (v.cause && `ended by: ${v.cause}`) || (v.flies ? "flying" : "motors off"));
  const limits = live.parts.room && live.parts.room.site ? live.parts.room.site.battery : null;
  const low = limits && v.battery_V < limits.load_V_min, tired = limits && v.battery_V < limits.rest_V_min;
  put("battery", v.battery_V === null ? "-" : `${v.battery_V.toFixed(2)} V`, low ? "bad" : tired && !v.flies ? "fair" : "good");
  put("battery-note", limits ? `change below ${limits.rest_V_min.toFixed(2)} V at rest` : "");
  showTracking(v);
  const lost = v.link.lost_share, silent = v.link.silence_s > 0.5;
  put("link", silent ? `silent ${v.link.silence_s.toFixed(1)} s` : `${percent(lost)} lost`, silent || lost > 0.15 ? "bad" : lost > 0.05 ? "fair" : "good");
  put("link-note", `answers in ${short(v.link.p95_ms)} ms, 95 % of them`);
  showPose(v, v.sigma_m === null ? "" : `± ${(1000 * v.sigma_m).toFixed(0)} mm`);
  put("pose-note", `estimate of the vehicle at ${v.uri}`);
}

function showTracking(v) {
  const t = v.tracking;
  if (t) {
    put("tracking", t.status, t.status === "good" ? "good" : "bad");
    put("tracking-note", t.status === "good" ? `${short(t.rate_hz)} Hz, 99 % within ${short(t.interval_p99_ms)} ms` : t.text);
  } else {
    put("tracking", v.sigma_m === null ? "-" : `± ${(1000 * v.sigma_m).toFixed(0)} mm`, v.sigma_m < 0.1 ? "good" : "bad");
    put("tracking-note", "by the estimate; no cameras here");
  }
}

function showNoVehicle(now) {
  const replay = now.replay;
  const { learning } = live.parts, done = Boolean(learning) && learning.n_flown >= learning.n_all;
  const lost = !now.in_process && !done && Boolean(live.moment);
  const waits = done ? "all flown" : lost ? "not connected" : "preparing";
  put("phase", replay ? replay.phase : now.in_process ? "simulating" : waits, lost ? "bad" : "");
  put("rule", replay ? `replay of rollout ${replay.number}, a quarter of the speed` : "");
  put("battery", replay && replay.battery_V !== null ? `${replay.battery_V.toFixed(2)} V` : "-");
  put("battery-note", replay ? "simulated" : "");
  for (const id of ["tracking", "link"]) { put(id, "-"); put(`${id}-note`, now.in_process ? "nothing real flies" : ""); }
  if (replay) showPose(replay, "simulated");
  put("pose-note", replay ? `simulated: replay of rollout ${replay.number}` : "");
}

function showPose(moment, note) {
  const p = moment.p_W_m, gap = live.parts.room.surface.point_W_m.reduce((sum, value, i) => sum + (value - p[i]) * live.parts.room.surface.normal_W[i], 0);
  const q = moment.q_WB, tilt = q ? Math.acos(Math.min(Math.max(1 - 2 * (q[0] ** 2 + q[1] ** 2), -1), 1)) * 180 / Math.PI : null;
  const rows = [["to the surface", p[0] === null ? "-" : `${gap.toFixed(2)} m`], ["height", p[0] === null ? "-" : `${p[2].toFixed(2)} m`],
    ["tilt", tilt === null ? "-" : `${tilt.toFixed(0)}°`], ["RREV", moment.cues.rrev_per_s === null ? "-" : `${short(moment.cues.rrev_per_s)} 1/s`],
    ["position", note || "-"]];
  const box = $("pose");
  if (box.children.length !== 2 * rows.length) {
    box.replaceChildren(...rows.flatMap(() => [document.createElement("dt"), document.createElement("dd")]));
  }
  rows.forEach(([name, text], i) => { box.children[2 * i].textContent = name; box.children[2 * i + 1].textContent = text; });
}

// ---- learning

function showLearning(learning) {
  put("flights", `${learning.n_flown} / ${learning.n_all}`);
  put("flights-note", "that count, of the budget");
  put("landed", learning.n_flown ? percent(learning.n_landed / learning.n_flown) : "-");
  put("landed-note", `${learning.n_landed} of ${learning.n_flown} on four legs`);
  const box = $("search"), n = Math.min(learning.params.length, 4);
  if (box.children.length !== n) {
    box.replaceChildren(...Array.from({ length: n }, () => Object.assign(document.createElement("canvas"), { className: "plot" })));
  }
  for (let i = 0; i < n; i++) plotSearch(box.children[i], learning, i);
  plotRate($("rate"), learning);
  showNext(learning);
  showBelief(learning.belief);
  if (live.parts.landing) showLanding(live.parts.landing);
}

function showNext(learning) {
  const up = live.parts.upcoming, next = learning.next;
  put("next-title", next ? `Next policy: rollout ${next.number} of ${learning.n_all}` : "Next policy");
  put("next", next ? theta(next.theta).join("\n") : learning.n_flown >= learning.n_all ? "all flown" : "being chosen");
  const belongs = up && next && up.number === next.number;
  put("next-note", belongs ? `simulator: ${up.n_landed} of ${up.n} land, ${up.n_strikes} strike the surface with body or rotors` : "");
}

function showBelief(belief) {
  $("belief-box").hidden = !belief;
  if (!belief) return;
  const fits = belief.model_fits ? "the model fits" : "NO MODEL FITS";
  put("belief-note", `expects ${percent(belief.expected_rate)} of landings, ${percent(belief.margin_rate)} with margin; ${fits}`);
  const box = $("belief");
  if (box.children.length !== belief.parameters.length) {
    box.replaceChildren(...belief.parameters.map(() => {
      const row = Object.assign(document.createElement("div"), { className: "belief" });
      row.append(...["span", "canvas", "span"].map((name) => document.createElement(name)));
      return row;
    }));
  }
  belief.parameters.forEach((parameter, i) => {
    const [name, canvas, value] = box.children[i].children;
    name.textContent = name.title = parameter.name;
    value.textContent = `${Number(parameter.quantile[2].toPrecision(3))} ${parameter.unit === "1" ? "" : parameter.unit}`;
    plotBelief(canvas, parameter);
  });
}

function showLanding(landing) {
  $("has-recorded").hidden = !landing.recorded;
  put("last-note", `rollout ${landing.number}`);
  put("verdict", landing.verdict);
  $("verdict").className = /^[34] feet/.test(landing.verdict) ? "good" : "bad";
  plotFlight($("pitch"), "nose up (deg)", landing, "pitch_deg");
  plotFlight($("gap"), "to the surface (m)", landing, "gap_m");
  const rows = [["", "flown", "simulated"], ["outcome", landing.verdict, landing.simulated_verdict]];
  for (const [name, key, unit] of [["distance at the trigger", "d_m", "m"], ["RREV there", "rrev_per_s", "1/s"], ["climb there", "vz_mps", "m/s"]]) {
    rows.push([name, ...[landing.at_trigger, landing.simulated_at_trigger].map((told) => `${short(told[key])} ${unit}`)]);
  }
  const simulatedAlone = live.parts.now && live.parts.now.in_process;
  $("at-trigger").replaceChildren(...rows.map((cells) => (simulatedAlone ? cells.slice(0, 2) : cells)).map((cells) => {
    const row = document.createElement("tr");
    row.append(...cells.map((text, i) => Object.assign(document.createElement(i ? "td" : "th"), { textContent: text })));
    return row;
  }));
}

// ---- stop

function showStop(now) {
  $("stop").disabled = !(now.flies && token);
  $("stop").title = !token ? "open the address that the terminal shows: it holds the token of this button" : now.flies ? "stop the vehicle now" : "no vehicle flies now";
}

$("stop").addEventListener("click", async () => {
  banner("told", "STOP is sent");
  const answer = await fetch("/stop", { method: "POST", headers: { "X-Ivl-Token": token } });
  banner("told", answer.ok ? `STOP: ${(await answer.json()).text}` : `STOP was refused: wrong token (${answer.status})`);
});

// ---- drawing

// Nothing is drawn twice: the page is often open on the computer that flies.
function drawNews() {
  if (!live.undrawn) return;
  live.undrawn = false;
  live.drawn.side = drawRoom($("side"), live.parts.room, live.moment, live.trail, [0, 2]);
  live.drawn.top = drawRoom($("top"), live.parts.room, live.moment, live.trail, [0, 1]);
  drawClose($("close"), live.parts.room, live.moment);
}

function draw() {
  drawNews();
  const age_s = (performance.now() - live.seen) / 1000;
  const over = live.parts.now && /^(over|ended)/.test(live.parts.now.stage);
  banner("stale", age_s < STALE_S ? "" : over ? "The run is over. This is its last news." : `No news for ${age_s.toFixed(0)} s: look at the terminal`);
  if (age_s >= STALE_S) $("stop").disabled = true;
  requestAnimationFrame(draw);
}

window.addEventListener("resize", () => { live.undrawn = true; if (live.parts.learning) showLearning(live.parts.learning); });
connect();
requestAnimationFrame(draw);
