// What each stage looks like. A renderer gets the stage's block, the whole state and `go(action, args)`.

import * as api from "./api.js";
import { h, fill, number, unit, words } from "./dom.js";
import { Stack, legend } from "./plots.js";
import { evidence, ladder } from "./svg.js";
import { Tuner } from "./tune.js";

const stacks = new Map();
const RAW = [{ curves: ["recorded"], height: 120 }];
const PAIR = [{ curves: ["measured", "simulated"], height: 180 }, { curves: ["residual"], height: 110 }];

export function restyle() {
  for (const { stack } of stacks.values()) stack.restyle();
}

// The plots of a place, kept as long as they show the same thing.
function plots(place, key, ask, rows) {
  const held = stacks.get(place);
  if (held?.key === key) return held.stack.element;
  held?.stack.clear();
  const stack = new Stack(h("div", { id: `plots-${place}` }), ask, rows);
  stacks.set(place, { key, stack });
  requestAnimationFrame(() => stack.load([null, null]).catch((e) => fill(stack.element, h("p", { class: "error" }, e.message))));
  return stack.element;
}

const stackOf = (place) => stacks.get(place)?.stack;

export function command(text) {
  if (!text) return null;
  const copy = async (e) => {
    await navigator.clipboard?.writeText(text);
    e.target.textContent = "Copied";
  };
  return h("div", { class: "command" }, h("code", { tabindex: 0, "aria-label": "The same on the command line" }, text),
    h("button", { class: "small", onclick: copy }, "Copy"));
}

// -------------------------------------------------------------------- record

let picked = 0;

function record(block, state, go) {
  const chooser = h("input", { type: "file", id: "files", multiple: true, class: "hidden", tabindex: -1, "aria-label": "Records and model files", onchange: (e) => go("files", [...e.target.files]) });
  const drop = h("div", { class: "drop" },
    h("p", {}, h("b", {}, "Drop records here"), ", or a model file. One record to fit to, another one that no fit sees."),
    h("p", { class: "quiet" }, "CSV, MAT, mcap, db3; up to 512 MiB a file. They stay on this machine."),
    h("div", { class: "row center" }, chooser, h("button", { id: "choose", onclick: () => chooser.click() }, "Choose files"),
      h("button", { id: "sample", onclick: () => go("sample") }, "Try the sample")));
  const small = state.records.length > 0;
  return [
    small ? h("details", { id: "more-records" }, h("summary", {}, "Add records, or another model"), drop) : drop,
    models(state, go),
    small && records(state, go),
    small && state.records.some((r) => r.found) && recorded(state),
    state.mapping.length > 0 && mapping(state, go),
  ];
}

function models(state, go) {
  const select = h("select", { id: "model", onchange: (e) => e.target.value && go("model", { name: e.target.value }) },
    h("option", { value: "" }, state.model ? `${state.model_name} (${words(state.model.plant)})` : "choose one ..."),
    state.shipped.map((m) => h("option", { value: m.name }, `${m.name}: ${m.summary}`)));
  const effects = state.model?.effects.length ? ` with ${state.model.effects.map(words).join(", ")}` : "";
  return h("div", { class: "row" }, h("label", { for: "model" }, "Model"), select,
    state.model && h("span", { class: "quiet" }, `${words(state.model.plant)}${effects}`));
}

function records(state, go) {
  const row = (r) => h("tr", {},
    h("td", { class: "name" }, r.name),
    h("td", {}, h("button", { class: "small", id: `role-${r.file}`, onclick: () => go("role", { file: r.file }) },
      r.role === "estimation" ? "for the fit" : "unseen by the fit")),
    h("td", { class: "number" }, r.found ? r.found.samples.toLocaleString("en") : "reading ..."),
    h("td", { class: "number" }, r.found ? `${number(r.found.end - r.found.start, 4)} s` : ""),
    h("td", { class: "number" }, r.found ? `${number(1 / r.found.step, 4)} Hz` : ""),
    h("td", {}, r.found?.notes.join("; ")),
    h("td", {}, h("button", { class: "small", id: `drop-${r.file}`, "aria-label": `Take out ${r.name}`, onclick: () => go("drop", { file: r.file }) }, "Take out")));
  return h("table", {}, h("thead", {}, h("tr", {}, ["record", "used", "samples", "length", "rate", "noted", ""].map((t, i) => h("th", { class: i > 1 && i < 5 ? "number" : "", scope: "col" }, t)))),
    h("tbody", {}, state.records.map(row)));
}

function recorded(state) {
  picked = Math.min(picked, state.records.length - 1);
  const r = state.records[picked];
  const choose = state.records.length > 1 && h("div", { class: "row", role: "group", "aria-label": "Which record is shown" },
    state.records.map((one, k) => h("button", { class: "small", "aria-pressed": k === picked, id: `see-${k}`, onclick: (e) => { picked = k; show(e.target); } }, one.name)));
  const units = Object.fromEntries(state.mapping.filter((m) => m.column).map((m) => [m.column, m.unit]));
  const ask = async (span) => {
    const found = await api.show("record", { ...span, record: picked });
    for (const p of found.plots) p.unit ||= units[p.name] ?? "unit?";
    return found;
  };
  const draw = () => plots("record", `${state.records[picked].path} ${picked} ${JSON.stringify(units)}`, ask, RAW);
  const holder = h("div", {}, r.found ? draw() : null);
  const show = (button) => {
    fill(holder, draw());
    for (const b of button.parentNode.children) b.setAttribute("aria-pressed", b === button);
  };
  return h("details", { open: true, id: "recorded" }, h("summary", {}, "What was recorded"), choose, holder);
}

function mapping(state, go) {
  const columns = [...new Set(state.records.flatMap((r) => r.found?.columns.map((c) => c.label) ?? []))];
  const unitOf = (label) => state.records.flatMap((r) => r.found?.columns ?? []).find((c) => c.label === label)?.unit ?? "";
  const row = (m) => {
    const parts = taken(m.column, columns);
    const send = (change) => go("map_signal", { signal: m.signal, column: parts.column, unit: parts.unit, factor: parts.factor, ...change });
    return h("tr", {},
      h("td", {}, h("b", {}, words(m.signal)), unit(m.unit)),
      h("td", {}, { input: "drives the machine", state: "measured state", output: "measured output" }[m.kind]),
      h("td", {}, h("select", { id: `map-${m.signal}`, "aria-label": `Column for ${words(m.signal)}`, onchange: (e) => send({ column: e.target.value, unit: "" }) },
        h("option", { value: "", selected: !m.column }, m.needed ? "choose a column ..." : "not measured"),
        [...new Set([...columns, ...(parts.column ? [parts.column] : [])])].map((c) => h("option", { value: c, selected: c === parts.column }, c)))),
      h("td", {}, h("select", { id: `unit-${m.signal}`, "aria-label": `Unit of the column for ${words(m.signal)}`, onchange: (e) => send({ unit: e.target.value }) },
        units(m.unit, parts.unit || unitOf(parts.column)).map((u) => h("option", { value: u, selected: u === (parts.unit || unitOf(parts.column)) }, u || "as the model")))),
      h("td", {}, h("select", { id: `factor-${m.signal}`, "aria-label": `Factor for ${words(m.signal)}`, onchange: (e) => send({ factor: Number(e.target.value) }) },
        [...new Set([1, 0.001, 0.01, 0.1, 10, 100, 1000, Math.abs(parts.factor)])].sort((a, b) => a - b).map((f) => h("option", { value: f * Math.sign(parts.factor), selected: f === Math.abs(parts.factor) }, `× ${number(f, 6)}`)))),
      h("td", {}, h("button", { class: "small", id: `sign-${m.signal}`, disabled: !m.column, "aria-pressed": parts.factor < 0, onclick: () => send({ factor: -parts.factor }) }, parts.factor < 0 ? "sign reversed" : "reverse sign")),
      h("td", { class: "quiet" }, m.why));
  };
  const driven = state.mapping.every((m) => !m.needed || m.column), seen = state.mapping.some((m) => m.kind !== "input" && m.column);
  const open = !driven || !seen || state.mapping.some((m) => m.proposed);
  return h("details", { open, id: "mapping" }, h("summary", {}, "Columns and signals"),
    h("table", {}, h("thead", {}, h("tr", {}, ["signal", "", "column", "its unit", "factor", "sign", "why"].map((t) => h("th", { scope: "col" }, t)))), h("tbody", {}, state.mapping.map(row))));
}

// Take "-0.1 * column [unit]" apart.
function taken(specification, columns) {
  const product = /^\s*([-+]?[0-9.]+(?:e[-+]?\d+)?)\s*\*\s*(.*)$/i.exec(specification ?? "");
  const factor = product ? Number(product[1]) : 1;
  const rest = product ? product[2] : specification ?? "";
  const stated = /^(.*\S)\s*\[([^\]]*)\]$/.exec(rest);
  const bare = stated && columns.find((c) => c.split(" [")[0] === stated[1]);
  return bare && !columns.includes(rest) ? { factor, column: bare, unit: stated[2] } : { factor, column: rest, unit: "" };
}

const FAMILIES = [
  ["rad", "deg", "rev", "mm", "m"], ["rad/s", "deg/s", "rpm", "m/s", "mm/s"], ["A", "mA"], ["V", "mV"], ["N", "kN", "N·m", "mN·m"],
];

function units(wanted, now) {
  const family = FAMILIES.filter((f) => wanted.split(" or ").some((u) => f.includes(u))).flat();
  return [...new Set(["", ...family, now])];
}

// -------------------------------------------------------------------- check

const MARKS = { note: "ℹ noted", offer: "△ on offer", refuse: "✕ in the way" };

function check(block, state, go) {
  const chosen = block.cures ?? [];
  const button = (f, k) => {
    if (!f.cure || (f.applied && !chosen.includes(f.cure))) return null;
    const urgent = f.severity === "refuse" && !f.applied;
    return h("button", { id: `cure-${k}`, class: urgent ? "small primary" : "small", onclick: () => go("cure", { name: f.cure }) },
      chosen.includes(f.cure) ? `take back: ${words(f.cure)}` : words(f.cure));
  };
  const file = (f) => f.record?.split("/").at(-1) ?? "";
  const rows = (block.findings ?? []).map((f, k) => h("tr", {},
    h("td", { class: "status" }, f.applied ? "✓ cured" : MARKS[f.severity] ?? f.severity), h("td", { class: "name" }, file(f)),
    h("td", {}, words(f.channel ?? "")), h("td", {}, f.sentence), h("td", {}, button(f, k))));
  const open = (block.findings ?? []).some((f) => f.severity === "refuse" && !f.applied);
  const asTheyAre = chosen.includes("none");
  return [
    rows.length > 0 && h("table", {}, h("thead", {}, h("tr", {}, ["", "record", "channel", "finding", "cure"].map((t) => h("th", { scope: "col" }, t)))), h("tbody", {}, rows)),
    (open || asTheyAre) && h("div", { class: "row" }, h("button", { id: "as-they-are", onclick: () => go("cure", { name: "none" }) },
      asTheyAre ? "Cure the records after all" : "Take the records as they are")),
  ];
}

// -------------------------------------------------------------------- compare

let shownStretch = 0;
let how = "windowed";

function compare(block, state, go) {
  if (!block.result) return [];
  const { json, errors: rows, stretches, regions, channels } = block.result;
  shownStretch = Math.min(shownStretch, stretches.length - 1);
  const draw = () => plots("compare", `${block.key} ${shownStretch} ${how}`, (span) => api.show("compare", { ...span, stretch: shownStretch, how }), PAIR);
  const holder = h("div", {}, draw());
  const again = () => fill(holder, draw());
  const pick = (k) => {
    const own = regions[k].filter(([s]) => s === shownStretch);
    if (!own.length && regions[k].length) shownStretch = regions[k][0][0], again();
    const spans = regions[k].filter(([s]) => s === shownStretch).map(([, a, b]) => [a, b]);
    const stack = stackOf("compare");
    stack.setShaded(spans);
    const [a, b] = spans[0] ?? [null, null];
    if (a !== null && a !== undefined) stack.load(stack.whole ? stack.within(a - 1.5 * Math.max(b - a, 0.05), b + 1.5 * Math.max(b - a, 0.05)) : [a, b]);
  };
  const where = json.where.map((r, k) => h("li", {}, h("button", { id: `region-${k}`, onclick: (e) => { for (const x of e.target.closest("ul").querySelectorAll("button")) x.setAttribute("aria-pressed", x === e.target); pick(k); } },
    `${r.region}: ${r.share_of_error_percent.toFixed(0)} % of the error in ${r.share_of_time_percent.toFixed(0)} % of the time`)));
  const modes = h("div", { class: "row", role: "group", "aria-label": "How it is simulated" },
    [["windowed", `next ${number(json.horizon)} s, again and again`], ["free", "free run from the start"]].map(([name, label]) =>
      h("button", { class: "small", id: `how-${name}`, "aria-pressed": how === name, onclick: (e) => { how = name; for (const x of e.target.parentNode.children) x.setAttribute("aria-pressed", x === e.target); again(); } }, label)),
    h("button", { class: "small", id: "whole", onclick: () => { stackOf("compare").setShaded([]); stackOf("compare").load([null, null]); } }, "Show all"),
    stretches.length > 1 && h("select", { id: "stretch", "aria-label": "Stretch shown", onchange: (e) => { shownStretch = Number(e.target.value); again(); } },
      stretches.map((s, k) => h("option", { value: k, selected: k === shownStretch }, `${s.source.split("/").at(-1)}, ${number(s.span[0], 4)} to ${number(s.span[1], 4)} s`))));
  return [
    h("p", { class: "quiet" }, "Drag to zoom, double-click to see all; with the keyboard: plus, minus, arrows, 0."),
    modes, legend(["measured", "simulated", "residual"]), holder,
    where.length ? [h("h3", {}, "Where it fails"), h("ul", { class: "regions" }, where)] : null,
    h("details", { id: "scores" }, h("summary", {}, "Scores"), errors(rows), scores(json, channels)),
    json.notes.length > 0 && h("details", {}, h("summary", {}, json.notes.length === 1 ? "1 note" : `${json.notes.length} notes`), h("ul", {}, json.notes.map((n) => h("li", {}, n)))),
  ];
}

// The rows by which models are told apart, as the command line prints them; the first row is the head.
function errors(rows) {
  if (!rows?.length) return null;
  const cells = (tag, row) => row.map((t, k) => h(tag, { class: k > 1 ? "number" : "", ...(tag === "th" ? { scope: "col" } : {}) }, t));
  return h("table", { class: "errors" }, h("thead", {}, h("tr", {}, cells("th", rows[0]))), h("tbody", {}, rows.slice(1).map((r) => h("tr", {}, cells("td", r)))));
}

export function scores(json, channels) {
  const cells = (s) => [s?.rmse, s?.fit_percent, s?.rmse_over_noise].map((v, k) => h("td", { class: "number" }, k === 1 && v !== null && v !== undefined ? `${v.toFixed(1)} %` : number(v)));
  return h("table", { class: "scores" }, h("thead", {}, h("tr", {}, ["channel", "noise", "free run, RMS", "fit", "/ noise", `next ${number(json.horizon)} s, RMS`, "fit", "/ noise"].map((t, k) => h("th", { class: k ? "number" : "", scope: "col" }, t)))),
    h("tbody", {}, Object.entries(json.channels).map(([name, c]) => h("tr", { "data-channel": name, "data-windowed": c.windowed?.rmse, "data-free": c.free_run?.rmse },
      h("td", {}, words(name), unit(channels[name])), h("td", { class: "number" }, number(c.noise)), cells(c.free_run), cells(c.windowed)))));
}

// -------------------------------------------------------------------- diagnose

function diagnose(block, state, go) {
  const busy = state.busy?.stage === "diagnose" ? state.busy.found : null;
  if (busy?.tried?.length) return [h("h3", {}, `Tried so far: ${busy.count}, best first`), tried(busy.tried)];
  if (!block.result) return [];
  const { json, errors: rows, evidence: seen } = block.result;
  const pictures = Object.entries(seen).map(([name, e]) => [
    h("h3", {}, `${words(name)}: what unseen data show`),
    h("div", { class: "pair" }, evidence(e, "named", "curve"), e.rival && evidence(e, "rival", "rival")),
  ]);
  return [
    pictures,
    rows?.length > 0 && h("details", { id: "errors" }, h("summary", {}, "The error, step by step"), errors(rows)),
    h("details", { id: "ranking" }, h("summary", {}, "All effects that competed, best first"), ranking(json.ranking)),
    json.experiments?.length > 0 && h("details", {}, h("summary", {}, "What to record to find out more"), h("ul", {}, json.experiments.map((n) => h("li", {}, n)))),
    json.notes?.length > 0 && h("details", {}, h("summary", {}, json.notes.length === 1 ? "1 note" : `${json.notes.length} notes`), h("ul", {}, json.notes.map((n) => h("li", {}, n)))),
  ];
}

// What was tried while a diagnosis runs.
function tried(rows) {
  const head = ["model with", "error of the motion / noise", "force left, % of the effort"];
  return h("table", { id: "tried" }, h("thead", {}, h("tr", {}, head.map((t, k) => h("th", { class: k ? "number" : "", scope: "col" }, t)))),
    h("tbody", {}, rows.map((r) => h("tr", {}, h("td", {}, r.effects.map(words).join(" + ") || "nothing added"),
      h("td", { class: "number" }, number(r.error)), h("td", { class: "number" }, number(r.force))))));
}

const STATUS = { confirmed: "✓ confirmed", ambiguous: "≈ a tie", not_excited: "… not to be seen here", rejected: "✕ rejected", not_applicable: "– does not apply" };

function ranking(entries) {
  const worst = (v) => v && Math.max(...Object.entries(v).filter(([k]) => k !== "score").map(([, s]) => s?.rmse_over_noise ?? 0));
  return h("table", {}, h("thead", {}, h("tr", {}, ["effect", "", "error / noise", "why", "fitted"].map((t, k) => h("th", { class: k === 2 ? "number" : "", scope: "col" }, t)))),
    h("tbody", {}, entries.map((e) => h("tr", {}, h("td", {}, words(e.effect)), h("td", { class: "status" }, STATUS[e.status] ?? e.status ?? ""),
      h("td", { class: "number" }, number(worst(e.validation))), h("td", {}, e.why ?? ""),
      h("td", {}, Object.entries(e.parameters ?? {}).map(([n, p]) => `${n} = ${number(p.value, 4)}${p.std ? ` ± ${number(p.std, 2)}` : ""} ${p.unit === "-" ? "" : p.unit}`).join(", "))))));
}

// -------------------------------------------------------------------- add

let tuner = null;

function add(block, state, go) {
  if (block.why) return [];
  const busy = Boolean(state.busy);
  const buttons = (block.offers ?? []).map((e, k) => h("button", { id: k ? `add-${e}` : "do-add", class: k ? "" : "primary", disabled: busy, onclick: () => go("add", { effect: e }) }, `Add ${words(e)}`));
  const other = block.others?.length > 0 && h("select", { id: "add-other", "aria-label": "Add another effect", disabled: busy, onchange: (e) => e.target.value && go("add", { effect: e.target.value }) },
    h("option", { value: "" }, "add another one ..."), block.others.map((e) => h("option", { value: e }, words(e))));
  const channels = block.ladder?.length ? Object.keys(block.ladder[0].validation).filter((c) => c !== "score") : [];
  const forces = (block.ladder ?? []).map((r) => ({ label: r.label, validation: { force: r.force } }));
  if (!tuner || tuner.model !== state.model?.name) tuner = state.model ? new Tuner(state, block.std ?? {}, (values) => go("keep", { values })) : null;
  return [
    h("div", { class: "row" }, buttons, other, !buttons.length && block.others?.length > 0 && h("span", { class: "quiet" }, "Nothing that was named is left to add.")),
    block.ladder?.length > 0 && h("div", { class: "pair", id: "ladder" }, channels.map((c) => ladder(block.ladder, c, state.model?.signals[c] ?? "")),
      forces.some((r) => r.validation.force) && ladder(forces, "force", "% of the effort", "missing on unseen data")),
    tuner && h("details", { id: "tuner", ontoggle: (e) => e.target.open && tuner.start() }, h("summary", {}, "Parameters by hand: drag, and see curve, A", h("sub", {}, "k"), " and poles move"), tuner.element),
  ];
}

export const restyleTuner = () => tuner?.restyle();

// -------------------------------------------------------------------- use

const FILES = { "model.yaml": "Model (YAML)", "report.html": "Report (HTML)", "replay.sh": "Script of all commands" };

function use(block, state, go) {
  if (block.why) return [];
  return [
    block.files?.length > 0 && h("div", { class: "row", id: "exported" }, block.files.map((f) => h("a", { class: "button", href: api.exported(f), target: f.endsWith(".html") ? "_blank" : null, download: f.endsWith(".html") ? null : "" }, FILES[f]))),
    state.model && h("details", {}, h("summary", {}, "The model file"), h("pre", { tabindex: 0 }, state.model.yaml)),
    block.script && h("details", { id: "script" }, h("summary", {}, "What was done, as a script"), h("pre", { tabindex: 0 }, block.script)),
  ];
}

export const RENDER = { record, check, compare, diagnose, add, use };
