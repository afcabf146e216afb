// Figures, by plotly: polar landing rates, the policy region, convergence.

const FONT = { family: "system-ui, sans-serif", size: 12, color: INK };
const CONFIG = { displaylogo: false, responsive: true, modeBarButtonsToRemove: ["lasso2d", "select2d", "toImage"] };
// as in the figures on paper: much ink is much success
const RATE_SCALE = { colorscale: "Cividis", reversescale: true }, MOMENT_SCALE = { colorscale: "Viridis", reversescale: false };
const OUTCOMES = [["three or four legs, clean", GREEN, "circle"], ["three or four legs, body contact", "#56B4E9", "square"],
  ["one or two legs", ORANGE, "triangle-up"], ["no leg", VERMILION, "x"]];

const percent = (share) => (share === null || Number.isNaN(share) ? "–" : `${(100 * share).toFixed(0)}\u00a0%`);
const fixed = (value, digits) => value.toFixed(digits).replace("-", "−");
const readable = (name) => name.replaceAll("_", " ");

// Numbers of a stored column { unit, values }; null is NaN.
const column = ({ unit, values }) => values.map((value) => (value === null ? NaN : value * unit));

// Widths of the sectors around sorted centres: each reaches half-way to its neighbours.
function widths(centres) {
  const gaps = centres.slice(1).map((c, i) => c - centres[i]);
  const gap = (i) => gaps[Math.min(Math.max(i, 0), gaps.length - 1)] ?? 1;
  return centres.map((_, i) => (gap(i - 1) + gap(i)) / 2);
}

// One polar plot a gear: angle of approach around, speed outwards, colour the landing rate.
function polarFigure(sweep, cells, gears) {
  const columns = Math.min(window.innerWidth < 700 ? 2 : 3, gears.length), rows = Math.ceil(gears.length / columns);
  const dv = widths(sweep.speeds), dphi = widths(sweep.angles);
  const layout = { font: FONT, margin: { l: 8, r: 8, t: 22, b: 62 }, showlegend: false, annotations: [], height: 265 * rows + 62,
    coloraxis: { cmin: 0, cmax: 1, ...RATE_SCALE, colorbar: { orientation: "h", y: -0.01, yanchor: "top", title: { text: "landing rate, mean over the trials of a cell", side: "bottom", font: { size: 12 } }, thickness: 10, tickformat: ".0%", len: 0.7 } } };
  const traces = gears.map((gear, k) => {
    const own = cells.filter((cell) => cell.gear === gear), name = `polar${k ? k + 1 : ""}`;
    const [x0, y1] = [(k % columns) / columns, 1 - Math.floor(k / columns) / rows];
    layout[name] = polarAxes([x0 + 0.02, x0 + 1 / columns - 0.03], [y1 - 1 / rows + 0.17 / rows, y1 - 0.09 / rows], sweep);
    layout.annotations.push({ text: `<b>${readable(sweep.gears[gear])}</b>`, x: x0 + 0.5 / columns, y: y1 + 0.012, xref: "paper", yref: "paper", xanchor: "center", yanchor: "top", showarrow: false });
    return { type: "barpolar", subplot: name, customdata: own.map((cell) => cell.id),
      r: own.map((cell) => dv[cell.speed]), base: own.map((cell) => sweep.speeds[cell.speed] - dv[cell.speed] / 2),
      theta: own.map((cell) => sweep.angles[cell.angle]), width: own.map((cell) => dphi[cell.angle]),
      marker: { color: own.map((cell) => cell.rate), coloraxis: "coloraxis", line: { width: own.map(() => 0.4), color: own.map(() => "#ffffff") } },
      text: own.map((cell) => `V ${sweep.speeds[cell.speed]} m/s, φ ${sweep.angles[cell.angle]}°<br>rate ${percent(cell.rate)} (95 %: ${percent(cell.lo)} to ${percent(cell.hi)})<br>best trial ${percent(cell.best)}`),
      hovertemplate: "%{text}<extra></extra>" };
  });
  return { traces, layout };
}

function polarAxes(x, y, sweep) {
  const top = sweep.speeds[sweep.speeds.length - 1] + widths(sweep.speeds)[sweep.speeds.length - 1] / 2;
  const n = sweep.angles.length - 1, last = sweep.angles[n] + widths(sweep.angles)[n] / 2;  // the last sector whole
  return { domain: { x, y }, sector: [0, Math.max(90, last)], bgcolor: "#f2f4f7",
    radialaxis: { range: [0, top], angle: 0, tickangle: 0, title: { text: "V (m/s)", font: { size: 10 } }, tickfont: { size: 10 }, nticks: 5, gridcolor: "rgba(0,0,0,0.08)" },
    angularaxis: { tickvals: [0, 30, 60, 90], ticktext: ["0°", "30°", "60°", "90°"], tickfont: { size: 10 }, gridcolor: "rgba(0,0,0,0.08)" } };
}

// Outline of the chosen cell in all polar plots: that of its gear strong, the same approach of other gears weak.
function outlineCell(div, cells, chosen) {
  const lines = div.data.map((trace) => trace.customdata.map((id) => {
    if (id === chosen.id) return [3.5, VERMILION];
    return cells[id].speed === chosen.speed && cells[id].angle === chosen.angle ? [2, "#e79a6a"] : [0.4, "#ffffff"];
  }));
  const part = (i) => lines.map((own) => own.map((line) => line[i]));
  return Plotly.restyle(div, { "marker.line.width": part(0), "marker.line.color": part(1) }, lines.map((_, k) => k));
}

// Trigger states of the trials in (RREV, OF_y, d), coloured by landing rate or by a parameter of the policy, whose number `colour` is.
function regionFigure(points, colour, parameters) {
  const byRate = colour === "rate";
  const trace = { type: "scatter3d", mode: "markers", x: points.rrev, y: points.ofY, z: points.d, customdata: points.cell, text: points.text,
    hovertemplate: "%{text}<br>RREV %{x:.2f} 1/s, OF_y %{y:.2f} rad/s, d %{z:.3f} m<extra></extra>",
    marker: { size: 2.4, color: byRate ? points.rate : points.parameter, ...(byRate ? RATE_SCALE : MOMENT_SCALE), cmin: byRate ? 0 : undefined, cmax: byRate ? 1 : undefined,
      colorbar: { title: { text: byRate ? "landing rate" : axisOf(parameters[Number(colour)]), side: "right" }, thickness: 12, len: 0.7, tickformat: byRate ? ".0%" : undefined } } };
  const axis = (text) => ({ title: { text, font: { size: 12 } }, backgroundcolor: "#f7f8fa", gridcolor: "#dfe4ea", showbackground: true });
  const layout = { font: FONT, height: 520, margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision: "keep",
    scene: { xaxis: axis("RREV (1/s)"), yaxis: axis("OF_y (rad/s)"), zaxis: axis("d (m)"), camera: { eye: { x: 1.4, y: -1.5, z: 0.65 }, center: { x: 0, y: 0, z: -0.16 } }, aspectmode: "manual", aspectratio: { x: 1.15, y: 1.15, z: 0.85 } } };
  return { traces: [trace], layout };
}

// Parameters of a policy that a table or a figure has room for: the first of a long form.
const SHOWN_MAX = 6;
const shown = (parameters) => parameters.slice(0, SHOWN_MAX);
const axisOf = ([symbol, unit]) => `${symbol} (${unit})`;
const headOf = ([symbol, unit]) => `${symbol}, ${unit}`;

// Panels of the convergence from top to bottom: title, axis, share of the height.
function panelsOf(parameters) {
  const titles = [...shown(parameters).map((parameter) => [axisOf(parameter), 3]), ["landing rate", 2], ["return", 2]];
  return titles.map(([title, share], i) => ({ title, axis: i ? `y${i + 1}` : "y", share }));
}

// Domains of the panels' axes, with gaps between them.
function domainsOf(panels) {
  const gap = 0.025, room = 1 - gap * (panels.length - 1), all = panels.reduce((sum, { share }) => sum + share, 0);
  let top = 1;
  return panels.map(({ share }) => {
    const bottom = Math.max(top - (room * share) / all, 0), domain = [bottom, top];
    top = bottom - gap;
    return domain;
  });
}

// Search of one trial over its rollouts: mu and mu +- 2 sigma of each parameter, landing rate, return. Thin lines: other trials.
function convergenceFigure(series, others, rollouts, limits, parameters) {
  const panels = panelsOf(parameters), n = panels.length - 2, domains = domainsOf(panels), ranges = [...limits.slice(0, n), ...limits.slice(-2)];
  const traces = others.flatMap((other) => [...other.mu.slice(0, n), other.rate, other.reward].map((y, i) => ({ x: other.at, y, yaxis: panels[i].axis, mode: "lines", line: { color: "#c3cad2", width: 1 }, hoverinfo: "skip", showlegend: false })));
  panels.slice(0, n).forEach(({ axis }, i) => {
    const band = (sign) => series.mu[i].map((value, k) => value + 2 * sign * series.sigma[i][k]);
    const common = { x: series.at, yaxis: axis, mode: "lines", line: { color: BLUE, width: 0, shape: "hv" }, hoverinfo: "skip" };
    traces.push({ ...common, y: band(-1), showlegend: false }, { ...common, y: band(1), fill: "tonexty", fillcolor: "rgba(0,114,178,0.15)", name: "µ ± 2σ", showlegend: i === 0 },
      { ...common, y: series.mu[i], line: { color: BLUE, width: 2, shape: "hv" }, hoverinfo: "x+y", name: "µ", showlegend: i === 0 });
  });
  traces.push({ x: series.at, y: series.rate, yaxis: panels[n].axis, mode: "lines+markers", marker: { size: 4 }, line: { color: GREEN, width: 2 }, name: "four-leg rate of the episode", showlegend: false },
    { x: series.at, y: series.reward, yaxis: panels[n + 1].axis, mode: "lines+markers", marker: { size: 4 }, line: { color: BLUE, width: 2 }, name: "mean return of the episode", showlegend: false });
  if (rollouts) traces.push(...outcomeDots(rollouts, panels.slice(0, n)));
  const layout = { font: FONT, height: 260 + 150 * n, margin: { l: 62, r: 12, t: 8, b: 70 }, hovermode: "closest", legend: { orientation: "h", y: -0.11 },
    xaxis: { title: { text: "rollout" }, anchor: panels[n + 1].axis, domain: [0, 1], range: [-1, series.at[series.at.length - 1] + 1], zeroline: false } };
  panels.forEach(({ title, axis }, i) => {
    layout[axis.replace("y", "yaxis")] = { title: { text: title }, domain: domains[i], zeroline: false, gridcolor: "#e6eaee", range: ranges[i] };
  });
  return { traces, layout };
}

// One dot a rollout, colour and shape by outcome; each can be clicked.
function outcomeDots(rollouts, panels) {
  return OUTCOMES.flatMap(([name, color, symbol], kind) => panels.map(({ axis }, i) => {
    const own = rollouts.kind.map((k, n) => (k === kind ? n : -1)).filter((n) => n >= 0);
    return { x: own.map((n) => rollouts.at[n]), y: own.map((n) => rollouts.theta[i][n]), customdata: own, yaxis: axis, mode: "markers", name, legendgroup: name, showlegend: i === 0,
      text: own.map((n) => `rollout ${n}: ${name}, return ${figures(rollouts.reward[n])}`), hovertemplate: "%{text}<extra>click to replay</extra>", marker: { color, symbol, size: 7 } };
  }));
}
