// The plots of each place of the page, kept as long as they show the same thing.

import { h, fill } from "./dom.js";
import { Stack } from "./plots.js";

const stacks = new Map();
export function restyle() {
  for (const { stack } of stacks.values()) stack.restyle();
}

// The plots of a place, kept as long as they show the same thing.
export function plots(place, key, ask, rows, labels = {}) {
  const held = stacks.get(place);
  if (held?.key === key) return held.stack.element;
  const room = held?.stack.element.offsetHeight ?? 0; // kept until the new ones are drawn
  held?.stack.clear();
  const stack = new Stack(h("div", { id: `plots-${place}` }), ask, rows, 3, labels);
  if (room) stack.element.style.minHeight = `${room}px`;
  stacks.set(place, { key, stack });
  requestAnimationFrame(() => stack.load([null, null]).catch((e) => fill(stack.element, h("p", { class: "error" }, e.message))));
  return stack.element;
}

export const stackOf = (place) => stacks.get(place)?.stack;
