// What each stage looks like. A renderer gets the stage's block, the whole state and `go(action, args)`.

import * as api from "./api.js";
import { h, fill, number, unit, words } from "./dom.js";
import { planning } from "./planning.js";
import { legend } from "./plots.js";
import { plots, stackOf } from "./stacks.js";
import { evidence, ladder, scatter, spectrum } from "./svg.js";
import { Tuner } from "./tune.js";

const RAW = [{ curves: ["recorded"], height: 120 }];
const ALSO = ["also0", "also1", "also2"];
const PAIR = [{ curves: ["measured", "simulated", ...ALSO], height: 180 }, { curves: ["residual"], height: 110 }, { curves: ["recorded"], height: 80 }];

export function command(text) {
  if (!text) return null;
  const copy = async (e) => {
    await navigator.clipboard?.writeText(text);
    e.target.textContent = "Copied";
  };
  return h("div", { class: "command" }, h("code", { tabindex: 0, "aria-label": "The same on the command line" }, text.split(" ").map((w, k) => [k ? " " : "", h("span", {}, w)])),
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
  const clock = state.mapping.find((t) => t.clock.asked && !t.time);
  const reads = clock && [...new Set([clock.clock.asked, `${clock.clock.asked.split(" [")[0]} [s]`])];
  return [
    state.code.length > 0 && strange(state.code, go),
    clock && h("div", { class: "row", id: "time-asked" }, reads.map((spec, k) => h("button", { id: k ? "read-as-s" : "read-as", class: k ? "" : "primary", disabled: Boolean(state.busy), onclick: () => go("map_signal", { file: clock.files[0], signal: "t", formula: spec }) }, `Read ${spec.split(" [")[0]} as ${/\[(\w+)\]/.exec(spec)?.[1]}`))),
    small ? h("details", { id: "more-records" }, h("summary", {}, "Add records, or another model"), drop) : drop,
    models(state, go),
    small && records(state, go),
    small && !state.busy && state.records.some((r) => !r.found) && h("div", { class: "row" }, h("button", { id: "read-again", onclick: () => go("check") }, "Read again")),
    small && state.records.some((r) => r.found && (r.found.untimed || !r.found.error)) && recorded(state),
    state.mapping.length > 0 && mapping(state, block.lacking, go),
  ];
}

// Code that a model names: shown whole, and run only when that is asked for.
function strange(files, go) {
  return h("div", { class: "error", id: "strange" },
    h("p", {}, h("b", {}, "The model runs code. "), "Read it; run it only if you know whose it is. It is not asked again on this machine until the file changes."),
    files.map((one) => [h("p", { class: "quiet" }, one.file), h("pre", { tabindex: 0 }, one.text)]),
    h("button", { id: "trust", onclick: () => go("trust", { digests: files.map((one) => one.digest) }) }, files.length > 1 ? "Run these files" : "Run this file"));
}

function models(state, go) {
  const select = h("select", { id: "model", onchange: (e) => e.target.value && go("model", { name: e.target.value }) },
    h("option", { value: "" }, state.model ? state.model_name : "choose one ..."),
    state.shipped.map((m) => h("option", { value: m.name }, `${m.name}: ${m.summary}`)));
  const effects = state.model?.effects.length ? ` with ${state.model.effects.map(words).join(", ")}` : "";
  return h("div", { class: "row" }, h("label", { for: "model" }, "Model"), select,
    state.model && h("span", { class: "quiet" }, `${words(state.model.plant)}${effects}`),
    h("details", { id: "sheet" }, h("summary", {}, "No model file? From a data sheet"), sheets(state, go)));
}

// Numbers of a data sheet, of which a model file is made; what is typed stays until it is taken.
const typed = new Map();
let form = "motor";

function sheets(state, go) {
  if (!state.forms?.length) return null;
  const holder = h("div", { class: "sheet" });
  const keep = (key) => (e) => typed.set(key, e.target.value);
  const held = (key, value) => (typed.has(key) ? typed.get(key) : value);
  const draw = () => {
    const own = state.forms.find((f) => f.id === form) ?? state.forms[0];
    const take = () => document.getElementById("sheet").removeAttribute("open") ?? go("write", { form: own.id, values: Object.fromEntries(own.fields.map((f) => [f.name, [held(`${own.id} ${f.name}`, f.start), held(`${own.id} ${f.name} unit`, f.units[0])]])) });
    fill(holder,
      h("div", { class: "row" }, h("label", { for: "form" }, "What it is"), h("select", { id: "form", onchange: (e) => { form = e.target.value; draw(); } }, state.forms.map((f) => h("option", { value: f.id, selected: f.id === own.id }, f.title)))),
      h("div", { class: "fields" }, own.fields.map((f) => [
        h("label", { for: `form-${f.name}` }, h("b", {}, f.name), h("br"), h("span", { class: "quiet" }, f.doc)),
        h("input", { type: "text", inputmode: "decimal", id: `form-${f.name}`, value: held(`${own.id} ${f.name}`, f.start), title: f.least, autocomplete: "off", oninput: keep(`${own.id} ${f.name}`), onkeydown: (e) => e.key === "Enter" && !state.busy && take() }),
        h("select", { id: `form-unit-${f.name}`, "aria-label": `Unit of ${f.name}`, onchange: keep(`${own.id} ${f.name} unit`) }, f.units.map((u) => h("option", { value: u, selected: u === held(`${own.id} ${f.name} unit`, f.units[0]) }, u)))])),
      h("div", { class: "row" }, h("button", { id: "write", disabled: Boolean(state.busy), onclick: take }, "Make the model file"),
        h("span", { class: "quiet" }, "Roughly right is enough: 20 % off is allowed for, and Compare fits them anew.")));
  };
  draw();
  return holder;
}

function records(state, go) {
  const only = state.records.length === 1;
  const role = (r) => h("select", { id: `role-${r.file}`, "aria-label": `What ${r.name} is for`, disabled: only,
    onchange: () => go("role", { file: r.file }) },
    [["estimation", "for the fit"], ["validation", "unseen by the fit"]].map(([value, text]) => h("option", { value, selected: r.role === value }, text)));
  const conditions = Object.entries(state.model?.conditions ?? {}); // what belongs to a record, not to the model
  const known = (r) => conditions.map(([name, value]) => h("label", { class: "condition" }, `${name} `,
    field(`known-${name}-${r.file}`, `${name} of ${r.name}`, r.known?.[name] ?? "", number(value), (text) => go("known", { file: r.file, name, value: text }))));
  const row = (r) => h("tr", {},
    h("td", { class: "name", title: r.name }, r.name),
    h("td", {}, role(r), only && h("div", { class: "quiet" }, "but its last third")),
    h("td", { class: "number" }, !r.found ? (state.busy ? "reading ..." : "not read") : r.found.error && !r.found.untimed ? "cannot be read" : r.found.samples.toLocaleString("en")),
    h("td", { class: "number" }, r.found && !r.found.error ? `${number(r.found.end - r.found.start, 4)} s` : ""),
    h("td", { class: "number" }, r.found && !r.found.error ? `${number(1 / r.found.step, 4)} Hz` : ""),
    h("td", {}, r.found?.notes.join("; ")),
    conditions.length > 0 && h("td", {}, known(r)),
    h("td", {}, h("button", { class: "small", id: `drop-${r.file}`, "aria-label": `Take out ${r.name}`, onclick: () => go("drop", { file: r.file }) }, "Take out")));
  return h("table", {}, h("thead", {}, h("tr", {}, ["record", "used", "samples", "length", "rate", "noted", ...(conditions.length ? ["known of it, where the file does not say"] : []), ""].map((t, i) => h("th", { class: i > 1 && i < 5 ? "number" : "", scope: "col" }, t)))),
    h("tbody", {}, state.records.map(row)));
}

function recorded(state) {
  picked = Math.min(picked, state.records.length - 1);
  const r = state.records[picked];
  const choose = state.records.length > 1 && h("div", { class: "row", role: "group", "aria-label": "Which record is shown" },
    state.records.map((one, k) => h("button", { class: "small", "aria-pressed": k === picked, id: `see-${k}`, onclick: (e) => { picked = k; show(e.target); } }, one.name)));
  const table = state.mapping.find((one) => one.files.includes(r.file));
  const own = table?.rows ?? [];
  const units = Object.fromEntries(own.filter((m) => m.column).map((m) => [m.column, m.unit]));
  const few = !table || table.count <= FEW;
  const seen = () => (few ? [] : [...new Set([...(table.columns.filter((c) => own.some((m) => m.column?.includes(c.label.split(" [")[0]))).map((c) => c.label)), ...(picks.get(r.file) ?? [])])]);
  const ask = async (span) => {
    const found = await api.show("record", { ...span, record: picked, columns: seen() });
    for (const p of found.plots) p.unit ||= units[p.name] ?? "unit?";
    return found;
  };
  const draw = () => plots("record", `${state.records[picked].path} ${picked} ${JSON.stringify([units, seen(), r.found?.error])}`, ask, RAW);
  const holder = h("div", {}, r.found ? draw() : null);
  const show = (button) => {
    fill(holder, draw());
    for (const b of button.parentNode.children) b.setAttribute("aria-pressed", b === button);
  };
  return h("details", { open: true, id: "recorded" }, h("summary", {}, "What was recorded"), choose,
    r.found?.untimed && h("p", { class: "quiet" }, "Over the rows, as long as the time is not known."),
    !few && others(table, r, () => fill(holder, draw())), holder);
}

const FEW = 16; // columns that are all drawn
const picks = new Map(); // columns that are drawn beside the mapped ones, by record
const filters = new Map();

// The other columns of a wide record: looked for by words, a tree by the parts of their names, drawn when ticked.
function others(table, r, redraw) {
  const own = picks.get(r.file) ?? picks.set(r.file, new Set()).get(r.file);
  const list = h("div", { class: "tree", id: "tree" });
  const tick = (c) => h("label", {}, h("input", { type: "checkbox", id: `see-column-${c.label}`, ...(own.has(c.label) ? { checked: true } : {}), onchange: (e) => { e.target.checked ? own.add(c.label) : own.delete(c.label); redraw(); } }), ` ${c.label}: ${range(c)}`);
  const find = latestOnly(async (text) => {
    filters.set(r.file, text);
    const found = text.trim() ? await api.show("search", { record: picked, filter: text }) : { columns: table.columns.filter((c) => own.has(c.label)), count: table.count };
    const groups = Map.groupBy ? Map.groupBy(found.columns, (c) => branch(c.label)) : grouped(found.columns);
    fill(list, [...groups].map(([name, cs]) => (name ? h("details", { open: true }, h("summary", {}, name), cs.map(tick)) : cs.map(tick))),
      text.trim() && found.count > found.columns.length && h("p", { class: "quiet" }, `${found.count - found.columns.length} more: write more of the name.`));
  });
  const field = h("input", { type: "search", id: "find-column", placeholder: `one of ${table.count} columns`, value: filters.get(r.file) ?? "", "aria-label": "Find a column by parts of its name", oninput: (e) => find(e.target.value) });
  find(filters.get(r.file) ?? "");
  return h("div", {}, h("div", { class: "row" }, h("label", { for: "find-column" }, "Drawn are the mapped columns, and"), field), list);
}

const branch = (label) => (/[/.]/.test(label) ? label.split(" [")[0].replace(/[/.][^/.]*$/, "") : "");

function grouped(columns) {
  const found = new Map();
  for (const c of columns) found.set(branch(c.label), [...(found.get(branch(c.label)) ?? []), c]);
  return found;
}

// Only the answer to the last question is used.
function latestOnly(ask) {
  let turn = 0;
  return async (text) => {
    const mine = ++turn;
    await new Promise((go) => setTimeout(go, 120));
    if (mine === turn) await ask(text).catch(() => null);
  };
}

// A table for each group of records that have the same columns; ids of all but the first end in its number.
function mapping(state, lacking, go) {
  const guessed = state.mapping.some((table) => table.rows.some((m) => m.proposed));
  return h("details", { open: lacking || guessed, id: "mapping" }, h("summary", {}, "Columns and signals"),
    state.mapping.map((table, k) => signals(table, k ? `-${k}` : "", state.mapping.length > 1, go)));
}

function signals(table, end, several, go) {
  const file = table.files[0];
  const map = (signal, change) => go("map_signal", { file, signal, ...change });
  const apart = table.alike > 1 && h("button", { class: "small", id: `apart${end}`, onclick: () => go("apart", { file }) }, table.apart ? "Map them all like this one" : "Map them one by one");
  return [
    (several || table.alike > 1) && h("div", { class: "row" }, h("b", {}, table.names.join(", ")), apart),
    h("table", { class: "mapping" }, h("thead", {}, h("tr", {}, ["signal", "column", "its unit", "factor", "sign", "or a formula"].map((t) => h("th", { scope: "col" }, t)))),
      h("tbody", {}, table.rows.map((m) => signal(m, table, end, map)), time(table, end, map))),
    table.texts.length > 0 && h("p", { class: "quiet" }, `Columns of text, which a formula may take the sign of: ${table.texts.join(", ")}.`),
  ];
}

const KINDS = { input: "drives the machine", state: "measured state", output: "measured output" };

function signal(m, table, end, map) {
  const columns = table.columns.map((c) => c.label);
  const parts = taken(m.column, columns);
  const formula = Boolean(parts.column) && !columns.includes(parts.column);
  const own = table.columns.find((c) => c.label === parts.column)?.unit ?? "";
  const now = parts.unit || own;
  const send = (change) => map(m.signal, { column: parts.column, unit: parts.unit, factor: parts.factor, ...change });
  const name = words(m.signal);
  return h("tr", {},
    h("td", {}, h("b", {}, name), unit(m.unit), h("br"), h("span", { class: "quiet" }, KINDS[m.kind])),
    h("td", {}, h("select", { id: `map-${m.signal}${end}`, "aria-label": `Column for ${name}`, onchange: (e) => send({ column: e.target.value, unit: "" }) },
      h("option", { value: "", selected: !m.column }, m.needed ? "choose a column ..." : "not measured"),
      formula && h("option", { value: parts.column, selected: true }, "by the formula"),
      table.columns.map((c) => h("option", { value: c.label, selected: c.label === parts.column }, `${c.label}: ${range(c)}`))),
      h("div", { class: "quiet why" }, m.why),
      (m.direction || m.full) && driven(m, end, map)),
    h("td", {}, h("select", { id: `unit-${m.signal}${end}`, disabled: !m.column || formula, "aria-label": `Unit of the column for ${name}`, onchange: (e) => send({ unit: e.target.value }) },
      !own && h("option", { value: "", selected: !now }, "as the model"),
      [...new Set([...(own || parts.unit ? [now] : []), ...m.units])].map((u) => h("option", { value: u, selected: u === now }, u)))),
    h("td", {}, h("select", { id: `factor-${m.signal}${end}`, disabled: !m.column || formula, "aria-label": `Factor for ${name}`, onchange: (e) => send({ factor: Number(e.target.value) }) },
      [...new Set([1, 0.001, 0.01, 0.1, 10, 100, 1000, Math.abs(parts.factor)])].sort((a, b) => a - b).map((f) => h("option", { value: f * Math.sign(parts.factor), selected: f === Math.abs(parts.factor) }, `× ${number(f, 6)}`)))),
    h("td", {}, h("button", { class: "small", id: `sign-${m.signal}${end}`, disabled: !m.column || formula, "aria-pressed": parts.factor < 0, onclick: () => send({ factor: -parts.factor }) }, parts.factor < 0 ? "sign reversed" : "reverse sign")),
    h("td", {}, field(`formula-${m.signal}${end}`, `Formula of columns for ${name}`, formula ? m.column : "", m.kind === "input" ? "sign(dir) * pwm" : "0.0105 * c2 - 1", (text) => map(m.signal, { formula: text }))));
}

// A PWM in counts, or without its sign: what it is at full scale, and where the sign stands.
function driven(m, end, map) {
  const plain = (label) => (/^[^\W\d]\w*$/.test(label) ? label : `"${label.split(" [")[0]}"`);
  const signed = m.direction ? `sign(${plain(m.direction)}) * ${plain(m.column)}` : plain(m.column);
  const full = h("select", { id: `scale-${m.signal}${end}`, "aria-label": "Its full scale" }, (m.full ?? []).map((f) => h("option", { value: f }, f)));
  const take = (e) => {
    const volts = Number(e.target.value.replace(",", "."));
    if (volts > 0) map(m.signal, { formula: `${signed} * ${volts} / ${full.value}` });
  };
  return [m.direction && h("div", {}, h("button", { class: "small primary", id: `signed-${m.signal}${end}`, onclick: () => map(m.signal, { formula: signed }) }, `Take its sign from ${m.direction}`)),
    m.full?.length > 0 && h("div", { class: "why" }, full, " is ", h("input", { type: "text", inputmode: "decimal", class: "typed short", "aria-label": "What full scale is", id: `full-${m.signal}${end}`, autocomplete: "off", placeholder: "12", onchange: take }), ` ${m.unit}${m.direction ? ", with that sign" : ""}`)];
}

// A field for a formula; while something is typed that was not taken yet, the page does not draw it anew.
function field(id, label, value, placeholder, take) {
  const taken = (e) => {
    e.target.dataset.shown = e.target.value;
    take(e.target.value);
  };
  return h("input", { type: "text", class: "formula", id, "aria-label": label, spellcheck: "false", autocomplete: "off", value, "data-shown": value, placeholder, onchange: taken });
}

// What the time is, where the reader is to be told.
function time(table, end, map) {
  const stated = /^(.*\S)\s*\[([^\]]*)\]$/.exec(table.time);
  const labels = [...new Set([...table.clock.columns, ...table.columns.map((c) => c.label)])];
  const bare = (label) => label.split(" [")[0];
  const now = stated ? stated[1] : table.time || table.clock.columns[0] || "";
  const own = labels.find((l) => l === now || bare(l) === now);
  const formula = Boolean(table.time) && !own;
  const said = stated?.[2] ?? /\[([^\]]+)\]/.exec(own ?? "")?.[1] ?? "";
  const send = (column, u) => map("t", { formula: column ? `${bare(column)}${u ? ` [${u}]` : ""}` : "" });
  const asked = table.clock.asked;
  return h("tr", {}, h("td", {}, h("b", {}, "time"), unit("s"), h("br"), h("span", { class: "quiet" }, "when it was measured")),
    h("td", {}, h("select", { id: `map-t${end}`, "aria-label": "Column of the time", onchange: (e) => send(e.target.value, said) },
      h("option", { value: "", selected: !own }, formula ? "by the formula" : "choose a column ..."),
      labels.map((l) => h("option", { value: l, selected: l === own }, l))),
      h("div", { class: "quiet why" }, table.fault ? "the time is not known" : table.time ? "as you set it" : "found by the reader")),
    h("td", {}, h("select", { id: `unit-t${end}`, disabled: !own, "aria-label": "Unit of the time", onchange: (e) => send(own, e.target.value) },
      [...new Set([said || "s", "s", "ms", "us", "ns", "min"])].map((u) => h("option", { value: u, selected: u === (said || "s") }, u)))),
    h("td", { colspan: 2 }, asked && h("button", { class: "small primary", id: `read-t${end}`, onclick: () => map("t", { formula: asked }) }, `Read ${bare(asked)} as ${/\[(\w+)\]/.exec(asked)?.[1]}`)),
    h("td", {}, field(`formula-t${end}`, "Formula of the time, or the s from row to row", formula ? table.time : "", "0.01 (s from row to row)", (text) => map("t", { formula: text }))));
}

function range(c) {
  if (c.low === null) return "no numbers";
  return c.low === c.high ? `${number(c.low, 4)} throughout` : `${number(c.low, 3)} to ${number(c.high, 3)}`;
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

// -------------------------------------------------------------------- check

const MARKS = { note: "ℹ noted", offer: "△ on offer", refuse: "✕ in the way" };

function check(block, state, go) {
  const chosen = block.cures ?? [];
  const button = (f, k) => {
    if (f.remap) return h("button", { id: `remap-${k}`, class: "small primary", onclick: () => go("remap", { finding: k }) }, f.remap.says ?? `Use ${Object.entries(f.remap.signals).map(([name, spec]) => `${words(name)} = ${spec}`).join(", ")}`);
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
    block.looked && h("details", { id: "looked" }, h("summary", {}, "What was looked for, in which columns"), block.looked.map((t) => h("p", { class: "quiet" }, t))),
  ];
}

// -------------------------------------------------------------------- compare

const shownToo = new Set(); // other models whose simulation is drawn too
let across = ["", ""];
let shownStretch = 0;
let how = "windowed";

function compare(block, state, go) {
  if (!block.result) return [];
  if (block.result.arm) return [joints(block.result, false), aside(block.result)];
  const { json, errors: rows, stretches, regions, channels } = block.result;
  shownStretch = Math.min(shownStretch, stretches.length - 1);
  const also = (block.others ?? []).filter((o) => shownToo.has(o.key)).slice(0, ALSO.length);
  const draw = () => plots("compare", `${block.key} ${shownStretch} ${how} ${also.map((o) => o.key)}`, (span) => api.show("compare", { ...span, stretch: shownStretch, how, also: also.map((o) => o.key) }), PAIR);
  const models = block.others?.length > 0 && h("div", { class: "row", role: "group", "aria-label": "Other models in the same plots" }, h("span", { class: "quiet" }, "Also simulated by"),
    block.others.map((o) => h("label", {}, h("input", { type: "checkbox", id: `also-${o.key}`, ...(shownToo.has(o.key) ? { checked: true } : {}), onchange: (e) => { e.target.checked ? shownToo.add(o.key) : shownToo.delete(o.key); go("redraw"); } }), ` ${o.name}`)));
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
  const toColumns = () => {
    const table = document.getElementById("mapping");
    table.open = true;
    table.scrollIntoView();
    table.querySelector("select")?.focus({ preventScroll: true });
  };
  return [
    (block.lost || block.refit) && h("div", { class: "row" },
      block.refit && h("button", { id: "refit", class: block.follows ? "primary" : "", disabled: Boolean(state.busy), onclick: () => go("refit") }, "Use the refitted values"),
      block.lost && h("button", { id: "to-columns", class: block.mixed ? "primary" : "", onclick: toColumns }, "See the columns")),
    h("p", { class: "quiet" }, "Drag to zoom, double-click to see all; with the keyboard: plus, minus, arrows, 0."),
    modes, models, legend(["measured", "simulated", ...also.map((o, k) => [`also${k}`, `simulated by ${o.name}`]), "residual"]), holder,
    xy(block, channels, block.result.inputs),
    where.length ? [h("h3", {}, "Where it fails"), h("ul", { class: "regions" }, where)] : null,
    h("details", { id: "scores" }, h("summary", {}, "Scores"), errors(rows, channels), scores(json, channels)),
    json.notes.length > 0 && h("details", {}, h("summary", {}, json.notes.length === 1 ? "1 note" : `${json.notes.length} notes`), h("ul", {}, json.notes.map((n) => h("li", {}, short(n, state))))),
  ];
}

// One quantity over another, in what the plots above show.
function xy(block, channels, inputs) {
  const names = [...Object.keys(channels), ...Object.keys(inputs ?? {}), ...Object.keys(channels).map((c) => `residual of ${c}`)];
  if (!names.includes(across[0])) across = [names[0], names[1] ?? names[0]];
  const holder = h("div", { id: "xy-plot" });
  const units = { ...channels, ...inputs };
  const label = (n) => `${words(n)}${unit(units[n.replace("residual of ", "")])}`;
  const draw = async () => {
    const [from, to] = stackOf("compare")?.span ?? [null, null];
    const found = await api.show("xy", { from, to, stretch: shownStretch, how, x: across[0], y: across[1] }).catch((e) => fill(holder, h("p", { class: "quiet" }, e.message)));
    if (found) fill(holder, legend(["measured", "simulated"]), scatter(found.curves, across.map(label)));
  };
  const choose = (k) => h("select", { id: `xy-${k ? "y" : "x"}`, "aria-label": k ? "Upwards" : "To the right", onchange: (e) => { across[k] = e.target.value; draw(); } }, names.map((n) => h("option", { value: n, selected: n === across[k] }, label(n))));
  return h("details", { id: "xy", ontoggle: (e) => e.target.open && draw() }, h("summary", {}, "One quantity over another"), h("div", { class: "row" }, choose(1), h("span", {}, "over"), choose(0), h("button", { class: "small", onclick: draw }, "Draw what is shown above")), holder);
}

// A note without the folder of the project in front of each file.
const short = (note, state) => note.replaceAll(`${state.folder}/`, "");

// The rows by which models are told apart, as the command line prints them; the first row is the head.
function errors(rows, units = {}) {
  if (!rows?.length) return null;
  rows = rows.map((r, k) => (k ? r.map((t, j) => (j === 1 && units[t] ? `${words(t)}${unit(units[t])}` : t)) : r));
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
  if (block.result.arm) return [h("ul", { id: "sentences" }, block.result.json.sentences.map((t) => h("li", {}, t))), joints(block.result, true), aside(block.result)];
  const { json, errors: rows } = block.result;
  return [
    found(block.result, block.unseen),
    rows?.length > 0 && h("details", { id: "errors" }, h("summary", {}, "The error, step by step"), errors(rows, state.model?.signals)),
    h("details", { id: "ranking" }, h("summary", {}, "All effects that competed, best first"), ranking(json.ranking)),
    planning(block, state, go),
    json.notes?.length > 0 && h("details", {}, h("summary", {}, json.notes.length === 1 ? "1 note" : `${json.notes.length} notes`), h("ul", {}, json.notes.map((n) => h("li", {}, short(n, state))))),
  ];
}

// The effects that were found: their values, and what validation data show of them; an effect that was refused is folded.
function found({ evidence: seen, values, unseen: none }, data) {
  const named = Object.keys(values).map((name) => [valued(name, values[name]), pictured(seen[name], none[name], data)]);
  const refused = Object.entries(seen).filter(([name]) => !(name in values)).map(([name, e]) =>
    h("details", { id: `refused-${name}` }, h("summary", {}, `The best effect that was refused: ${words(name)}`), pictured(e, "", data)));
  return [named, refused];
}

const valued = (name, own) => {
  const text = Object.entries(own).map(([parameter, value]) => (parameter ? `${parameter} = ${value}` : value)).join(", ");
  return h("h3", {}, words(name), text && [": ", h("span", { class: "value" }, text)]);
};

function pictured(e, why, data) {
  if (!e) return h("p", { class: "quiet" }, why);
  return [h("p", { class: "quiet" }, `What validation data show of it (${data}):`),
    h("div", { class: "pair" }, evidence(e, "named", "curve"), e.spectrum && spectrum(e.spectrum, e.unit), e.rival && evidence(e, "rival", "rival"))];
}

// What was tried while a diagnosis runs.
function tried(rows) {
  const head = ["model with", "error of the motion / noise", "force left, % of the effort"];
  return h("table", { id: "tried" }, h("thead", {}, h("tr", {}, head.map((t, k) => h("th", { class: k ? "number" : "", scope: "col" }, t)))),
    h("tbody", {}, rows.map((r) => h("tr", {}, h("td", {}, r.effects.map(words).join(" + ") || "nothing added"),
      h("td", { class: "number" }, number(r.error)), h("td", { class: "number" }, number(r.force))))));
}

const STATUS = { confirmed: "✓ confirmed", ambiguous: "≈ a tie", not_excited: "… not to be seen here", rejected: "✕ rejected", not_applicable: "– does not apply" };

// Of many values the first ones, and how many there are.
const fewest = (pairs) => (pairs.length > 8 ? [...pairs.slice(0, 6), ["", `and ${pairs.length - 6} more, in the model file`]] : pairs);

function ranking(entries) {
  const worst = (v) => v && Math.max(...Object.entries(v).filter(([k]) => k !== "score").map(([, s]) => s?.rmse_over_noise ?? 0));
  return h("table", {}, h("thead", {}, h("tr", {}, ["effect", "", "error / noise", "why", "fitted"].map((t, k) => h("th", { class: k === 2 ? "number" : "", scope: "col" }, t)))),
    h("tbody", {}, entries.map((e) => h("tr", {}, h("td", {}, words(e.effect)), h("td", { class: "status" }, STATUS[e.status] ?? e.status ?? ""),
      h("td", { class: "number" }, number(worst(e.validation))), h("td", {}, e.why ?? ""),
      h("td", {}, fewest(Object.entries(e.parameters ?? {})).map(([n, p]) => n === "" ? p : `${n} = ${number(p.value, 4)}${p.std ? ` ± ${number(p.std, 2)}` : ""} ${p.unit === "-" ? "" : p.unit}`).join(", "))))));
}

// -------------------------------------------------------------------- arms

// The table joint x stage: RMS of what is left of each effort, on data that no fit saw.
const STEPS = [["effort", "effort"], ["as_given", "URDF"], ["rigid", "rigid refit"], ["basic", "+ friction"], ["model", "model"]];

function joints({ json }, named) {
  const head = ["joint", "", ...STEPS.map(([, title]) => title), ...(named ? ["named"] : [])];
  return h("table", { id: named ? "joints-named" : "joints" }, h("caption", {}, `Left of each effort, RMS below ${number(json.band_hz)} Hz`),
    h("thead", {}, h("tr", {}, head.map((t, k) => h("th", { class: k > 1 && k < 7 ? "number" : "", scope: "col" }, t)))),
    h("tbody", {}, Object.entries(json.joints).map(([name, own]) => h("tr", { "data-joint": name }, h("td", { class: "name" }, name), h("td", {}, unit(own.unit)),
      STEPS.map(([key]) => h("td", { class: "number" }, number(own[key]))), named && h("td", {}, own.effects.map(words).join(", "))))));
}

function aside({ json, cannot }) {
  const own = Object.entries(json.joints).flatMap(([name, joint]) => joint.cannot_tell.map((why) => `${name}: ${why}`));
  return [h("details", { id: json.sentences ? "cannot-named" : "cannot" }, h("summary", {}, "What cannot be told"), h("ul", {}, [...own, ...cannot].map((t) => h("li", {}, t)))),
    json.notes.length > 0 && h("details", {}, h("summary", {}, json.notes.length === 1 ? "1 note" : `${json.notes.length} notes`), h("ul", {}, json.notes.map((t) => h("li", {}, t))))];
}

// -------------------------------------------------------------------- add

let tuner = null;

function add(block, state, go) {
  if (block.why) return [];
  const busy = Boolean(state.busy);
  const buttons = (block.offers ?? []).map((e, k) => h("button", { id: k ? `add-${e}` : "do-add", class: k || !block.sure ? "" : "primary", disabled: busy, onclick: () => go("add", { effect: e }) }, `Add ${words(e)}${block.sure ? "" : ", which explains a part"}`));
  const over = h("select", { id: "learn-over", "aria-label": "Over what it is learned", disabled: busy }, ["speed", "position", "load"].map((o) => h("option", { value: o }, `over the ${o}`)));
  const learn = block.learns && [h("button", { id: "learn", disabled: busy, onclick: () => go("learn", { over: over.value }) }, "Learn it as a curve"), over];
  const other = block.others?.length > 0 && h("select", { id: "add-other", "aria-label": "Add another effect", disabled: busy, onchange: (e) => e.target.value && go("add", { effect: e.target.value }) },
    h("option", { value: "" }, "add another one ..."), block.others.map((e) => h("option", { value: e }, words(e))));
  const channels = block.ladder?.length ? Object.keys(block.ladder[0].validation).filter((c) => c !== "score") : [];
  const forces = (block.ladder ?? []).map((r) => ({ label: r.label, validation: { force: r.force } }));
  if (!tuner || tuner.model !== state.model?.name) tuner = state.model ? new Tuner(state, block.std ?? {}, (values) => go("keep", { values })) : null;
  return [
    h("div", { class: "row" }, buttons, learn, other),
    block.result && Object.entries(block.result.values).map(([name, own]) => valued(name, own)),
    block.ladder?.length > 0 && h("div", { class: "pair", id: "ladder" }, channels.map((c) => ladder(block.ladder, c, state.model?.signals[c] ?? "")),
      forces.some((r) => r.validation.force) && ladder(forces, "force", "% of the effort", "missing on validation data")),
    block.ladder?.length > 0 && h("p", { class: "quiet" }, `Validation data: ${block.unseen}. "refitted": the model without the effect, its other parameters fitted anew; they then imitate what it lacks, and may do worse on validation data than as given.`),
    block.result && Object.keys(block.result.values).map((name) => h("details", { id: `shown-${name}` }, h("summary", {}, `The evidence for ${words(name)}`),
      pictured(block.result.evidence[name], block.result.unseen[name], block.unseen))),
    tuner && h("details", { id: "tuner", ontoggle: (e) => e.target.open && tuner.start() }, h("summary", {}, "Parameters by hand: drag, and see curve, A", h("sub", {}, "k"), " and poles move"), tuner.element),
  ];
}

export const restyleTuner = () => tuner?.restyle();

// -------------------------------------------------------------------- use

const FILES = { "model.yaml": "Model (YAML)", "report.html": "Report (HTML)", "replay.sh": "Script of all commands" };

function use(block, state, go) {
  if (block.why) return [];
  const pick = h("select", { id: "target" }, (block.targets ?? []).map((t) => h("option", { value: t, selected: t === block.target }, t)));
  return [
    block.files?.length > 0 && h("div", { class: "row", id: "exported" }, block.files.map((f) => h("a", { class: "button", href: api.exported(f), target: f.endsWith(".html") ? "_blank" : null, download: f.endsWith(".html") ? null : "" }, FILES[f]))),
    block.targets && h("div", { class: "row", id: "to-target" }, h("label", { for: "target" }, "For another tool"), pick, h("button", { id: "do-target", disabled: Boolean(state.busy), onclick: () => go("use", { target: pick.value }) }, "Write and run it there")),
    block.loss && loss(block),
    state.model && h("details", {}, h("summary", {}, "The model file"), h("pre", { tabindex: 0 }, state.model.yaml)),
    block.script && h("details", { id: "script" }, h("summary", {}, "What was done, as a script"), h("pre", { tabindex: 0 }, block.script)),
  ];
}

// What a file for another tool holds and loses, with the errors as they were measured there.
function loss(block) {
  const found = block.loss;
  const rows = Object.entries(found.loss).map(([name, c]) => h("tr", {}, h("td", {}, words(name)), [c.ours, c.target].map((v) => h("td", { class: "number" }, number(v))), h("td", {}, unit(c.unit)), h("td", { class: "number" }, `${number(c.percent)} %`)));
  return h("div", { id: "loss" },
    h("div", { class: "row" }, block.made.map((f) => h("a", { class: "button", href: api.exported(f), download: "" }, f))),
    rows.length > 0 ? h("table", {}, h("caption", {}, `RMS errors against ${found.against}`), h("thead", {}, h("tr", {}, ["", "our exact model", `in ${found.target}`, "", "apart"].map((t) => h("th", { scope: "col" }, t)))), h("tbody", {}, rows)) : h("p", {}, `Not run: ${found.not_run}`),
    h("ul", {}, [...found.holds.map((t) => `held: ${t}`), ...found.lost.map((t) => `lost: ${t}`), ...Object.entries(found.settings).map(([k, v]) => `${k}: ${v}`)].map((t) => h("li", {}, t))));
}

export const RENDER = { record, check, compare, diagnose, add, use };
