// Small pictures: evidence over a coordinate, bars of the ladder, poles in the plane. Colours come from the style sheet.

import { decode } from "./api.js";
import { h, number, unit, words } from "./dom.js";

export function ticks(low, high, count = 5) {
  const raw = (high - low) / count || 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((f) => f * power).find((s) => s >= raw * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

class Frame {
  constructor(title, xs, ys, labels, width = 520, height = 300) {
    const longest = Math.max(...ticks(ys[0], ys[1]).map((v) => number(v, 4).length), 3);
    Object.assign(this, { width, height, left: 34 + 7.2 * longest, right: width - 12, top: 12, bottom: height - 44 });
    this.x0 = xs[0]; this.x1 = xs[1]; this.y0 = ys[0]; this.y1 = ys[1];
    this.svg = h("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", width: "100%" }, h("title", {}, title));
    this.clip = `clip-${Math.random().toString(36).slice(2)}`;
    this.svg.append(h("defs", {}, h("clipPath", { id: this.clip }, h("rect", { x: this.left, y: this.top, width: this.right - this.left, height: this.bottom - this.top }))));
    this.inside = h("g", { "clip-path": `url(#${this.clip})` });
    this.axes(labels);
    this.svg.append(this.inside);
  }

  x(v) { return this.left + ((v - this.x0) / (this.x1 - this.x0)) * (this.right - this.left); }
  y(v) { return this.bottom - ((v - this.y0) / (this.y1 - this.y0)) * (this.bottom - this.top); }

  axes([xlabel, ylabel]) {
    for (const v of ticks(this.x0, this.x1)) {
      this.svg.append(h("path", { class: "grid", d: `M${this.x(v)} ${this.top}V${this.bottom}` }),
        h("text", { x: this.x(v), y: this.bottom + 16, "text-anchor": "middle" }, number(v, 4)));
    }
    for (const v of ticks(this.y0, this.y1)) {
      this.svg.append(h("path", { class: "grid", d: `M${this.left} ${this.y(v)}H${this.right}` }),
        h("text", { x: this.left - 6, y: this.y(v) + 4, "text-anchor": "end" }, number(v, 4)));
    }
    this.svg.append(h("path", { class: "axis", d: `M${this.left} ${this.top}V${this.bottom}H${this.right}` }),
      h("text", { x: (this.left + this.right) / 2, y: this.height - 8, "text-anchor": "middle" }, xlabel),
      h("text", { x: 14, y: (this.top + this.bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${(this.top + this.bottom) / 2})` }, ylabel));
  }

  line(xs, ys, cls) {
    let d = "", open = false;
    for (let i = 0; i < xs.length; i++) {
      if (!Number.isFinite(ys[i])) { open = false; continue; }
      d += `${open ? "L" : "M"}${this.x(xs[i]).toFixed(1)} ${this.y(ys[i]).toFixed(1)}`;
      open = true;
    }
    this.inside.append(h("path", { class: cls, d }));
  }

  dots(xs, ys, cls) {
    let d = "";
    for (let i = 0; i < xs.length; i++) if (Number.isFinite(ys[i])) d += `M${this.x(xs[i]).toFixed(1)} ${this.y(ys[i]).toFixed(1)}h0`;
    this.inside.append(h("path", { class: cls, d }));
  }

  band(xs, low, high, cls) {
    const up = Array.from(xs, (v, i) => `${this.x(v).toFixed(1)} ${this.y(high[i]).toFixed(1)}`);
    const down = Array.from(xs, (v, i) => `${this.x(v).toFixed(1)} ${this.y(low[i]).toFixed(1)}`).reverse();
    this.inside.append(h("polygon", { class: cls, points: [...up, ...down].join(" ").replaceAll(" ", ",").replaceAll(",,", " ") }));
  }
}

function quantiles(values, low = 0.004, high = 0.996) {
  const sorted = Float64Array.from(values.filter(Number.isFinite)).sort();
  if (!sorted.length) return [-1, 1];
  return [sorted[Math.floor(low * (sorted.length - 1))], sorted[Math.ceil(high * (sorted.length - 1))]];
}

const wider = ([low, high], share = 0.08) => (low === high ? [low - 1, high + 1] : [low - share * (high - low), high + share * (high - low)]);

// What the motion lacks without an effect, over the coordinate that tells most, and the effect's own curve on it.
export function evidence(e, which, cls) {
  const side = e[which];
  const x = decode(e.x), dots = decode(which === "named" ? e.dots : e.rival_dots);
  const sides = [e.named, e.rival].filter(Boolean); // both pictures have the same axes
  const all = [e.dots, e.rival_dots].filter(Boolean).flatMap((d) => [...decode(d)]);
  const name = side.effect ? words(side.effect) : "nothing in its place";
  const ys = wider(quantiles([...all, ...sides.flatMap((s) => s.curve.flatMap((b) => [...decode(b.mean)]))]), 0.12);
  const labels = [`${e.over}${unit(e.over_unit)}`, `${e.quantity}${unit(e.unit)}`];
  const f = new Frame(`${e.quantity} over ${e.over}: measured, and as ${name} makes it`, wider(quantiles(x, 0.001, 0.999), 0.03), ys, labels);
  f.dots(x, dots, "dots");
  for (const b of side.found) {
    const [at, mean, two] = [decode(b.at), decode(b.mean), decode(b.two_errors)];
    f.band(at, mean.map((m, i) => m - two[i]), mean.map((m, i) => m + two[i]), "band");
    f.line(at, mean, "mean");
  }
  for (const b of side.curve) f.line(decode(b.at), decode(b.mean), cls);
  const values = Object.entries(side.parameters).map(([k, v]) => `${k} = ${v}`).join(", ");
  const mark = (cls, text) => h("span", {}, h("svg", { width: 30, height: 12, "aria-hidden": true }, cls === "dots" ? [4, 11, 19, 26].map((x, k) => h("circle", { cx: x, cy: k % 2 ? 4 : 8, r: 1.8, fill: "var(--measured)", "fill-opacity": 0.5 })) : h("path", { class: cls, d: "M1 6H29" })), " ", text);
  const key = h("div", { class: "legend" }, mark("dots", "samples"), mark("mean", "their mean, ± 2 standard errors"), mark(cls, `computed with ${name}`));
  return h("figure", {}, key, f.svg, h("figcaption", { class: "quiet" },
    h("b", {}, name), values ? `: ${values}. ` : ". ", `It leaves ${number(side.left)} ${e.unit} (RMS).`));
}

// How large the missing force is by order, before and after: bars side by side.
export function spectrum(s, unitText) {
  const orders = decode(s.orders), missing = decode(s.missing), left = decode(s.left);
  const top = Math.max(...missing, ...left, 1e-300);
  const f = new Frame("Amplitude of the missing force by order", [0.3, orders.length + 0.7], [0, 1.08 * top], ["periods per turn", `amplitude${unit(unitText)}`]);
  const bar = (k, v, cls, shift) => f.inside.append(h("rect", { class: cls, x: f.x(orders[k] + shift), y: f.y(v), width: Math.max(f.x(0.36) - f.x(0), 1.5), height: Math.max(f.bottom - f.y(v), 0) }));
  for (let k = 0; k < orders.length; k++) {
    bar(k, missing[k], "bar first", -0.38);
    bar(k, left[k], "bar", 0.02);
  }
  const box = (cls) => h("svg", { width: 14, height: 12, "aria-hidden": true }, h("rect", { class: cls, x: 0, y: 1, width: 12, height: 10 }));
  return h("figure", {}, h("div", { class: "legend" }, h("span", {}, box("bar first"), " missing without it"), h("span", {}, box("bar"), " left with it")), f.svg, h("figcaption", { class: "quiet" }, "The part of the record that is slow enough for these waves, by order."));
}

// One quantity over another.
export function scatter(curves, labels) {
  const sides = Object.entries(curves).map(([name, [x, y]]) => [name, decode(x), decode(y)]);
  const reach = (k) => wider(quantiles(sides.flatMap((s) => [...s[k]]), 0, 1), 0.04);
  const f = new Frame(`${labels[1]} over ${labels[0]}`, reach(1), reach(2), labels, 620, 420);
  for (const [name, x, y] of sides) f.line(x, y, `xy ${name}`);
  return f.svg;
}

// The error on validation data, a bar for each step, and the noise below which nothing can fall.
export function ladder(rungs, channel, unitText, what = "RMS error on validation data") {
  const scores = rungs.map((r) => r.validation[channel]).filter(Boolean);
  const top = Math.max(...scores.map((s) => s.rmse ?? 0), 1e-300);
  const noise = scores.find((s) => s.rmse_over_noise)?.rmse / scores.find((s) => s.rmse_over_noise)?.rmse_over_noise;
  const width = 620, left = 190, full = 280, step = 34;
  const svg = h("svg", { viewBox: `0 0 ${width} ${rungs.length * step + 40}`, width: "100%", role: "img" }, h("title", {}, `${channel}: ${what}, step by step`));
  svg.append(h("text", { x: 0, y: 14, "font-weight": 600 }, `${channel}${unit(unitText)}: ${what}`));
  rungs.forEach((r, k) => {
    const s = r.validation[channel];
    const known = Number.isFinite(s?.rmse ?? NaN);
    const y = 26 + k * step, size = known ? Math.max((full * s.rmse) / top, 1) : 0;
    svg.append(h("text", { x: left - 8, y: y + 15, "text-anchor": "end" }, r.label));
    if (!known) svg.append(h("text", { class: "none", x: left, y: y + 15 }, "not computed"));
    else svg.append(h("rect", { class: k ? "bar" : "bar first", x: left, y, width: size, height: 22, rx: 2 }),
      h("text", { x: left + size + 6, y: y + 15 }, `${number(s?.rmse)}${s?.rmse_over_noise ? `  (${number(s.rmse_over_noise)} × noise)` : ""}`));
  });
  if (Number.isFinite(noise)) {
    const x = left + (full * noise) / top;
    svg.append(h("path", { class: "noise", d: `M${x} 22V${26 + rungs.length * step}` }), h("text", { x, y: 38 + rungs.length * step, "text-anchor": "middle" }, "noise"));
  }
  return svg;
}

// Poles of A_k in the plane; before the sliders were moved in grey.
export function poles(now, before) {
  const all = [...now, ...before];
  const far = (values) => Math.max(...values.map(Math.abs), 1e-9);
  const xs = [-1.15 * far(all.map((p) => p[0])), 0.25 * far(all.map((p) => p[0]))];
  const high = 1.25 * Math.max(far(all.map((p) => p[1])), 0.15 * far(all.map((p) => p[0])));
  const f = new Frame("Poles of A_k", xs, [-high, high], ["real part [1/s]", "imaginary part [rad/s]"], 420, 260);
  f.inside.append(h("rect", { class: "stable", x: f.left, y: f.top, width: Math.max(f.x(0) - f.left, 0), height: f.bottom - f.top }),
    h("path", { class: "axis", d: `M${f.x(0)} ${f.top}V${f.bottom}` }));
  const cross = ([re, im], cls) => f.inside.append(h("path", { class: `pole ${cls}`, d: `M${f.x(re) - 6} ${f.y(im) - 6}l12 12m0 -12l-12 12` }));
  before.forEach((p) => cross(p, "before"));
  now.forEach((p) => cross(p, ""));
  return f.svg;
}
