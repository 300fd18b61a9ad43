import { fill, h } from "./dom.js";

export function live(shown) {
  if (shown) fill(document.getElementById("live"), h("p", {}, "No live view yet."));
}
