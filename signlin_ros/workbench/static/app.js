// The page: one state from the server, drawn stage by stage; what happens is told by the server as it happens.

import * as api from "./api.js";
import { h, fill, proper, say } from "./dom.js";
import { restyle } from "./stacks.js";
import { RENDER, command, restyleTuner } from "./stages.js";
import { live, restyleLive } from "./live.js";
import * as place from "./place.js";
import { latest } from "./sync.js";

const DO = { check: "Check", compare: "Compare", diagnose: "Diagnose", use: "Export" };
const NAMES = { use: "export" };
const main = document.getElementById("stages");
let state = null;
let uploading = null;
let trouble = {};
let wasBusy = false;
const opened = new Map(); // which details were, by their names; what is lacking in the mapping opens it again

const RETRY = 1000; // ms after which a state that did not come is asked for again

const refresh = latest(async () => {
  try {
    state = await api.state();
    Object.assign(proper, state.proper);
  } catch (error) {
    document.getElementById("loading")?.replaceChildren(`This project cannot be shown: ${error.message}. `, h("a", { href: "/" }, "Open another one"));
    if (!(error instanceof api.Refused)) setTimeout(refresh, RETRY);
    else if (state) lost(`What you see is not the latest: ${error.message}. Please report this as a fault.`);
    return;
  }
  lost(null);
  draw();
});

const GONE = ["The server does not answer. Start ", h("code", {}, "signlin workbench"), " again: nothing is lost."];

// Say above all else what is wrong with what is shown; nothing where all is well.
function lost(...what) {
  const box = document.getElementById("lost");
  box.hidden = what[0] === null;
  if (!box.hidden) fill(box, what);
}

async function go(name, args) {
  place.follow();
  if (name === "redraw") return draw();
  trouble = {};
  try {
    if (name === "files") await take(args);
    else await api.act(name, args ?? {});
  } catch (error) {
    const where = { map_signal: "record", remap: "check", apart: "record", known: "record", model: "record", role: "record", drop: "record", plan: "diagnose", unplan: "diagnose", trust: "record", write: "record", sample: "record", files: "record", cure: "check", keep: "add", learn: "add", refit: "compare", export: "use" }[name] ?? name;
    trouble[where in RENDER ? where : "record"] = error.message;
    say(error.message);
  }
  await refresh();
}

async function take(files) {
  const names = [];
  try {
    for (const file of files) {
      uploading = `${file.name}: 0 %`;
      names.push(await api.upload(file, (share) => {
        uploading = `${file.name}: ${Math.round(100 * share)} %`;
        const shown = document.getElementById("uploading");
        if (shown) shown.textContent = uploading;
        else draw();
      }));
    }
  } finally {
    uploading = null;
    if (names.length) await api.act("take", { files: names });
  }
}

// -------------------------------------------------------------------- drawing

function draw() {
  if (!state) return;
  place.follow();
  for (const block of state.stages) stage(block);
  place.keep();
  document.getElementById("loading")?.remove();
  const busy = Boolean(state.busy);
  if (!busy && wasBusy) say("Done.");
  if (!busy && wasBusy) projects();
  wasBusy = busy;
  for (const [id, label, name] of [["undo", state.undo, "Undo"], ["redo", state.redo, "Redo"]]) {
    const button = document.getElementById(id);
    button.disabled = !label || busy;
    button.title = label ? `${name}: ${label}` : `Nothing to ${name.toLowerCase()}`;
  }
  rail();
  document.documentElement.dataset.serial = state.serial; // which state is shown
}

function stage(block) {
  const id = `stage-${block.id}`;
  let section = document.getElementById(id);
  if (!section) {
    section = h("section", { id, class: "stage", "aria-labelledby": `${id}-title` }, h("div", { class: "head" }), h("div", { class: "body" }), h("div", { class: "foot" }));
    main.append(section);
    place.watch(section);
  }
  const working = state.busy?.stage === block.id;
  section.classList.toggle("waiting", Boolean(block.why));
  section.dataset.done = block.done;
  section.dataset.busy = working;
  fill(section.querySelector(".head"), head(block, working));
  const body = section.querySelector(".body");
  body.style.minHeight = `${body.offsetHeight}px`; // nothing jumps while it is worked out
  for (const d of body.querySelectorAll("details[id]")) opened.set(d.id, d.open);
  if (!typing(body)) fill(body, block.why ? null : RENDER[block.id](block, state, go));
  for (const d of body.querySelectorAll("details[id]")) if (opened.has(d.id)) d.open = opened.get(d.id) || (d.open && d.id === "mapping");
  fill(section.querySelector(".foot"), next(block));
  release(body);
}

// Whether pictures are still to come.
const settling = (body) => [...body.querySelectorAll(".plots:not([data-drawn])")].some((e) => e.checkVisibility()); // not what is folded

// Give a stage the height that it has by itself, once nothing runs and its pictures are drawn.
function release(body, tries = 40) {
  if (!state.busy && (!settling(body) || tries === 0)) body.style.minHeight = "";
  else if (!state.busy) setTimeout(() => release(body, tries - 1), 150);
}

// Whether somebody types there.
function typing(body) {
  const field = document.activeElement;
  return body.contains(field) && field.matches("input.formula") && field.value !== field.dataset.shown;
}

function head(block, working) {
  const error = trouble[block.id] ? { what: trouble[block.id], do: "" } : block.error;
  const can = DO[block.id] && !block.why && !working && !checked(block);
  const fresh = can && !block.done;
  const offered = state.stages.some((b) => b.sure && b.offers?.length > 0); // then adding is what comes next
  const first = !offered && state.stages.find((b) => !b.done && !b.why)?.id === block.id;
  return [
    h("div", { class: "title" }, h("h2", { id: `stage-${block.id}-title` }, block.title),
      h("p", { class: block.why ? "sentence quiet" : "sentence", id: `says-${block.id}` }, (block.why || block.sentence).replaceAll("`", "")),
      (fresh || (can && block.id === "use")) && h("button", { id: `do-${block.id}`, class: fresh && (first || added(block)) ? "primary" : "", disabled: Boolean(state.busy), onclick: () => go(NAMES[block.id] ?? block.id) }, DO[block.id])),
    block.id === "record" && uploading && h("p", { class: "busy", role: "status" }, h("progress", {}), h("span", { id: "uploading" }, uploading)),
    working && h("div", { class: "busy", role: "status" },
      h("progress", { id: `progress-${block.id}`, max: 1, ...(state.busy.share > 0 ? { value: state.busy.share } : {}), "aria-label": state.busy.what }),
      h("span", { id: `what-${block.id}` }, `${state.busy.what} ...`), h("button", { id: "cancel", onclick: () => go("cancel") }, "Cancel")),
    error && h("div", { class: "error", id: `error-${block.id}`, role: "alert" }, h("p", {}, h("b", {}, error.what)), error.do && h("p", {}, error.do)),
    !block.why && command(block.command),
  ];
}

// The check is done by itself; it is only asked for where that failed.
const checked = (block) => block.id === "check" && Boolean(block.findings);

// After an addition the model may be taken, whatever else one may ask.
const added = (block) => block.id === "use" && state.stages.some((b) => b.id === "add" && b.done);

// The next step, where the eye is when a stage has been read.
function next(block) {
  const order = state.stages.map((b) => b.id);
  const after = state.stages[order.indexOf(block.id) + 1];
  if (!block.done || !after || after.done || after.why || !DO[after.id] || checked(after) || state.busy) return null;
  const does = () => {
    document.getElementById(`stage-${after.id}`).scrollIntoView({ behavior: "instant" });
    go(NAMES[after.id] ?? after.id);
  };
  return h("div", { class: "row" }, h("button", { id: `next-${block.id}`, onclick: does }, `Next: ${DO[after.id]}`));
}

// In a word, how a stage stands.
function standing(b) {
  if (state.busy?.stage === b.id) return "running";
  if (b.why) return "not yet";
  if (b.error || trouble[b.id] || (b.needs && state.records.length)) return "needs you";
  return b.done ? "done" : "ready";
}

function rail() {
  const here = state.busy?.stage ?? state.stages.find((b) => !b.done && !b.why)?.id;
  fill(document.getElementById("rail"), h("ol", {}, state.stages.map((b) => h("li", {},
    h("a", { href: `#stage-${b.id}`, id: `to-${b.id}`, "aria-current": b.id === here ? "step" : null },
      h("span", { "aria-hidden": "true" }, state.busy?.stage === b.id ? "◌" : standing(b) === "needs you" ? "!" : b.done ? "✓" : b.why ? "·" : "○"),
      h("span", {}, b.title, h("span", { class: "hidden" }, b.done ? ", done" : b.why ? ", not possible yet" : "")),
      h("small", {}, standing(b)))))));
}

// -------------------------------------------------------------------- what happens

function listen() {
  const events = api.events();
  events.onopen = () => {
    refresh(); // what happened before it was open was told to nobody
  };
  events.onerror = () => lost(...GONE);
  events.onmessage = (e) => {
    const told = JSON.parse(e.data);
    if (told.kind === "progress" && state) {
      state.busy = told.busy;
      const block = state.stages.find((b) => b.id === told.busy.stage);
      if (block) stage(block);
      say(`${told.busy.what}, ${Math.round(100 * told.busy.share)} %`);
    } else if (told.kind !== "beat" || told.serial !== state?.serial) refresh();
  };
}

function dropping() {
  const veil = document.getElementById("veil");
  const files = (e) => [...(e.dataTransfer?.types ?? [])].includes("Files");
  addEventListener("dragover", (e) => { if (files(e)) { e.preventDefault(); veil.hidden = false; } });
  addEventListener("dragleave", (e) => { if (!e.relatedTarget) veil.hidden = true; });
  addEventListener("drop", (e) => {
    if (!files(e)) return;
    e.preventDefault();
    veil.hidden = true;
    go("files", [...e.dataTransfer.files]);
  });
}

function theme() {
  const button = document.getElementById("theme");
  const root = document.documentElement;
  const tell = () => button.setAttribute("aria-pressed", root.dataset.theme === "dark");
  button.addEventListener("click", () => {
    root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark";
    localStorage.setItem("signlin-theme", root.dataset.theme);
    tell();
    restyle();
    restyleTuner();
    restyleLive();
    draw();
  });
  tell();
}

function tabs() {
  const all = [...document.querySelectorAll("[role=tab]")];
  const pick = (tab) => {
    for (const one of all) {
      one.setAttribute("aria-selected", one === tab);
      one.tabIndex = one === tab ? 0 : -1;
      document.getElementById(one.getAttribute("aria-controls")).hidden = one !== tab;
    }
    live(tab.id === "tab-live", state);
    tab.focus();
  };
  all.forEach((tab, k) => {
    tab.addEventListener("click", () => pick(tab));
    tab.addEventListener("keydown", (e) => { if (e.key === "ArrowRight" || e.key === "ArrowLeft") pick(all[(k + 1) % all.length]); });
  });
}

// The projects of this folder; which one is shown, and the others to go to.
async function projects() {
  const select = document.getElementById("projects");
  const here = location.pathname.split("/")[2];
  const clock = { month: "short", day: "numeric", hour: "2-digit", minute: "2-digit" };
  const found = await api.projects().catch(() => []);
  const others = found.filter((p) => p.id !== here);
  const own = found.find((p) => p.id === here);
  fill(select, h("option", { value: here, selected: true }, own?.title ?? "this project"),
    others.map((p) => h("option", { value: p.id }, `${p.title} (${new Date(1000 * p.used).toLocaleString("en", clock)})`)));
  select.disabled = !others.length;
  select.onchange = () => { location.href = `/p/${select.value}`; };
}

document.getElementById("undo").addEventListener("click", () => go("undo"));
document.getElementById("redo").addEventListener("click", () => go("redo"));
document.getElementById("new").addEventListener("click", async () => { location.href = `/p/${(await api.newProject()).id}`; });
for (const [verb, ask] of [
  ["rename", () => { const name = prompt("Name of this project", document.getElementById("projects").selectedOptions[0]?.textContent ?? ""); return name === null ? null : { name }; }],
  ["duplicate", () => ({})],
  ["delete", () => (confirm("Delete this project, with its records, models and results? This cannot be undone.") ? {} : null)],
]) {
  document.getElementById(verb).addEventListener("click", async () => {
    document.getElementById("arrange").open = false;
    const args = ask();
    if (!args) return;
    try {
      const { id } = await api.arrange(verb, args);
      if (verb === "rename") await projects();
      else location.href = `/p/${id}`;
    } catch (error) {
      trouble = { record: error.message };
      draw();
    }
  });
}
dropping();
theme();
tabs();
listen();
projects();
refresh();
