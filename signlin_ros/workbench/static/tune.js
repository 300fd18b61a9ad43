// Sliders: dragging one redraws simulation, residual, A_k, B_k and the poles; at any time one question is on its way.

import * as api from "./api.js";
import { h, fill, number, unit, words } from "./dom.js";
import { Stack, legend } from "./plots.js";
import { poles } from "./svg.js";

const ROWS = [{ curves: ["measured", "simulated"], height: 150 }, { curves: ["residual"], height: 100 }];

export class Tuner {
  constructor(state, std, keep) {
    this.model = state.model.name;
    this.parameters = state.model.parameters;
    this.std = std;
    this.values = {};
    this.before = null;
    this.started = false;
    this.stack = new Stack(h("div", { id: "plots-tune" }), (span) => this.ask(span), ROWS, 1.5);
    this.linear = h("div", { id: "linear" });
    this.left = h("p", { id: "left", class: "quiet" });
    this.keeping = h("button", { id: "keep", disabled: true, onclick: () => keep(this.values) }, "Keep these values as a model version");
    this.sliders = h("div", { class: "sliders" }, this.parameters.map((p) => this.slider(p)));
    this.element = h("div", { class: "tuner" },
      h("div", {}, legend(["measured", "simulated", "residual"]), this.stack.element),
      h("div", {}, this.sliders, h("div", { class: "row" }, this.keeping, h("button", { id: "reset", onclick: () => this.reset() }, "As they were")), this.left, this.linear));
  }

  slider(p) {
    const steps = 400;
    const value = (k) => p.from + ((p.to - p.from) * k) / steps;
    const unitText = p.unit === "-" ? "" : p.unit;
    const shown = h("input", { type: "text", inputmode: "decimal", class: "typed", id: `type-${p.name}`, "aria-label": `${p.name} in ${unitText || "1"}; allowed: ${p.range}`, title: `allowed: ${p.range}`, value: number(p.value, 6), autocomplete: "off" });
    const told = h("span", { class: "quiet" }, `${unitText}${this.std[p.name] ? ` ± ${number(this.std[p.name], 2)}` : ""}`);
    const range = h("input", { type: "range", id: `slide-${p.name}`, min: 0, max: steps, step: 1, "aria-label": `${p.name}: ${p.doc}` });
    range.value = Math.round(((p.value - p.from) / (p.to - p.from || 1)) * steps);
    p.start = range.value;
    range.addEventListener("input", () => {
      this.values[p.name] = value(Number(range.value));
      shown.value = number(this.values[p.name], 4);
      shown.setCustomValidity("");
      changed();
    });
    const changed = () => {
      range.setAttribute("aria-valuetext", `${shown.value} ${unitText}`);
      this.keeping.disabled = false;
      this.moved = performance.now();
      this.stack.load();
    };
    shown.addEventListener("change", () => {
      const given = Number(shown.value.trim().replace(",", "."));
      const bad = shown.value.trim() === "" || !Number.isFinite(given) || (p.low !== null && given < p.low) || (p.high !== null && given > p.high) || (given === p.low && p.range.startsWith("("));
      shown.setCustomValidity(bad ? `allowed: ${p.range}` : "");
      if (bad) {
        shown.reportValidity();
        return;
      }
      p.from = Math.min(p.from, given);
      p.to = Math.max(p.to, given);
      range.value = Math.round(((given - p.from) / (p.to - p.from || 1)) * steps);
      this.values[p.name] = given;
      changed();
    });
    p.reset = () => {
      range.value = p.start;
      shown.value = number(p.value, 6);
      shown.setCustomValidity("");
    };
    return [h("label", { for: `slide-${p.name}`, title: p.doc }, words(p.name).replace(".", " ")), range, h("span", { class: "given" }, shown, " ", told)];
  }

  reset() {
    this.values = {};
    this.keeping.disabled = true;
    for (const p of this.parameters) p.reset();
    this.stack.load();
  }

  start() {
    if (this.started) return;
    this.started = true;
    fill(this.left, "Simulating; the first time takes some seconds ...");
    this.stack.load([null, null]);
  }

  async ask(span) {
    try {
      const found = await api.show("tune", { ...span, values: this.values, at: this.at });
      this.tell(found);
      return found;
    } catch (error) {
      fill(this.left, h("span", { class: "error" }, error.message));
      return null;
    } finally {
      if (this.moved) this.stack.element.dataset.ms = Math.round(performance.now() - this.moved);
    }
  }

  tell(found) {
    fill(this.left, "Left (RMS): ", Object.entries(found.rms).map(([n, v]) => `${words(n)} ${number(v, 4)}`).join(", "));
    const l = found.linear;
    if (l.why) {
      fill(this.linear, h("p", { class: "error" }, l.why));
      return;
    }
    this.before ??= l.poles;
    const point = h("input", { type: "range", id: "at", min: found.span[0], max: found.span[1], step: (found.span[1] - found.span[0]) / 400, "aria-label": "Operating point: time in s" });
    point.value = found.at;
    point.addEventListener("input", () => {
      this.at = Number(point.value);
      this.stack.load();
    });
    fill(this.linear,
      h("h3", {}, "x' = A", h("sub", {}, "k"), " x + B", h("sub", {}, "k"), " u + c at t = ", number(found.at, 5), " s"),
      point, h("p", { class: "quiet" }, l.states.map((n, i) => `${words(n)} ${number(l.x[i], 4)}${unit(l.units[n])}`).join(", "), l.in_valid_range ? "" : "; outside the valid range of sign_j"),
      h("div", { class: "row" }, matrix("A", l.states, l.states, l.A), matrix("B", l.states, l.inputs, l.B)),
      poles(l.poles, this.before));
  }

  restyle() {
    this.stack.restyle();
  }
}

function matrix(name, rows, columns, values) {
  return h("table", { class: "matrix" }, h("caption", { class: "quiet" }, name, h("sub", {}, "k")),
    h("tr", {}, h("th", {}), columns.map((c) => h("th", { scope: "col" }, words(c)))),
    values.map((line, i) => h("tr", {}, h("th", { scope: "row" }, words(rows[i])), line.map((v) => h("td", {}, number(v, 4))))));
}
