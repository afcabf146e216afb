"use strict";
// The vehicle against surface and fence, from the side (x, z) and from above (x, y). Metres in, pixels out.

const COLOUR = { ink: "#e8edf2", soft: "#9aa8b5", line: "#2b343d", surface: "#7d8b99", fence: "#f0b429", trail: "#58b4f0",
  body: "#c9d4de", front: "#f0b429", rear: "#58b4f0", leg: "#c9d4de", stuck: "#2fc08d" };
const HIP_SIGNS = [[1, -1], [-1, -1], [-1, 1], [1, 1]];
const TRAIL_MAX = 400, ROOM_MAX_M = 12, LEAST_M = 0.9, CLOSE_M = 0.36;

function rotate([x, y, z, w], v) {
  const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
  return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2], v[2] + w * t[2] + x * t[1] - y * t[0]];
}

// A canvas at the screen's resolution, empty; with its size in CSS pixels.
function fresh(canvas) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.lineJoin = context.lineCap = "round";
  return { context, width, height };
}

function line(context, points, colour, width, dash = []) {
  context.beginPath();
  points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.setLineDash(dash);
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.stroke();
  context.setLineDash([]);
}

function words(context, text, x, y, colour, align = "left", size = 13) {
  context.font = `${size}px system-ui, sans-serif`;
  context.textAlign = align;
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

// A span that holds all of these numbers, and those of a fence if that is not as wide as the world.
function spanOf(values, fence) {
  const walls = fence[1] - fence[0] <= ROOM_MAX_M ? fence : [];
  const all = [...values, ...walls].filter(Number.isFinite);
  const lo = Math.min(...all), hi = Math.max(...all), middle = (lo + hi) / 2, half = Math.max(0.56 * (hi - lo), LEAST_M / 2);
  return [middle - half, middle + half];
}

// Seen along an axis: [index of what goes right, index of what goes up].
function drawRoom(canvas, room, moment, trail, [a, b]) {
  const { context, width, height } = fresh(canvas);
  if (!width || !room) return null;
  const point = room.surface.point_W_m, board = room.site ? room.site.board_m : [[-0.6, 0.6], [-0.6, 0.6]];
  const seen = [...trail, ...(moment && moment.p_W_m[0] !== null ? [moment.p_W_m] : [])];
  const across = spanOf([...board[a], ...seen.map((p) => p[a])], room.fence_m[a]);
  const up = b === 2 ? spanOf([0, point[2], ...seen.map((p) => p[2])], room.fence_m[2])
    : spanOf([...board[b], ...seen.map((p) => p[b])], room.fence_m[b]);
  const scale = Math.min(width / (across[1] - across[0]), height / (up[1] - up[0]));
  const middle = [(across[0] + across[1]) / 2, (up[0] + up[1]) / 2];
  const to = (p) => [width / 2 + scale * (p[a] - middle[0]), height / 2 - scale * (p[b] - middle[1])];
  const flat = (u, v) => { const p = [0, 0, 0]; p[a] = u; p[b] = v; return to(p); };
  drawFence(context, room, flat, [a, b]);
  drawSurface(context, room, board, to, flat, [a, b], width);
  drawPlaces(context, room, flat, b);
  line(context, trail.map(to), COLOUR.trail, 1.5);
  if (!moment || moment.p_W_m[0] === null) return null;
  drawVehicle(context, room.shapes, moment, to);
  return { body: to(moment.p_W_m), surface: to(point), scale };
}

// The vehicle from the side, in the middle, with the surface if that is near.
function drawClose(canvas, room, moment) {
  const { context, width, height } = fresh(canvas);
  if (!width || !room || !moment || moment.p_W_m[0] === null) return;
  const scale = Math.min(width, height) / CLOSE_M, { point_W_m: point, normal_W: n } = room.surface, middle = moment.p_W_m;
  const to = (p) => [width / 2 + scale * (p[0] - middle[0]), height / 2 - scale * (p[2] - middle[2])];
  const s = (middle[0] - point[0]) * n[2] - (middle[2] - point[2]) * n[0];
  const at = (d) => to([point[0] + (s + d) * n[2], 0, point[2] - (s + d) * n[0]]);
  line(context, [at(-CLOSE_M), at(CLOSE_M)], COLOUR.surface, 6);
  drawVehicle(context, room.shapes, moment, to);
  words(context, "close, from the side", 4, 13, COLOUR.soft, "left", 12);
}

function drawFence(context, room, flat, [a, b]) {
  const [[l, r], [d, u]] = [room.fence_m[a], room.fence_m[b]];
  if (r - l > ROOM_MAX_M || u - d > ROOM_MAX_M) return;
  line(context, [flat(l, d), flat(r, d), flat(r, u), flat(l, u), flat(l, d)], COLOUR.fence, 1.5, [7, 6]);
  const [x, y] = flat(l, d);
  words(context, "fence", x + 5, y - 6, COLOUR.fence);
}

function drawSurface(context, room, board, to, flat, [a, b], width) {
  const { point_W_m: point, normal_W: n } = room.surface;
  if (b !== 2) {
    words(context, "from above", 4, 13, COLOUR.soft, "left", 12);
    const [[l, r], [d, u]] = board, corner = flat(l, u), other = flat(r, d);
    context.fillStyle = "rgba(125,139,153,0.18)";
    context.fillRect(corner[0], corner[1], other[0] - corner[0], other[1] - corner[1]);
    const [x, y] = flat(0, 0);
    line(context, [[x - 7, y], [x + 7, y]], COLOUR.soft, 1.5);
    line(context, [[x, y - 7], [x, y + 7]], COLOUR.soft, 1.5);
    return;
  }
  const along = [n[2], 0, -n[0]], size = Math.hypot(...along) || 1;
  const at = (s) => to(point.map((value, i) => value + (s * along[i]) / size));
  line(context, [at(board[0][0]), at(board[0][1])], COLOUR.surface, 6);
  words(context, `surface ${point[2].toFixed(2)} m`, at(board[0][0])[0], at(board[0][0])[1] + 18, COLOUR.soft);
  const floor = flat(0, 0)[1];
  line(context, [[0, floor], [width, floor]], COLOUR.line, 2);
}

function drawPlaces(context, room, flat, b) {
  if (!room.site) return;
  for (const [name, place] of [["home", room.site.home_m], ["emergency", room.site.emergency_m]]) {
    const [x, y] = flat(place[0], b === 2 ? 0 : place[1]);
    line(context, [[x, y - 4], [x, y + 4]], COLOUR.soft, 2);
    words(context, b === 2 ? name : name[0].toUpperCase(), x + (b === 2 ? 0 : 8), y + (b === 2 ? 17 : 14), COLOUR.soft, "center", 11);
  }
}

function drawVehicle(context, shapes, moment, to) {
  const q = moment.q_WB || [0, 0, 0, 1], p = moment.p_W_m;
  const world = (v) => rotate(q, v).map((value, i) => value + p[i]);
  const [hx, hz] = shapes.hip, [rx, ry, rz, radius] = shapes.rotor;
  HIP_SIGNS.forEach(([i, j], k) => {
    const stuck = Boolean(moment.feet_stuck && moment.feet_stuck[k]);
    const foot = moment.feet_W_m ? moment.feet_W_m[k] : world(shapes.feet_at_rest_B_m[k]);
    line(context, [to(world([i * hx, j * hx, hz])), to(foot)], stuck ? COLOUR.stuck : COLOUR.leg, 2);
    const hub = [i * rx, j * ry, rz];
    line(context, [to(world([0, 0, rz])), to(world(hub))], COLOUR.body, 2);
    const rim = Array.from({ length: 13 }, (_, n) => world([hub[0] + radius * Math.cos(n * Math.PI / 6), hub[1] + radius * Math.sin(n * Math.PI / 6), rz]));
    line(context, rim.map(to), i > 0 ? COLOUR.front : COLOUR.rear, 2);
    if (stuck) { context.beginPath(); context.arc(...to(foot), 4, 0, 7); context.fillStyle = COLOUR.stuck; context.fill(); }
  });
  const [x, y] = to(p);
  context.beginPath();
  context.arc(x, y, 3, 0, 7);
  context.fillStyle = COLOUR.ink;
  context.fill();
}
