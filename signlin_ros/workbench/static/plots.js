// Curves over time, one plot below the other, zoomed together: by dragging, by the wheel, by the keyboard.

import { decode } from "./api.js";
import { h, number, unit, words } from "./dom.js";
import * as place from "./place.js";

export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const LOOKS = {
  recorded: { stroke: "--measured", width: 1.2 },
  measured: { stroke: "--measured", width: 1.2 },
  simulated: { stroke: "--simulated", width: 1.8, dash: [7, 4] },
  residual: { stroke: "--residual", width: 1.1 },
  also0: { stroke: "--rival", width: 1.5, dash: [2, 3] },
  also1: { stroke: "--good", width: 1.5, dash: [9, 3, 2, 3] },
  also2: { stroke: "--noise", width: 1.8 },
  command: { stroke: "--measured", width: 1.4 },
  true: { stroke: "--measured", width: 1.4 },
  other: { stroke: "--rival", width: 1.8, dash: [7, 4] },
  low: { stroke: "--noise", width: 0 },
  high: { stroke: "--noise", width: 0 },
  distance: { stroke: "--residual", width: 1.4 },
};
const EDGES = ["low", "high"]; // of a band that is shaded
const LABELS = { recorded: "recorded", measured: "measured", simulated: "simulated", residual: "residual: measured less simulated" };

export function legend(names) {
  const line = (look) =>
    h("svg", { width: 34, height: 10, "aria-hidden": true },
      h("path", { d: "M1 5H33", fill: "none", stroke: `var(${look.stroke})`, "stroke-width": look.width + 0.8, "stroke-dasharray": look.dash?.join(" ") }));
  return h("div", { class: "legend" }, names.map((n) => (Array.isArray(n) ? n : [n, LABELS[n]])).map(([n, text]) => h("span", {}, line(LOOKS[n]), " ", text)));
}

export class Stack {
  // ask(span) returns {plots, span}; rows says which curves go into which plot: [{curves, height}];
  // density: points asked for, for each pixel of width.
  // labels: name of a curve -> what it is called where it is read
  constructor(element, ask, rows, density = 3, labels = {}) {
    Object.assign(this, { element, ask, rows, density, labels, charts: [], span: [null, null], whole: null, shaded: [], pending: null, drawn: 0 });
    element.classList.add("plots");
    element.tabIndex = 0;
    element.setAttribute("role", "group");
    element.setAttribute("aria-label", "Plots over time. Arrow keys move, plus and minus zoom, 0 shows all.");
    element.addEventListener("keydown", (e) => this.key(e));
    this.watcher = new ResizeObserver(() => this.resize());
    this.watcher.observe(element);
    place.watch(element);
  }

  async load(span = this.span) {
    this.span = span;
    if (this.loading) {
      this.pending = span;
      return;
    }
    this.loading = true;
    try {
      const found = await this.ask({ from: span[0], to: span[1], points: Math.min(5000, Math.max(1000, this.density * Math.round(this.element.clientWidth || 800))) });
      if (found) this.draw(found);
    } finally {
      this.loading = false;
    }
    if (this.pending) {
      const next = this.pending;
      this.pending = null;
      await this.load(next);
    }
  }

  draw({ plots, span, rows }) {
    this.whole = span;
    this.over = rows ? "row" : "time [s]";
    const wanted = plots.flatMap((p) => this.rows.map((row) => ({ p, row, names: row.curves.filter((c) => c in p.curves) }))).filter((x) => x.names.length);
    const same = wanted.length === this.charts.length && wanted.every((w, k) => this.charts[k].name === w.p.name && this.charts[k].names.join() === w.names.join());
    if (!same) this.clear();
    wanted.forEach(({ p, row, names }, k) => {
      const data = [decode(p.t), ...names.map((n) => decode(p.curves[n]))];
      if (same) {
        this.charts[k].data = data;
        this.charts[k].u.batch(() => {
          this.charts[k].u.setData(data, false);
          this.scale(this.charts[k].u);
        });
      } else this.charts.push(this.make(p, row, names, data, k === wanted.length - 1));
    });
    this.points = Math.max(...this.charts.map((c) => c.data[0].length));
    this.drawn += 1;
    this.element.dataset.points = this.points;
    this.element.dataset.drawn = this.drawn;
    this.element.style.minHeight = "";
  }

  scale(u) {
    const [low, high] = [this.span[0] ?? this.whole[0], this.span[1] ?? this.whole[1]];
    u.setScale("x", { min: low, max: high });
  }

  make(p, row, names, data, last) {
    const holder = h("div", { class: "plot", role: "img", "aria-label": `${p.name}${unit(p.unit)}: ${names.join(", ")} over time in s` });
    this.element.append(holder);
    const axis = { stroke: css("--text"), grid: { stroke: css("--grid"), width: 1 }, ticks: { stroke: css("--line"), width: 1 }, font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif" };
    const label = `${names[0] === "residual" ? "residual" : words(p.name)}${unit(p.unit)}`;
    const chart = { name: p.name, names, data };
    const room = Math.min(7.5 * label.length + 16, 240); // the label stands upright beside the curve
    const reading = h("div", { class: "reading", "aria-hidden": true });
    const read = (v) => {
      const k = v.cursor.idx;
      const called = (name) => this.labels[name] ?? name.replace(/^also\d/, "other model");
      const text = (j) => `${called(names[j])} ${number(v.data[j + 1][k], 4)}`;
      reading.textContent = k === null || k === undefined ? "" : `${number(v.data[0][k], 6)}${this.over === "row" ? "" : " s"}: ${names.flatMap((n, j) => (EDGES.includes(n) ? [] : [text(j)])).join(", ")}${p.unit && p.unit !== "-" ? ` ${p.unit}` : ""}`;
    };
    const u = new uPlot({
      width: Math.max(this.element.clientWidth, 300),
      height: Math.max(row.height, room) + (last ? 52 : 0),
      legend: { show: false },
      cursor: { sync: { key: "time" }, drag: { x: true, y: false, setScale: false }, points: { size: 6 } },
      scales: { x: { time: false }, y: { range: () => ranged(chart.data) } },
      axes: [
        { ...axis, ticks: { ...axis.ticks, show: last }, size: last ? 42 : 8, values: last ? undefined : (_, s) => s.map(() => ""), label: last ? this.over : undefined, labelSize: last ? 18 : 0 },
        { ...axis, size: 64, space: row.height < 100 ? 15 : 22, label, labelSize: 18, values: (_, s) => s.map((v) => number(v, 4)) },
      ],
      bands: EDGES.every((n) => names.includes(n)) ? [{ series: [1 + names.indexOf("high"), 1 + names.indexOf("low")], fill: css("--grid") }] : [],
      series: [{}, ...names.map((n) => ({ label: n, stroke: css(LOOKS[n].stroke), width: LOOKS[n].width, dash: LOOKS[n].dash, points: { show: false } }))],
      hooks: { setCursor: [read], setSelect: [(v) => this.selected(v)], drawClear: [(v) => this.shade(v)] },
    }, data, holder);
    holder.append(reading);
    u.over.addEventListener("dblclick", () => this.load([null, null]));
    u.over.addEventListener("wheel", (e) => this.wheel(e, u), { passive: false });
    chart.u = u;
    if (this.whole) this.scale(u);
    return chart;
  }

  selected(u) {
    const { left, width } = u.select;
    if (width < 4) return;
    const span = [u.posToVal(left, "x"), u.posToVal(left + width, "x")];
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.load(span);
  }

  wheel(e, u) {
    if (!e.ctrlKey) return;
    e.preventDefault();
    this.zoom(e.deltaY > 0 ? 1.4 : 1 / 1.4, u.posToVal(e.offsetX, "x"));
  }

  zoom(factor, centre) {
    const [low, high] = this.now();
    const c = centre ?? (low + high) / 2;
    this.load(this.within(c - (c - low) * factor, c + (high - c) * factor));
  }

  now() {
    return [this.span[0] ?? this.whole[0], this.span[1] ?? this.whole[1]];
  }

  within(low, high) {
    if (high - low >= this.whole[1] - this.whole[0]) return [null, null];
    const shift = Math.max(this.whole[0] - low, 0) - Math.max(high - this.whole[1], 0);
    return [low + shift, high + shift];
  }

  key(e) {
    if (!this.whole) return;
    const [low, high] = this.now();
    const step = (high - low) / 5;
    const does = {
      "+": () => this.zoom(1 / 1.5), "=": () => this.zoom(1 / 1.5), "-": () => this.zoom(1.5), 0: () => this.load([null, null]),
      ArrowLeft: () => this.load(this.within(low - step, high - step)),
      ArrowRight: () => this.load(this.within(low + step, high + step)),
    }[e.key];
    if (!does || e.ctrlKey || e.metaKey || e.altKey) return;
    e.preventDefault();
    does();
  }

  shade(u) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.fillStyle = css("--shade");
    for (const [from, to] of this.shaded) {
      const a = Math.max(u.valToPos(from, "x", true), bbox.left);
      const b = Math.min(u.valToPos(to, "x", true), bbox.left + bbox.width);
      if (b >= a) ctx.fillRect(a, bbox.top, Math.max(b - a, 1), bbox.height);
    }
    ctx.restore();
  }

  setShaded(intervals) {
    this.shaded = intervals;
    for (const c of this.charts) c.u.redraw(false);
  }

  resize() {
    const width = this.element.clientWidth;
    for (const c of this.charts) if (width > 0 && Math.abs(c.u.width - width) > 1) c.u.setSize({ width, height: c.u.height });
  }

  restyle() {
    if (!this.charts.length) return;
    this.clear();
    this.load();
  }

  clear() {
    for (const c of this.charts) c.u.destroy();
    this.charts = [];
    this.element.replaceChildren();
  }
}

// The range of all curves (what is not a number is left out), and some room.
function ranged(data) {
  let low = Infinity, high = -Infinity;
  for (const curve of data.slice(1)) {
    for (const v of curve) {
      if (v < low) low = v;
      if (v > high) high = v;
    }
  }
  if (low > high) return [-1, 1];
  const room = 0.06 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [low - room, high + room];
}
