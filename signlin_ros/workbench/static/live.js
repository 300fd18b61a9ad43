// The running system: the last minute of it, drawn anew with every frame that comes.

import * as api from "./api.js";
import { h, fill, number, unit, words, say } from "./dom.js";
import { css } from "./plots.js";
import { poles } from "./svg.js";

const MINUTE = 60;
const root = document.getElementById("live");
let source = null;
let view = null;

export function live(shown, state) {
  if (shown && !source) {
    view = new View(state);
    source = api.liveEvents();
    source.onmessage = (e) => view.take(JSON.parse(e.data));
    source.onerror = () => view.say("The server does not answer.");
  } else if (!shown && source) {
    source.close();
    source = null;
  }
}

export const restyleLive = () => view?.restyle();

// Curves of one topic: a ring of points for each column.
class Curves {
  constructor() {
    this.columns = [];
  }

  put(frame) {
    if (this.columns.length !== frame.t.length) this.columns = frame.t.map(() => ({ t: [], y: [] }));
    frame.t.forEach((t, k) => {
      this.columns[k].t.push(...t);
      this.columns[k].y.push(...frame.y[k]);
    });
  }

  forget(before) {
    for (const c of this.columns) {
      let k = 0;
      while (k < c.t.length && c.t[k] < before) k++;
      if (k > 200) {
        c.t.splice(0, k);
        c.y.splice(0, k);
      }
    }
  }
}

class View {
  constructor(state) {
    this.names = { state: state?.model?.states ?? [], input: state?.model?.inputs ?? [] };
    this.units = state?.model?.signals ?? {};
    this.curves = { state: new Curves(), input: new Curves(), error: new Curves(), A: new Curves() };
    this.plots = new Map();
    this.marks = [];
    this.paused = false;
    this.frames = 0;
    this.status = h("p", { id: "live-status", role: "status" }, "Waiting for a state ...");
    this.pause = h("button", { id: "pause", "aria-pressed": false, onclick: () => this.setPaused(!this.paused) }, "Pause");
    this.valid = h("p", { id: "live-valid", class: "quiet" });
    this.verdict = h("p", { id: "live-verdict" });
    this.marked = h("p", { id: "live-marks", class: "quiet" });
    this.holder = h("div", { class: "live-plots" });
    this.linear = h("div", { id: "live-linear" });
    fill(root, h("section", { class: "panel" },
      h("div", { class: "title" }, h("h2", {}, "Live"), this.status, this.pause,
        h("button", { id: "mark", onclick: () => this.mark() }, "Mark"),
        h("button", { id: "take", class: "primary", onclick: () => this.record() }, "Take the last 30 s as a record")),
      this.verdict, this.marked, h("div", { class: "tuner" }, this.holder, h("div", {}, this.valid, this.linear))));
  }

  say(text) {
    this.status.textContent = text;
  }

  setPaused(paused) {
    this.paused = paused;
    this.pause.setAttribute("aria-pressed", paused);
    this.pause.textContent = paused ? "Go on" : "Pause";
  }

  take(frame) {
    if (frame.why) {
      this.say(frame.why);
      return;
    }
    this.now = frame.now;
    for (const name of ["state", "input", "error"]) {
      if (frame[name]) this.curves[name].put(frame[name]);
      this.curves[name].forget(frame.now - MINUTE);
    }
    if (frame.model) this.model(frame.model);
    if (frame.texts?.verdict) this.hear(frame.texts.verdict);
    if (frame.texts?.model_yaml && this.yaml !== frame.texts.model_yaml) {
      if (this.yaml) this.mark("another model");
      this.yaml = frame.texts.model_yaml;
    }
    this.curves.A.forget(frame.now - MINUTE);
    if (frame.state) {
      this.seen = frame.now;
      this.frames += 1;
    }
    const rate = this.seen ? `${this.curves.state.columns.length} states` : "";
    this.say(!this.seen ? "Waiting for a state on the topic state or joint_states ..." : frame.now - this.seen > 1 ? `No state for ${Math.round(frame.now - this.seen)} s.` : `${rate}, live.`);
    root.dataset.frames = this.frames;
    root.dataset.samples = frame.samples;
    if (!this.paused && !this.waiting) {
      this.waiting = true;
      requestAnimationFrame(() => {
        this.waiting = false;
        this.draw();
      });
    }
  }

  // A change, a name or a verdict is marked; how long a diagnosis has been running is not.
  hear(text) {
    const { sentence, state } = told(text);
    this.verdict.textContent = sentence;
    const what = { changed: "changed", named: "named", running: this.asked ? "" : "diagnosis asked", done: "verdict" }[state];
    if (what) this.mark(what);
    if (state === "running") this.asked = true;
    if (state === "done" || state === "failed") this.asked = false;
  }

  model(m) {
    const flat = m.A.flat();
    this.curves.A.put({ t: flat.map(() => [m.t]), y: flat.map((v) => [v]) });
    this.A = m.A;
    this.valid.textContent = m.in_valid_range ? "✓ A_k inside the valid range of sign_j" : "△ A_k outside the valid range of sign_j";
    if (!this.paused) fill(this.linear, poles(m.poles, []));
  }

  name(kind, k) {
    const n = this.A?.length ?? this.names.state.length;
    if (kind === "A") return `A[${words(this.names.state[Math.floor(k / n)] ?? Math.floor(k / n) + 1)}, ${words(this.names.state[k % n] ?? (k % n) + 1)}]`;
    const list = kind === "error" ? this.names.state : this.names[kind];
    const own = list.length === this.curves[kind].columns.length ? list[k] : `${kind === "input" ? "u" : "x"}${k + 1}`;
    return kind === "error" ? `error of ${words(own)}` : words(own);
  }

  unit(kind, k) {
    return kind === "A" ? "1/s" : this.units[(kind === "input" ? this.names.input : this.names.state)[k]] ?? "";
  }

  draw() {
    for (const kind of ["state", "input", "error", "A"]) {
      this.curves[kind].columns.forEach((c, k) => {
        if (kind === "A" && !varies(c.y)) return;
        this.plot(`${kind} ${k}`, `${this.name(kind, k)}${unit(this.unit(kind, k))}`, kind, c);
      });
    }
  }

  plot(key, label, kind, c) {
    const held = this.plots.get(key);
    const data = [c.t.map((t) => t - this.now), c.y];
    if (held && held.label === label) {
      held.u.setData(data, false);
      held.data = data;
      const width = held.holder.clientWidth; // the window, or the number of plots beside it, may have changed
      if (width > 0 && Math.abs(width - held.u.width) > 1) held.u.setSize({ width, height: held.u.height });
      held.u.setScale("x", { min: -MINUTE, max: 0 });
      held.holder.dataset.points = data[0].length;
      return;
    }
    held?.u.destroy();
    held?.holder.remove();
    const colour = { state: "--measured", input: "--rival", error: "--simulated", A: "--residual" }[kind];
    const holder = h("div", { class: "plot", role: "img", "aria-label": `${label} over the last minute` }, h("p", { class: "axis-title" }, label));
    const after = { state: 0, input: 1, error: 2, A: 3 }[kind];
    const next = [...this.holder.children].find((x) => Number(x.dataset.order) > after);
    holder.dataset.order = after;
    this.holder.insertBefore(holder, next ?? null);
    const axis = { stroke: css("--text"), grid: { stroke: css("--grid"), width: 1 }, ticks: { stroke: css("--line"), width: 1 }, font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif" };
    const one = { label, kind, holder, data };
    one.u = new uPlot({
      width: Math.max(holder.clientWidth, 300), height: 118, legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false }, y: {} },
      axes: [{ ...axis, size: 30, values: (_, s) => s.map((v) => `${v} s`) }, { ...axis, size: 60, space: 22, values: (_, s) => s.map((v) => number(v, 4)) }],
      series: [{}, { stroke: css(colour), width: 1.2, points: { show: false }, ...(kind === "A" || kind === "error" ? { paths: uPlot.paths.stepped({ align: 1 }) } : {}) }],
      hooks: { drawClear: [(u) => this.drawMarks(u)] },
    }, data, holder);
    one.u.setScale("x", { min: -MINUTE, max: 0 });
    this.plots.set(key, one);
  }

  drawMarks(u) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.strokeStyle = css("--simulated");
    ctx.setLineDash([4, 4]);
    for (const { t } of this.marks) {
      const x = u.valToPos(t - this.now, "x", true);
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  }

  mark(what = "") {
    if (!this.now) return;
    this.marks.push({ t: this.now, what });
    const times = this.marks.map((m) => `${new Date(1000 * m.t).toLocaleTimeString()}${m.what ? ` (${m.what})` : ""}`);
    this.marked.textContent = `Marked: ${times.join(", ")}`;
    say("marked");
  }

  async record() {
    try {
      const done = await api.post("/live/take", { seconds: 30 });
      this.marked.textContent = `Taken as ${done.file}, ${done.samples} samples: see Records.`;
    } catch (error) {
      this.marked.textContent = error.message;
    }
    say(this.marked.textContent);
  }

  restyle() {
    for (const one of this.plots.values()) {
      one.u.destroy();
      one.holder.remove();
    }
    this.plots.clear();
    this.draw();
  }
}

// What a monitor says, as it writes it: JSON like that of diagnose, with its state.
function told(text) {
  try {
    const verdict = JSON.parse(text);
    return { sentence: verdict.sentence ?? verdict.verdict ?? text, state: verdict.state };
  } catch {
    return { sentence: text };
  }
}

function varies(values) {
  const first = values[0];
  return values.some((v) => v !== first && v !== null);
}
