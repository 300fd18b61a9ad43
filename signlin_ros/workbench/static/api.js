// Requests to the server; what it refuses is thrown with its own words.

const base = location.pathname.replace(/\/+$/, "");
const HEADERS = { "x-signlin": "1", "content-type": "application/json" };

const PATIENCE = 30_000; // ms for the state

export class Refused extends Error {}

async function answered(response) {
  const content = await response.json().catch((error) => {
    if (response.ok) throw error; // cut off on the way
    return { what: `${response.status} ${response.statusText}` };
  });
  if (!response.ok) throw new Refused(content.what ?? response.statusText);
  return content;
}

export const state = async () => answered(await fetch(`${base}/state`, { cache: "no-store", signal: AbortSignal.timeout(PATIENCE) }));
export const post = async (path, args = {}) =>
  answered(await fetch(`${base}${path}`, { method: "POST", headers: HEADERS, body: JSON.stringify(args) }));
export const act = (name, args) => post(`/do/${name}`, args);
export const show = (what, args) => post(`/show/${what}`, args);
export const projects = async () => answered(await fetch("/projects", { cache: "no-store" }));
export const newProject = async () => answered(await fetch("/new", { method: "POST", headers: HEADERS, body: "{}" }));
export const arrange = async (verb, args = {}) =>
  answered(await fetch(`/projects/${location.pathname.split("/")[2]}/${verb}`, { method: "POST", headers: HEADERS, body: JSON.stringify(args) }));
export const exported = (name) => `${base}/export/${name}`;
export const events = () => new EventSource(`${base}/events`);
export const liveEvents = () => new EventSource(`${base}/live`);

// A file goes out as the body of a request, so that it is never held in memory as a whole.
export function upload(file, progress) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("PUT", `${base}/files?name=${encodeURIComponent(file.name)}`);
    request.setRequestHeader("x-signlin", "1");
    request.upload.onprogress = (e) => progress(e.loaded / Math.max(e.total, 1));
    request.onerror = () => reject(new Error(`${file.name}: the server does not answer, or refuses a file of that size`));
    request.onload = () => {
      const content = JSON.parse(request.responseText || "{}");
      if (request.status === 200) resolve(content.file);
      else reject(new Error(content.what ?? request.statusText));
    };
    request.send(file);
  });
}

// Numbers as they come: little-endian float64 in base64.
export function decode(packed) {
  const text = atob(packed.f8);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new Float64Array(bytes.buffer);
}
