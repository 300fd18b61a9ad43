// What is looked at stays where it is in the window while what stands above it changes its height, at once or later.
// The place is that of what was clicked on last, or, after scrolling, of what stands where one reads.

let marks = []; // names of elements, the closest first, and where their upper edges were in the window [px]
let placed = 0; // where the page was scrolled to when that was so [px]

const named = (element) => {
  const found = [];
  for (let e = element?.closest?.("section.stage, section.stage [id]"); e; e = e.parentElement?.closest("section.stage, section.stage [id]")) if (e.id) found.push(e);
  return found;
};
const seen = (element) => element.getBoundingClientRect().top < innerHeight && element.getBoundingClientRect().bottom > 0;

// Take where things are now for where they shall stay; at the top of the page nothing is held.
export function hold(target = null) {
  const read = document.elementsFromPoint(innerWidth * 0.6, Math.min(innerHeight * 0.45, 420)).find((e) => e.closest("section.stage"));
  const found = scrollY === 0 ? [] : [...named(target).filter(seen), ...named(read)];
  marks = found.map((e) => [e.id, e.getBoundingClientRect().top]);
  placed = scrollY;
}

// Hold what is seen now, if somebody has scrolled since.
export function follow() {
  if (Math.abs(scrollY - placed) > 1) hold();
}

// Put the first of what is held that is still there to where it was.
export function keep() {
  for (const [id, top] of marks) {
    const element = document.getElementById(id);
    if (!element?.checkVisibility()) continue;
    const moved = element.getBoundingClientRect().top - top;
    if (Math.abs(moved) > 1) scrollBy({ top: moved, behavior: "instant" });
    break;
  }
  placed = scrollY; // as far as there is page enough
}

const watcher = new ResizeObserver(keep);

// Keep the place whenever this element changes its size.
export const watch = (element) => watcher.observe(element);

addEventListener("pointerdown", (e) => hold(e.target), { passive: true, capture: true });
addEventListener("keydown", (e) => hold(e.target), { passive: true, capture: true });
addEventListener("scroll", follow, { passive: true });
