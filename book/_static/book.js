// Paper is white: what is printed has the colours of the light theme, whichever is on the screen.
let onScreen;
addEventListener("beforeprint", () => {
  onScreen = document.documentElement.dataset.theme;
  document.documentElement.dataset.theme = "light";
});
addEventListener("afterprint", () => {
  document.documentElement.dataset.theme = onScreen;
});

// What is wider than the page scrolls by itself; a line below it says so.
const SCROLLERS = ".cell_output, .cell_output .output, .bd-article table, .pst-scrollable-table-container";
function tellWhatScrolls() {
  for (const old of document.querySelectorAll(".swipe")) old.remove();
  for (const one of document.querySelectorAll(SCROLLERS)) {
    if (one.scrollWidth <= one.clientWidth + 4 || getComputedStyle(one).overflowX !== "auto") continue;
    const line = document.createElement("p");
    line.className = "swipe";
    line.textContent = "scroll sideways for the rest \u2192";
    one.after(line);
  }
}
addEventListener("load", tellWhatScrolls);
addEventListener("resize", tellWhatScrolls);
