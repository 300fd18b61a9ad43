// What to record next: limits, the plan with its command over time, and what each rival would show.

import * as api from "./api.js";
import { h, fill, number, unit, words } from "./dom.js";
import { legend } from "./plots.js";
import { plots } from "./stacks.js";

const COMMAND = [{ curves: ["command"], height: 120 }, { curves: ["low", "high", "true", "other"], height: 130 }, { curves: ["distance"], height: 90 }];
const RUNS = [["duration", "of one run", "s"], ["dt", "between two samples", "s"]];
const CALLED = { slew: "slew rate", dt: "sampling time", spare: "margin" };
const written = new Map(); // what was typed, by field; it stays until the page is left
let way = 0;

export function planning(block, state, go) {
  const texts = block.result.json.experiments ?? [];
  if (!block.form && !texts.length) return null;
  return h("details", { id: "plan", open: Boolean(block.form?.tie || block.plan) }, h("summary", {}, "What to record next"),
    texts.length > 0 && h("ul", {}, texts.map((n) => h("li", {}, n))),
    block.form && form(block, state, go),
    block.plan && plan(block.plan, state, go));
}

// -------------------------------------------------------------------- what is asked for

function form(block, state, go) {
  const { limits, rivals, tie, step, every } = block.form;
  const busy = Boolean(state.busy);
  const keep = (key) => (e) => written.set(key, e.target.value);
  const held = (key, value) => written.get(key) ?? value ?? "";
  const field = (name, doc, u, value, hint) => [
    h("label", { for: `limit-${name}` }, h("b", {}, CALLED[name] ?? words(name)), h("br"), h("span", { class: "quiet" }, doc)),
    h("input", { type: "text", inputmode: "decimal", id: `limit-${name}`, value: held(name, value), placeholder: hint, autocomplete: "off", oninput: keep(name), onkeydown: (e) => e.key === "Enter" && !busy && send() }),
    h("span", {}, u)];
  const pick = (k) => h("select", { id: `between-${k}`, "aria-label": k ? "the other rival" : "one rival", onchange: keep(`between-${k}`) },
    h("option", { value: "" }, k ? "..." : every), rivals.map((r) => h("option", { value: r, selected: r === held(`between-${k}`) }, words(r).replaceAll("+", " with "))));
  const send = () => {
    go("plan", { limits: Object.fromEntries(limits.map((l) => [l.name, held(l.name, l.value)])), between: [held("between-0"), held("between-1")].filter(Boolean),
      ...Object.fromEntries(RUNS.map(([name]) => [name, held(name)])), spare: held("spare", "20") });
  };
  const hints = { duration: "automatic", dt: step ? String(step) : "automatic" };
  return h("div", { class: "sheet" },
    h("p", { class: "quiet" }, "A command is planned that tells apart what this diagnosis leaves open, within what your machine may do. Filled in is what the records visited; an empty field: no limit, or as it suits the records."),
    h("div", { class: "fields limits" }, limits.map((l) => field(l.name, l.doc, l.unit, l.value, "none")), RUNS.map(([name, doc, u]) => field(name, doc, u, "", hints[name])), field("spare", "part of each limit kept free", "%", "20", "20")),
    h("div", { class: "row" }, h("span", {}, "Between"), pick(0), h("span", {}, "and"), pick(1)),
    h("div", { class: "row" }, h("button", { id: "do-plan", class: tie && !block.plan ? "primary" : "", disabled: busy, onclick: send }, block.plan ? "Plan again" : "Plan what to record next")));
}

// -------------------------------------------------------------------- the plan

const VERDICTS = { enough: "✓ enough", little: "≈ less than is asked for", none: "✕ none tells" };
const TITLES = [["csv", "Command (CSV)"], ["rivals.json", "Rivals (JSON)"], ["trajectory.yaml", "Trajectory (YAML)"]];
const title = (file) => (TITLES.find(([end]) => file.endsWith(end)) ?? ["", file])[1];

function plan(found, state, go) {
  const { json, previews, files, command } = found;
  const none = json.verdict === "none";
  return h("div", { id: "planned" },
    h("h3", {}, `The next record: ${VERDICTS[json.verdict] ?? json.verdict}`),
    h("p", { id: "plan-says" }, json.sentence),
    h("p", {}, `${json.command.words}. ${none ? "A record of it decides nothing." : `Record it twice, ${number(json.command.duration, 4)} s each, a sample every ${number(json.command.dt, 4)} s, at rest at both ends; drop both records here, and press Diagnose: it judges these rivals.`}`),
    h("div", { class: "row", id: "plan-files" }, files.map((f) => h("a", { class: "button", id: `take-${f.slice(f.indexOf(".") + 1)}`, href: api.exported(f), download: f }, title(f))),
      h("button", { class: "small", id: "unplan", disabled: Boolean(state.busy), onclick: () => go("unplan") }, "Leave the plan out")),
    pictures(found),
    h("h4", {}, "How sure it would be"), pairs(json),
    Object.keys(json.smallest).length > 0 && h("p", {}, "The smallest that would show: ", Object.entries(json.smallest).map(([r, t]) => `${words(r)}: ${t}`).join("; "), "."),
    json.remedies.length > 0 && [h("h4", {}, "What else would tell"), table(["rivals", "remedy", "distance"], json.remedies.map((r) => [r.rivals.join(" / "), r.what, number(r.distance)]), "remedies")],
    h("details", { id: "plan-limits" }, h("summary", {}, "Limits, and how much of them it uses"), used(json)),
    h("details", { id: "plan-families" }, h("summary", {}, "The best command of each family"), families(json)),
    json.notes.length > 0 && h("details", { id: "plan-notes" }, h("summary", {}, json.notes.length === 1 ? "1 note" : `${json.notes.length} notes`), h("ul", {}, json.notes.map((n) => h("li", {}, n)))),
    h("details", { id: "plan-command" }, h("summary", {}, "The same on the command line"), h("p", { class: "quiet" }, "DIAGNOSIS.json is what the command of this stage prints with --json."), h("pre", { tabindex: 0 }, command)));
}

function pictures({ json, previews, key }) {
  way = Math.min(way, Math.max(previews.length - 1, 0));
  const holder = h("div", {});
  const draw = () => {
    const [true_, other] = previews[way]?.rivals ?? [];
    const labels = { true: true_, other: `${other}, refitted` };
    const ask = (span) => api.show("plan", { ...span, way });
    fill(holder, previews.length ? legend([["true", `where it is ${true_}, ± 2 noise`], ["other", `${other}, refitted, imitates it as well as it can`]]) : null, plots("plan", `${key} ${way}`, ask, COMMAND, labels));
  };
  draw();
  const choose = previews.length > 1 && h("div", { class: "row", role: "group", "aria-label": "Which rival is true" }, h("span", { class: "quiet" }, "What would be seen where it is"),
    previews.map((p, k) => h("button", { class: "small", id: `way-${k}`, "aria-pressed": k === way, onclick: (e) => { way = k; for (const b of e.target.parentNode.querySelectorAll("button")) b.setAttribute("aria-pressed", b === e.target); draw(); } }, p.rivals[0])));
  return [choose, holder, previews.length > 0 && h("p", { class: "quiet" }, "Distance: -2 log likelihood of this record for the other one, up to that time; where it rises, the command decides. What its refitted values lose on the records at hand comes on top, below.")];
}

function table(head, rows, id, numbers = [head.length - 1]) {
  const cells = (tag, row) => row.map((t, k) => h(tag, { class: numbers.includes(k) ? "number" : "", ...(tag === "th" ? { scope: "col" } : {}) }, t));
  return h("table", { id }, h("thead", {}, h("tr", {}, cells("th", head))), h("tbody", {}, rows.map((r) => h("tr", {}, cells("td", r)))));
}

const said = (one) => (one.alike ? "not told apart" : one.nested ? "nearly the same" : "");

function pairs(json) {
  const rows = json.pairs.map((p) => [p.rivals.join(" / "), number(p.expected), number(p.certainty), number(p.so_far), said(p)]);
  return [table(["rivals", "expected", "standard errors", "so far", ""], rows, "plan-pairs", [1, 2, 3]),
    h("p", { class: "quiet" }, "Expected: -2 log likelihood by which the wrong rival, refitted, loses; 10 is needed, 60 is asked of a plan. Standard errors: by which the right one predicts a second run better. So far: what the records at hand say.")];
}

function used(json) {
  const visits = { [json.command.input]: { most: json.command.peak, unit: json.command.unit }, ...json.visits };
  const rows = Object.entries(json.limits).filter(([n]) => visits[n]).map(([n, l]) => [words(n), `${number(visits[n].most)}`, `${number(l.most)}`, `${number((100 * visits[n].most) / l.most, 2)} %`, unit(visits[n].unit).replace(/[[\] ]/g, ""), l.assumed ? "as the records visited" : ""]);
  return table(["quantity", "most, by any rival", "limit", "part", "", ""], rows, "plan-used", [1, 2, 3]);
}

function families(json) {
  const rows = json.families.map((f) => [f.family, f.words, number(f.peak), number(f.distance), `${number(100 * f.part_of_limits, 2)} %`]);
  return table(["family", "command", `peak [${json.command.unit}]`, "distance", "of the limits"], rows, "families", [2, 3, 4]);
}
