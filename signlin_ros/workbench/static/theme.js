"use strict";
// Before anything is drawn, so that the page does not flash in the other colours.
(() => {
  const kept = localStorage.getItem("signlin-theme");
  const dark = kept ? kept === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = dark ? "dark" : "light";
})();
