// The page: data in, sections filled, clicks connected.

const $ = (selector) => document.querySelector(selector);

function element(tag, text, attributes = {}) {
  const node = document.createElement(tag);
  if (text !== undefined) node.textContent = text;
  Object.entries(attributes).forEach(([name, value]) => node.setAttribute(name, value));
  return node;
}

function table(target, head, rows) {
  const headRow = element("tr");
  head.forEach((text) => headRow.append(element("th", text, { scope: "col" })));
  target.replaceChildren(element("thead"), element("tbody"));
  target.firstChild.append(headRow);
  rows.forEach((cells) => {
    const row = element("tr");
    cells.forEach((cell) => {
      const td = element("td", cell instanceof Node ? undefined : cell);
      if (cell instanceof Node) td.append(cell);
      row.append(td);
    });
    target.lastChild.append(row);
  });
}

// Buttons that show a landing left or right; empty if the page does not carry it.
function replayButtons(replay, index, what) {
  const span = element("span", index < 0 ? "–" : undefined, index < 0 ? { title: "not carried by this page" } : { class: "buttons" });
  if (index < 0) return span;
  ["A", "B"].forEach((name, pane) => {
    const button = element("button", `▶ ${name}`, { type: "button", "aria-label": `replay ${what} in view ${name}` });
    button.addEventListener("click", () => { replay.show(pane, index); $("#replay").scrollIntoView({ behavior: "smooth", block: "nearest" }); });
    span.append(button);
  });
  return span;
}

function fillHeader(data) {
  document.title = data.title;
  $("h1").textContent = data.title;
  $("#subtitle").textContent = data.subtitle;
  data.facts.forEach(([name, value]) => {
    const fact = element("div");
    fact.append(element("dt", name), element("dd", value));
    $("#facts").append(fact);
  });
  table($("#manifest"), ["", ""], data.manifest);
  if (data.claims) {
    $("#claims").hidden = false;
    table($("#claims-table"), data.claims.head, data.claims.rows);
  }
}

// ---- a run of `ivl learn`

function showLearn(data, replay) {
  const learn = data.learn, rollouts = { at: learn.rollouts.at, kind: learn.rollouts.kind, theta: learn.rollouts.theta.map(column), reward: column(learn.rollouts.reward), landing: learn.rollouts.landing };
  const series = learn.episodes.map(seriesOf), draw = (trial) => {
    const figure = convergenceFigure(series[trial], series.filter((_, i) => i !== trial), trial === 0 ? rollouts : null, learn.limits, data.parameters);
    Plotly.react("convergence-plot", figure.traces, figure.layout, CONFIG);
  };
  draw(0);
  $("#convergence-plot").on("plotly_click", ({ points: [point] }) => { if (point.customdata !== undefined) replay.show(0, rollouts.landing[point.customdata]); });
  if (series.length > 1) fillChoice($("#trial"), learn.episodes.map((_, i) => `trial ${i}`), draw);
  $("#notable").hidden = false;
  table($("#notable-table"), ["landing", "return", ...data.terms.map(([name]) => name), "feet", ...shown(data.parameters).map(headOf), "replay"], learn.notable.map(({ what, landing }) => {
    const { outcome, spec } = data.landings[landing];
    return [what, figures(outcome.reward), ...data.terms.map(([name]) => figures(outcome.terms[name])), `${outcome.n_legs}${outcome.body_contact ? ", body" : ""}`, ...shown(spec.theta).map((value) => value.toFixed(2)), replayButtons(replay, landing, what)];
  }));
  $("#convergence-note").textContent = "Rate: share of landings on three or four legs in an episode. Click a dot to replay that rollout in view A.";
  showPictures(learn.pictures);
  if (learn.flown) showFlown(learn.flown, replay);
  if (!learn.notable.length) return;
  [1, 0].forEach((pane) => replay.show(pane, learn.notable[learn.first_shown[pane]].landing));
}

// A run that a vehicle has flown: each recording beside its simulated counterpart, and the recordings to save.
function showFlown(flown, replay) {
  $("#flown").hidden = false;
  table($("#flown-table"), flown.head, flown.rows.map(({ cells, recorded, simulated }) =>
    [...cells, replayButtons(replay, recorded, `recording of rollout ${cells[0]}`), replayButtons(replay, simulated, `simulated counterpart of rollout ${cells[0]}`)]));
  const files = $("#flown-files");
  files.append("Recordings to save: ");
  Object.entries(flown.recordings).forEach(([name, text]) => {
    files.append(element("a", name, { download: name, href: `data:text/csv;charset=utf-8,${encodeURIComponent(text)}` }), " ");
  });
  if (flown.amendments.length) table($("#amendments-table"), ["corrected", "who", "when", "before", "after", "why"], flown.amendments.map((made) =>
    [`episode ${made.episode}, ${made.idx}`, made.who, made.utc, JSON.stringify(made.before), JSON.stringify(made.after), made.why]));
}

// A term of the return as text; its scale is the reward's own.
function figures(value) {
  return String(Number(value.toPrecision(4)));
}

function seriesOf(stored) {
  return { at: stored.at, mu: stored.mu.map(column), sigma: stored.sigma.map(column), rate: column(stored.rate), reward: column(stored.reward) };
}

function fillChoice(select, labels, onChoice) {
  select.replaceChildren(...labels.map((text, i) => new Option(text, i)));
  select.parentElement.hidden = labels.length < 2;
  select.addEventListener("change", () => onChoice(Number(select.value)));
}

function showPictures(pictures) {
  $("#pictures").hidden = !pictures.length;
  pictures.forEach(({ title, source }) => {
    const figure = element("figure");
    figure.append(element("img", undefined, { src: source, alt: title }), element("figcaption", title));
    $("#pictures-list").append(figure);
  });
}

// ---- a policy for every approach

function showPolicy(data, replay) {
  const { numbers, pictures, notable } = data.policy;
  ["#numbers", "#notable"].forEach((id) => { $(id).hidden = false; });
  $("#convergence").hidden = true;
  table($("#numbers-table"), numbers.head, numbers.rows);
  $("#numbers-note").textContent = numbers.note;
  showPictures(pictures);
  $("#notable-title").textContent = "Flights with this policy";
  table($("#notable-table"), ["flight", "V", "φ", "verdict", "replay"], notable.map(({ what, landing }) => {
    const { outcome, spec } = data.landings[landing];
    return [what, `${spec.speed_mps.toFixed(2)} m/s`, `${spec.angle_deg.toFixed(1)}°`, outcome.verdict, replayButtons(replay, landing, what)];
  }));
  [1, 0].forEach((pane) => replay.show(pane, notable[Math.min(pane, notable.length - 1)].landing));
}

// ---- a run of `ivl sweep`

class SweepView {
  constructor(data, replay) {
    this.sweep = data.sweep;
    this.data = data;
    this.parameters = data.parameters;
    this.replay = replay;
    this.cells = this.rowsOf(this.sweep.cells).map((cell, id) => ({ ...cell, id }));
    this.trials = this.rowsOf(this.sweep.trials);
    fillChoice($("#gear"), this.sweep.gears.map(readable), () => this.chooseByMenu());
    fillChoice($("#speed-choice"), this.sweep.speeds.map((v) => `${v} m/s`), () => this.chooseByMenu());
    fillChoice($("#angle-choice"), this.sweep.angles.map((v) => `${v}°`), () => this.chooseByMenu());
    shown(this.parameters).forEach((parameter, i) => $("#region-colour").add(new Option(headOf(parameter), i)));
    ["#region-colour", "#region-gear"].forEach((id) => $(id).addEventListener("change", () => this.drawRegion()));
    this.sweep.gears.forEach((gear, i) => $("#region-gear").add(new Option(readable(gear), i)));
    ["#rates", "#region"].forEach((id) => { $(id).hidden = false; });
    this.drawRates();
    this.drawRegion();
    this.choose(this.firstShown());
  }

  // The cell with the best rate; of several the one nearest to the middle of the grid.
  firstShown() {
    const off = (cell) => Math.abs(cell.speed / this.sweep.speeds.length - 0.5) + Math.abs(cell.angle / this.sweep.angles.length - 0.5);
    return this.cells.reduce((best, cell) => (cell.rate > best.rate || (cell.rate === best.rate && off(cell) < off(best)) ? cell : best));
  }

  // Stored columns -> one object a row.
  rowsOf(stored) {
    const columns = Object.entries(stored).map(([name, values]) => [name, Array.isArray(values) ? values : column(values)]);
    return Array.from({ length: columns[0][1].length }, (_, i) => Object.fromEntries(columns.map(([name, values]) => [name, values[i]])));
  }

  drawRates() {
    const figure = polarFigure(this.sweep, this.cells, this.sweep.gears.map((_, i) => i));
    Plotly.newPlot("polar-plot", figure.traces, figure.layout, CONFIG);
    $("#polar-plot").on("plotly_click", ({ points: [point] }) => this.choose(this.cells[point.customdata]));
  }

  sameApproach(a, b) { return a.speed === b.speed && a.angle === b.angle; }

  chooseByMenu() {
    const [gear, speed, angle] = ["#gear", "#speed-choice", "#angle-choice"].map((id) => Number($(id).value));
    const cell = this.cells.find((c) => c.gear === gear && c.speed === speed && c.angle === angle);
    if (cell) this.choose(cell);
    else $("#cell-title").textContent = "no trials in this cell";
  }

  // Open a cell: outline, trials, the same approach with the other gears, its best landing, its convergence.
  choose(cell) {
    const sweep = this.sweep;
    this.cell = cell;
    [["#gear", cell.gear], ["#speed-choice", cell.speed], ["#angle-choice", cell.angle]].forEach(([id, value]) => { $(id).value = value; });
    outlineCell($("#polar-plot"), this.cells, cell);
    $("#cell-title").textContent = `${readable(sweep.gears[cell.gear])}, ${sweep.speeds[cell.speed]} m/s at ${sweep.angles[cell.angle]}°`;
    const own = this.trials.filter((trial) => trial.cell === cell.id);
    $("#cell-rate").textContent = `landing rate ${percent(cell.rate)} (95 % interval ${percent(cell.lo)} to ${percent(cell.hi)}, ${own.length} trials), best trial ${percent(cell.best)}`;
    table($("#trials-table"), ["trial", "rate", "clean", ...shown(this.parameters).map(headOf), "best landing"], own.map((t) => [String(t.trial), percent(t.rate), percent(t.clean),
      ...shown(this.parameters).map((_, i) => `${t[`mu_${i}`].toFixed(2)} ± ${t[`sigma_${i}`].toFixed(2)}`), replayButtons(this.replay, t.landing, `the best landing of trial ${t.trial}`)]));
    const others = this.cells.filter((c) => this.sameApproach(c, cell)).sort((a, b) => a.gear - b.gear);
    table($("#gears-table"), ["gear at this approach", "rate", "best landing"], others.map((c) => [readable(sweep.gears[c.gear]), percent(c.rate), replayButtons(this.replay, c.landing, `the best landing of ${readable(sweep.gears[c.gear])}`)]));
    if (cell.landing >= 0) this.replay.show(0, cell.landing);
    if (!this.replay.panes[1].landing) this.showContrast(others, cell);
    this.drawConvergence(own);
  }

  // The second view starts with the worst of the other gears at this approach.
  showContrast(others, cell) {
    const candidates = others.filter((c) => c.landing >= 0 && c.id !== cell.id).sort((a, b) => a.rate - b.rate);
    const landing = candidates.length ? candidates[0].landing : cell.landing;
    if (landing >= 0) this.replay.show(1, landing);
  }

  drawRegion() {
    const gear = $("#region-gear").value, sweep = this.sweep;
    const own = this.trials.filter((t) => !Number.isNaN(t.rrev) && (gear === "all" || this.cells[t.cell].gear === Number(gear)));
    const pick = (name) => own.map((t) => t[name]);
    const text = own.map((t) => { const c = this.cells[t.cell]; return `${readable(sweep.gears[c.gear])}, ${sweep.speeds[c.speed]} m/s at ${sweep.angles[c.angle]}°, trial ${t.trial}: rate ${percent(t.rate)}, ${shown(this.parameters).map(([symbol, unit], i) => `${symbol} ${t[`mu_${i}`].toFixed(1)} ${unit}`).join(", ")}`; });
    const figure = regionFigure({ rrev: pick("rrev"), ofY: pick("of_y"), d: pick("d"), rate: pick("rate"), parameter: pick(`mu_${$("#region-colour").value}`), cell: pick("cell"), text }, $("#region-colour").value, this.parameters);
    Plotly.react("region-plot", figure.traces, figure.layout, CONFIG);
    if (!this.regionListening) $("#region-plot").on("plotly_click", ({ points: [point] }) => this.choose(this.cells[point.customdata]));
    this.regionListening = true;
  }

  drawConvergence(trials) {
    const series = trials.map((t) => this.seriesOf(t)), best = trials.reduce((b, t, i) => (t.rate > trials[b].rate ? i : b), 0);
    const draw = (chosen) => {
      const figure = convergenceFigure(series[chosen], series.filter((_, i) => i !== chosen), null, this.sweep.limits, this.parameters);
      Plotly.react("convergence-plot", figure.traces, figure.layout, CONFIG);
      $("#trial").value = chosen;
    };
    const select = $("#trial");
    select.replaceChildren(...trials.map((t, i) => new Option(`trial ${t.trial}`, i)));
    select.parentElement.hidden = trials.length < 2;
    select.onchange = () => draw(Number(select.value));
    $("#convergence-note").textContent = `${$("#cell-title").textContent}; rate: share of landings on three or four legs in an episode; thin grey lines are the other trials of the cell.`;
    draw(best);
  }

  seriesOf(trial) {
    const { episodes } = this.sweep, part = (stored) => stored.values.slice(trial.first_episode, trial.first_episode + trial.n_episodes).map((v) => (v === null ? NaN : v * stored.unit));
    return { at: part(episodes.at), mu: episodes.mu.map(part), sigma: episodes.sigma.map(part), rate: part(episodes.rate), reward: part(episodes.reward) };
  }
}

async function start() {
  const data = JSON.parse(await inflate("data"));
  if (!data.policy) document.head.append(element("script", await inflate("plotly")));
  const replay = new Replay($("#replay"), data);
  fillHeader(data);
  const show = data.sweep ? (...of) => new SweepView(...of) : data.policy ? showPolicy : showLearn;
  const view = show(data, replay);
  window.report = { data, replay, view };
  document.body.dataset.ready = "true";
}

start().catch((error) => {
  $("#problem").hidden = false;
  $("#problem").textContent = `This page could not be shown: ${error.message}. It needs a browser of 2023 or later.`;
  throw error;
});
