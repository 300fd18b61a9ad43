// Elements from data: text is always text, never HTML.

const SVG = "http://www.w3.org/2000/svg";
const DRAWN = new Set(["svg", "g", "path", "line", "rect", "circle", "text", "title", "polygon", "defs", "clipPath"]);

export function h(tag, attributes = {}, ...children) {
  const element = DRAWN.has(tag) ? document.createElementNS(SVG, tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes ?? {})) {
    if (value === null || value === undefined) continue;
    if (name.startsWith("aria-")) element.setAttribute(name, value);
    else if (value === false) continue;
    else if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "value" && "value" in element) element.value = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  put(element, children);
  return element;
}

function put(element, children) {
  for (const child of children.flat(Infinity)) {
    if (child === null || child === undefined || child === false) continue;
    element.append(child instanceof Node ? child : document.createTextNode(String(child)));
  }
}

// Put new children into an element; what had the focus has it again, if it is still there.
export function fill(element, ...children) {
  const held = element.contains(document.activeElement) ? document.activeElement.id : "";
  element.replaceChildren();
  put(element, children);
  if (held) document.getElementById(held)?.focus({ preventScroll: true });
}

// Proper names in the names of effects, as the server prints them.
export const proper = {};

export function words(name) {
  let text = String(name);
  for (const [key, printed] of Object.entries(proper)) text = text.replace(new RegExp(`(?<![a-z])${key}(?![a-z])`, "g"), printed);
  return text.replaceAll("_", " ");
}

export function number(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "-";
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e6 || size < 1e-4)) return value.toExponential(digits - 1).replace(/\.?0*e\+?/, "e");
  return String(Number(value.toPrecision(digits)));
}

export function say(text) {
  document.getElementById("said").textContent = text;
}

export function unit(text) {
  return text && text !== "-" ? ` [${text}]` : "";
}
