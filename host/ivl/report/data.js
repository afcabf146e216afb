// What the page carries: compressed, and numbers as differences.

// Text of a <script type="text/plain"> element that holds base64 of gzip.
async function inflate(id) {
  const bytes = Uint8Array.from(atob(document.getElementById(id).textContent.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

// Differences of whole multiples of a unit -> numbers.
function undelta(column, unit) {
  let sum = 0;
  return Float64Array.from(column, (step) => (sum += step) * unit);
}

// A packed landing with its columns as numbers; done once, when a landing is first shown.
function unpack(landing, scale) {
  if (landing.ready) return landing;
  landing.t = undelta(landing.t, scale.t);
  for (const name of ["p", "q", "f", "pitch"]) {
    landing[name] = landing[name].map((column) => undelta(column, scale[name]));
  }
  landing.cues = landing.cues.map((column, i) => undelta(column, scale.cues[i]));
  landing.t0 = origin(landing);
  landing.ready = true;
  return landing;
}

// When the vehicle is closest to the ceiling.
function closest(landing) {
  const z = landing.p[2];
  return landing.t[z.indexOf(Math.max(...z))];
}

// Time that the clock of the replay calls zero: the trigger; of a flight without one the no-go, or the closest approach.
function origin(landing) {
  if (landing.outcome.t_trigger_s !== null) return landing.outcome.t_trigger_s;
  if (landing.outcome.t_no_go_s !== null) return landing.outcome.t_no_go_s;
  return closest(landing);
}

// What happens at that time.
function zeroOf(landing) {
  if (landing.outcome.t_trigger_s !== null) return "the trigger";
  return landing.outcome.no_go ? "the no-go" : "the closest approach";
}

// Last index whose time is <= t (0 if none is).
function indexAt(times, t) {
  let lo = 0, hi = times.length - 1;
  while (lo < hi) {
    const middle = (lo + hi + 1) >> 1;
    if (times[middle] <= t) lo = middle; else hi = middle - 1;
  }
  return lo;
}

// Last event [time, ...] at or before t, or null.
function lastEvent(events, t) {
  let found = null;
  for (const event of events) {
    if (event[0] > t + 1e-9) break;
    found = event;
  }
  return found;
}

// Rotation matrix body to world of the unit quaternion x, y, z, w.
function rotationOf(q) {
  const [x, y, z, w] = q;
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
  ];
}

function toWorld(pose, point) {
  return pose.R.map((row, i) => pose.p[i] + row[0] * point[0] + row[1] * point[1] + row[2] * point[2]);
}

// Everything about a landing at time t: pose, feet in the world, their state, cues, phase.
function stateAt(landing, t) {
  const times = landing.t, last = times.length - 1;
  const clamped = Math.min(Math.max(t, times[0]), times[last]);
  const i = Math.min(indexAt(times, clamped), Math.max(last - 1, 0)), j = Math.min(i + 1, last);
  const u = j > i ? (clamped - times[i]) / (times[j] - times[i]) : 0;
  const mix = (column) => column[i] + u * (column[j] - column[i]);
  const q = landing.q.map(mix), norm = Math.hypot(...q);
  const pose = { p: landing.p.map(mix), R: rotationOf(q.map((value) => value / norm)) };
  const feet = [0, 1, 2, 3].map((foot) => footAt(landing, foot, clamped, pose, mix));
  const cue = indexAt(landing.cues[0], clamped + 1e-6);
  const phase = lastEvent(landing.phases, clamped) || landing.phases[0];
  return {
    t: clamped, pose, feet, phase: phase[1], pitch: mix(landing.pitch[0]),
    d: landing.cues[1][cue], rrev: landing.cues[2][cue], ofY: landing.cues[3][cue],
  };
}

function footAt(landing, foot, t, pose, mix) {
  const event = lastEvent(landing.feet.filter((e) => e[1] === foot), t);
  const state = event ? event[2] : 0;
  if (state === 2) return { place: event.slice(3), state };
  return { place: toWorld(pose, [0, 1, 2].map((axis) => mix(landing.f[3 * foot + axis]))), state };
}
