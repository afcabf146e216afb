// A landing drawn on a canvas: ceiling, trail, vehicle; perspective, nearer things over farther ones.

const INK = "#1f2933", GREY = "#7f8a96", FREE = "#4a5560", GREEN = "#009E73", ORANGE = "#E69F00", BLUE = "#0072B2",
  VERMILION = "#D55E00";
const HIP_SIGNS = [[1, -1], [-1, -1], [-1, 1], [1, 1]];  // legs 1 front right, 2 rear right, 3 rear left, 4 front left
const GRID_M = 0.05;

// Projection of world points (origin on the ceiling) for a canvas of the given size.
function makeCamera(view, geometry, state, width, height) {
  const d = Math.min(Math.max(-state.pose.p[2], 0.06), 0.9);
  const half = (0.5 * d + 0.055 + Math.max(0.06, geometry.leg_length)) / view.zoom;  // half of the visible height, m
  const target = [state.pose.p[0], state.pose.p[1], state.pose.p[2] + 0.5 * d + 0.01];
  const [ca, sa, ce, se] = [Math.cos(view.azimuth), Math.sin(view.azimuth), Math.cos(view.elevation), Math.sin(view.elevation)];
  const right = [ca, -sa, 0], up = [sa * se, ca * se, ce], back = [-sa * ce, -ca * ce, se];
  const scale = Math.min(height, 1.3 * width) / (2 * half), distance = 7 * half;
  const along = (axis, v) => axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2];
  return {
    target, half, scale, below: view.elevation < 0,
    project(point) {
      const v = point.map((value, i) => value - target[i]);
      const depth = along(back, v), k = scale * distance / Math.max(distance - depth, 0.1 * distance);
      return [width / 2 + k * along(right, v), height / 2 - k * along(up, v), depth];
    },
  };
}

function path(context, points, close) {
  context.beginPath();
  points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  if (close) context.closePath();
}

function drawCeiling(context, camera) {
  const reach = 4 * camera.half, [x0, y0] = camera.target.map((value) => Math.round(value / GRID_M) * GRID_M);
  const n = Math.ceil(reach / GRID_M), corner = (sx, sy) => camera.project([x0 + sx * n * GRID_M, y0 + sy * n * GRID_M, 0]);
  path(context, [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)], true);
  context.fillStyle = camera.below ? "#e8ecf1" : "rgba(214,221,229,0.45)";
  context.fill();
  for (let k = -n; k <= n; k++) {
    for (const line of [[[k, -n], [k, n]], [[-n, k], [n, k]]]) {
      path(context, line.map(([i, j]) => camera.project([x0 + i * GRID_M, y0 + j * GRID_M, 0])));
      context.strokeStyle = `rgba(150,162,175,${0.45 * Math.min(1, 0.2 / camera.half)})`;
      context.lineWidth = 0.7;
      context.stroke();
    }
  }
}

// Flown part solid, the rest dotted.
function drawTrail(context, camera, landing, state) {
  const flown = [], ahead = [camera.project(state.pose.p)];
  landing.t.forEach((t, i) => (t <= state.t ? flown : ahead).push(camera.project(landing.p.map((column) => column[i]))));
  flown.push(ahead[0]);
  context.lineWidth = 1.2;
  for (const [points, dash, colour] of [[ahead, [2, 5], GREY], [flown, [], GREY]]) {
    context.setLineDash(dash);
    context.strokeStyle = colour;
    path(context, points);
    context.stroke();
  }
  context.setLineDash([]);
}

// Where the flip was triggered.
function drawTrigger(context, camera, landing, state) {
  if (landing.outcome.t_trigger_s === null || state.t < landing.t0) return;
  const [x, y] = camera.project(stateAt(landing, landing.t0).pose.p);
  context.strokeStyle = VERMILION;
  context.lineWidth = 2;
  context.beginPath();
  context.arc(x, y, 5, 0, 7);
  context.stroke();
  label(context, "trigger", x + 9, y + 14, VERMILION);
}

// Distance to the ceiling, until something touches it.
function drawGap(context, camera, landing, state) {
  const touched = landing.outcome.t_impact_s !== null && state.t >= landing.outcome.t_impact_s;
  if (touched || state.pose.p[2] > -0.02) return;
  const [x, y] = state.pose.p, ends = [camera.project(state.pose.p), camera.project([x, y, 0])];
  context.setLineDash([4, 4]);
  context.strokeStyle = BLUE;
  context.lineWidth = 1.2;
  path(context, ends);
  context.stroke();
  context.setLineDash([]);
  label(context, `${(-1000 * state.pose.p[2]).toFixed(0)} mm`, (ends[0][0] + ends[1][0]) / 2 + 6, 0.35 * ends[0][1] + 0.65 * ends[1][1], BLUE);
}

function label(context, text, x, y, colour, align = "left") {
  context.textAlign = align;
  context.font = "12px system-ui, sans-serif";
  context.lineWidth = 3;
  context.strokeStyle = "rgba(255,255,255,0.85)";
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

// Shapes of the vehicle in the world, each { points, draw(context, projected) }; sorted by depth before they are drawn.
function shapesOf(geometry, state, camera) {
  const { pose, feet } = state, world = (point) => toWorld(pose, point);
  const shapes = boxFaces(geometry.base_plate).map((face) => polygon(face.map(world), "#5d6b7a", INK));
  const [sx, sy, sz, cz] = geometry.prop_plate, top = cz + sz / 2;
  const plate = [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([i, j]) => world([i * sx / 2, j * sy / 2, top]));
  shapes.push(polygon(plate, "rgba(86,180,233,0.10)", "rgba(90,110,130,0.45)"));
  const [rx, ry, rz, radius] = geometry.rotor;
  for (const [i, j] of HIP_SIGNS) {
    const hub = [i * rx, j * ry, rz];
    shapes.push(segment(world([0, 0, geometry.base_plate[3]]), world(hub), INK, 3));
    const rim = Array.from({ length: 24 }, (_, k) => [hub[0] + radius * Math.cos(k * Math.PI / 12), hub[1] + radius * Math.sin(k * Math.PI / 12), rz]);
    shapes.push(polygon(rim.map(world), i > 0 ? "rgba(230,159,0,0.55)" : "rgba(0,114,178,0.40)", i > 0 ? "#a87400" : BLUE));
  }
  feet.forEach((foot, k) => {
    const hip = world([HIP_SIGNS[k][0] * geometry.hip[0], HIP_SIGNS[k][1] * geometry.hip[0], geometry.hip[1]]);
    shapes.push(segment(hip, foot.place, foot.state === 2 ? GREEN : FREE, foot.state === 2 ? 4 : 3), footShape(feet, k, geometry, camera));
  });
  return shapes;
}

function boxFaces([sx, sy, sz, cz]) {
  const corner = (i, j, k) => [i * sx / 2, j * sy / 2, cz + k * sz / 2];
  const faces = [];
  for (const s of [-1, 1]) {
    faces.push([[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([i, j]) => corner(i, j, s)));
    faces.push([[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([i, j]) => corner(i, s, j)));
    faces.push([[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([i, j]) => corner(s, i, j)));
  }
  return faces;
}

function polygon(points, fill, stroke) {
  return { points, draw(context, projected) {
    path(context, projected, true);
    context.fillStyle = fill;
    context.fill();
    context.strokeStyle = stroke;
    context.lineWidth = 1;
    context.stroke();
  } };
}

function segment(a, b, colour, width) {
  return { points: [a, b], draw(context, projected) {
    path(context, projected);
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.lineCap = "round";
    context.stroke();
  } };
}

// Stuck: green disc with a ring; sliding: orange ring; free: grey. The number tells legs apart without colour; it stands on
// the side away from the foot across, so that the two of a narrow gear do not hide each other.
function footShape(feet, k, geometry, camera) {
  const foot = feet[k], across = camera.project(feet[3 - k].place)[0];
  return { points: [foot.place], draw(context, [[x, y]]) {
    const radius = Math.max(4, geometry.foot_radius * camera.scale);
    context.beginPath();
    context.arc(x, y, radius, 0, 7);
    context.fillStyle = foot.state === 2 ? GREEN : foot.state === 1 ? "#ffffff" : FREE;
    context.fill();
    if (foot.state === 1) {
      context.strokeStyle = ORANGE;
      context.lineWidth = 3;
      context.stroke();
    }
    if (foot.state === 2) {
      context.beginPath();
      context.arc(x, y, radius + 4, 0, 7);
      context.strokeStyle = GREEN;
      context.lineWidth = 2;
      context.stroke();
    }
    const side = x < across ? -1 : 1;
    if (camera.half < 0.35) label(context, String(k + 1), x + side * (radius + 5), y - radius + 2, foot.state === 2 ? "#00664b" : INK, side < 0 ? "right" : "left");
  } };
}

// Draw one moment; returns where body and feet went on the canvas, in CSS pixels.
function drawMoment(canvas, landing, geometry, state, view) {
  const context = canvas.getContext("2d"), ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  const camera = makeCamera(view, geometry, state, width, height);
  if (camera.below) drawCeiling(context, camera);
  drawTrail(context, camera, landing, state);
  const shapes = shapesOf(geometry, state, camera).map((shape) => {
    const projected = shape.points.map(camera.project);
    return { shape, projected, depth: projected.reduce((sum, point) => sum + point[2], 0) / projected.length };
  });
  shapes.sort((a, b) => a.depth - b.depth).forEach(({ shape, projected }) => shape.draw(context, projected));
  if (!camera.below) drawCeiling(context, camera);
  drawGap(context, camera, landing, state);
  drawTrigger(context, camera, landing, state);
  return { body: camera.project(state.pose.p).slice(0, 2), feet: state.feet.map((foot) => camera.project(foot.place).slice(0, 2)) };
}
