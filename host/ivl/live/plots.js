"use strict";
// Small plots: a frame with two numbers on each axis, and what is drawn inside of it.

const EDGE = { left: 46, right: 8, top: 17, bottom: 16 };

// Numbers as people want to read them.
function short(value) {
  const size = Math.abs(value);
  if (value === null || !Number.isFinite(value)) return "-";
  return String(size === 0 || size >= 100 ? Math.round(value) : size >= 10 ? value.toFixed(1) : size >= 0.1 ? value.toFixed(2) : value.toPrecision(2));
}

function frame(canvas, title, [x0, x1], [y0, y1]) {
  const { context, width, height } = fresh(canvas);
  const at = (x, y) => [EDGE.left + (width - EDGE.left - EDGE.right) * (x - x0) / (x1 - x0 || 1),
    height - EDGE.bottom - (height - EDGE.top - EDGE.bottom) * (y - y0) / (y1 - y0 || 1)];
  line(context, [at(x0, y1), at(x0, y0), at(x1, y0)], COLOUR.line, 1);
  words(context, title, EDGE.left, 12, COLOUR.soft, "left", 12);
  const round = (y) => (Math.abs(y) < 1e-4 * (y1 - y0) ? 0 : y);
  for (const [y, dy] of [[y0, 0], [y1, 10]]) words(context, short(round(y)), EDGE.left - 5, at(x0, y)[1] + dy, COLOUR.soft, "right", 11);
  for (const [x, align] of [[x0, "left"], [x1, "right"]]) words(context, String(+x.toFixed(2)), at(x, y0)[0], height - 3, COLOUR.soft, align, 11);
  return { context, at };
}

function dot(context, [x, y], colour) {
  context.beginPath();
  context.arc(x, y, 3, 0, 7);
  context.fillStyle = colour;
  context.fill();
}

// The part of a parameter's bounds in which the search has been.
function searched(learning, i, [lo, hi]) {
  const values = learning.episodes.flatMap(({ mu, sigma }) => [mu[i] - 2 * sigma[i], mu[i] + 2 * sigma[i]]);
  const all = [...values, ...(learning.flights.theta[i] || [])];
  if (!all.length) return [lo, hi];
  const least = Math.min(...all), most = Math.max(...all), room = 0.1 * (most - least) + 0.01 * (hi - lo);
  return [Math.max(least - room, lo), Math.min(most + room, hi)];
}

// Search of one parameter over the flights.
function plotSearch(canvas, learning, i) {
  const param = learning.params[i], n = Math.max(learning.n_all, 1);
  const { context, at } = frame(canvas, `${param.symbol} (${param.unit})`, [0, n], searched(learning, i, param.bounds));
  const clip = (value) => Math.min(Math.max(value, param.bounds[0]), param.bounds[1]);
  let flown = 0;
  const upper = [], lower = [], middle = [];
  for (const episode of learning.episodes) {
    flown += episode.n_scored;
    middle.push(at(flown, episode.mu[i]));
    upper.push(at(flown, clip(episode.mu[i] + 2 * episode.sigma[i])));
    lower.push(at(flown, clip(episode.mu[i] - 2 * episode.sigma[i])));
  }
  if (middle.length > 1) {
    context.beginPath();
    [...upper, ...lower.reverse()].forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.fillStyle = "rgba(88,180,240,0.22)";
    context.fill();
  }
  line(context, middle, COLOUR.trail, 2);
  const flights = learning.flights;
  flights.theta.length && flights.theta[i].forEach((value, k) => dot(context, at(k + 1, value), flights.landed[k] ? "#2fc08d" : "#ff6b4a"));
}

// Landing rate of each episode, in per cent.
function plotRate(canvas, learning) {
  const { context, at } = frame(canvas, "landing rate of an episode (%)", [0, Math.max(learning.n_all, 1)], [0, 100]);
  let flown = 0;
  const points = [];
  for (const episode of learning.episodes) {
    flown += episode.n_scored;
    if (episode.rate !== null) points.push(at(flown, 100 * episode.rate));
  }
  line(context, points, COLOUR.stuck, 2);
  points.forEach((point) => dot(context, point, COLOUR.stuck));
}

// One signal of the last flight, recorded over simulated.
function plotFlight(canvas, title, landing, name) {
  const both = [landing.simulated, landing.recorded].filter(Boolean);
  const values = both.flatMap((curve) => curve[name]).filter((value) => value !== null), times = both.flatMap((curve) => curve.t_s);
  if (!values.length) return fresh(canvas);
  const { context, at } = frame(canvas, title, [Math.min(...times), Math.max(...times)], [Math.min(...values), Math.max(...values)]);
  for (const [curve, colour, width] of [[landing.simulated, COLOUR.trail, 2], [landing.recorded, COLOUR.fence, 2.5]]) {
    if (curve) line(context, curve.t_s.map((t, i) => at(t, curve[name][i])), colour, width);
  }
}

// What is believed of one parameter: 5 % to 95 % thin, quartiles thick, median white; grey: before the first flight.
function plotBelief(canvas, { prior, quantile }) {
  const { context, width, height } = fresh(canvas);
  const [lo, hi] = [Math.min(prior[0], quantile[0]), Math.max(prior[4], quantile[4])];
  const x = (value) => 2 + (width - 4) * (value - lo) / (hi - lo || 1), y = height / 2;
  line(context, [[x(prior[0]), y], [x(prior[4]), y]], "#3d4955", 12);
  line(context, [[x(quantile[0]), y], [x(quantile[4]), y]], COLOUR.trail, 3);
  line(context, [[x(quantile[1]), y], [x(quantile[3]), y]], COLOUR.trail, 9);
  line(context, [[x(quantile[2]), y - 6], [x(quantile[2]), y + 6]], COLOUR.ink, 2);
}
