// Two landings side by side under one clock, which is zero at the trigger.

const SPEEDS = [["auto", "slow near flip and contact"], ["1", "real time"], ["0.2", "1/5"], ["0.05", "1/20"], ["0.02", "1/50"]];
const SLOW = 0.04, BRISK = 0.25;  // of real time, in "auto"

class Replay {
  constructor(root, data) {
    this.root = root;
    this.data = data;
    this.view = { azimuth: -0.35, elevation: -0.2, zoom: 1 };
    this.panes = ["a", "b"].map((name) => ({ name, canvas: root.querySelector(`#canvas-${name}`), landing: null, drawn: null }));
    this.slider = root.querySelector("#time");
    this.button = root.querySelector("#play");
    this.speed = root.querySelector("#speed");
    SPEEDS.forEach(([value, text]) => this.speed.add(new Option(text, value)));
    this.playing = false;
    this.slider.addEventListener("input", () => { this.stop(); this.draw(); });
    this.button.addEventListener("click", () => (this.playing ? this.stop() : this.play()));
    root.querySelector("#view-reset").addEventListener("click", () => { Object.assign(this.view, { azimuth: -0.35, elevation: -0.2, zoom: 1 }); this.draw(); });
    this.panes.forEach((pane) => this.listen(pane.canvas));
    new ResizeObserver(() => this.draw()).observe(root);
  }

  // Drag or arrow keys turn the view of both panes; + and - zoom.
  listen(canvas) {
    const turn = (dx, dy) => {
      this.view.azimuth += 0.008 * dx;
      this.view.elevation = Math.min(Math.max(this.view.elevation + 0.008 * dy, -1.5), 1.5);
      this.draw();
    };
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => { if (event.buttons) turn(event.movementX, event.movementY); });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[event.key];
      const zoom = { "+": 1.15, "-": 1 / 1.15 }[event.key];
      if (step) turn(...step);
      else if (zoom) { this.view.zoom = Math.min(Math.max(this.view.zoom * zoom, 0.3), 5); this.draw(); }
      else return;
      event.preventDefault();
    });
  }

  // Show landing number `index` in pane 0 or 1.
  show(pane, index) {
    this.stop();
    const target = this.panes[pane];
    target.index = index;
    target.landing = unpack(this.data.landings[index], this.data.scale);
    this.retime();
    this.describe(target);
    this.slider.value = Math.round(1000 * Math.max(...this.shown().map((p) => this.contactOf(p.landing))) + 60);
    this.draw();
  }

  shown() { return this.panes.filter((pane) => pane.landing); }

  contactOf(landing) {
    const t = landing.outcome.t_impact_s;
    return (t === null ? closest(landing) : t) - landing.t0;
  }

  // Span of the slider, of the slow part, and the marks of what happened.
  retime() {
    const landings = this.shown().map((pane) => pane.landing);
    this.slider.min = Math.floor(1000 * Math.min(...landings.map((l) => l.t[0] - l.t0)));
    this.slider.max = Math.ceil(1000 * Math.max(...landings.map((l) => l.t[l.t.length - 1] - l.t0)));
    this.slowFrom = -0.03;
    this.slowTo = Math.max(...landings.map((l) => this.contactOf(l))) + 0.15;
    const marks = this.root.querySelector("#marks");
    marks.replaceChildren();
    const zeros = landings.map(zeroOf), alike = zeros.every((zero) => zero === zeros[0]);
    const told = alike ? zeros[0] : zeros.map((zero, i) => `${zero} (${"AB"[i]})`).join(", ");
    this.root.querySelector("#zero").textContent = `from ${told}`;
    this.mark(marks, 0, "trigger", told, 0);
    this.shown().forEach((pane) => {
      const row = this.panes.indexOf(pane);
      pane.landing.feet.filter((event) => event[2] === 2).forEach((event) => this.mark(marks, event[0] - pane.landing.t0, "stick", `${"AB"[row]}: foot ${event[1] + 1} sticks`, row));
    });
  }

  mark(marks, t, kind, title, row) {
    const mark = document.createElement("span");
    mark.className = `mark ${kind} row${row}`;
    mark.title = `${title}, ${(1000 * t).toFixed(0)} ms`;
    mark.style.left = `${100 * (1000 * t - this.slider.min) / (this.slider.max - this.slider.min)}%`;
    marks.append(mark);
  }

  describe(pane) {
    const { spec, outcome, label } = pane.landing, part = (name) => this.root.querySelector(`#${name}-${pane.name}`);
    part("title").textContent = label;
    part("verdict").textContent = outcome.verdict;
    part("verdict").className = `verdict ${outcome.clean ? "good" : outcome.four_leg || outcome.no_go ? "fair" : "bad"}`;
    part("spec").textContent = `V ${Number(spec.speed_mps.toFixed(3))} m/s, φ ${Number(spec.angle_deg.toFixed(2))}°, ${shown(this.data.parameters).map(([symbol, unit], i) => `${symbol} ${spec.theta[i].toFixed(3)} ${unit}`).join(", ")}`;
    const offset = this.data.geometry[pane.landing.geometry].sensed_gap_offset;
    this.root.querySelector("#offset").textContent = offset ? `d sensed counts to a plane ${(1000 * offset).toFixed(0)} mm behind the ceiling.` : "";
    pane.canvas.setAttribute("aria-label", `Landing ${pane.name.toUpperCase()}: ${label}, ${part("verdict").textContent}. Arrow keys turn the view, plus and minus zoom.`);
  }

  draw() {
    const clock = Number(this.slider.value) / 1000;
    this.root.querySelector("#clock").textContent = `${clock < 0 ? "−" : "+"}${Math.abs(1000 * clock).toFixed(0)} ms`;
    this.slider.setAttribute("aria-valuetext", `${(1000 * clock).toFixed(0)} milliseconds after ${zeroOf(this.shown()[0].landing)}`);
    for (const pane of this.shown()) {
      pane.state = stateAt(pane.landing, clock + pane.landing.t0);
      pane.drawn = drawMoment(pane.canvas, pane.landing, this.data.geometry[pane.landing.geometry], pane.state, this.view);
      this.tell(pane);
    }
  }

  tell(pane) {
    const { state } = pane, stuck = state.feet.flatMap((foot, k) => (foot.state === 2 ? [k + 1] : []));
    const touched = pane.landing.outcome.t_impact_s !== null && state.t > pane.landing.outcome.t_impact_s;
    const none = (text) => (touched || !state.d ? "–" : text);  // samples stop meaning anything at the first contact
    const values = {
      t: `${state.t.toFixed(3)} s`, phase: state.phase, rrev: none(`${fixed(state.rrev, 2)} 1/s`),
      ofy: none(`${fixed(state.ofY, 2)} rad/s`), d: none(`${(1000 * state.d).toFixed(0)} mm`),
      gap: `${fixed(-1000 * state.pose.p[2], 0)} mm`, pitch: `${fixed(state.pitch, 0)}°`, feet: stuck.length ? stuck.join(" ") : "none",
    };
    for (const [name, text] of Object.entries(values)) this.root.querySelector(`#${name}-${pane.name}`).textContent = text;
  }

  play() {
    if (!this.shown().length) return;
    if (Number(this.slider.value) >= Number(this.slider.max)) this.slider.value = this.slider.min;
    this.playing = true;
    this.button.textContent = "❚❚ pause";
    this.at = Number(this.slider.value) / 1000;
    this.before = null;
    requestAnimationFrame((now) => this.frame(now));
  }

  stop() {
    this.playing = false;
    this.button.textContent = "▶ play";
  }

  rate() {
    if (this.speed.value !== "auto") return Number(this.speed.value);
    return this.at > this.slowFrom && this.at < this.slowTo ? SLOW : BRISK;
  }

  frame(now) {
    if (!this.playing) return;
    this.at += this.rate() * Math.min((now - (this.before ?? now)) / 1000, 0.1);
    this.before = now;
    this.slider.value = 1000 * this.at;
    this.draw();
    if (1000 * this.at >= Number(this.slider.max)) this.stop();
    else requestAnimationFrame((next) => this.frame(next));
  }
}
