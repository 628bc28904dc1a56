/** Colours: of the page, by its style sheet; of the map, read from there. */

const NAMES = [
  "bg", "floor", "line", "text", "muted", "accent", "alarm", "past", "wall", "zone", "panel",
  "robot-0", "robot-1", "robot-2", "robot-3", "robot-4",
];

/** Colours of robots, before they repeat. */
const ROBOTS = 5;

/** @type {Record<string, string>} */
let colours = {};

/** Read the colours that the page has now. */
export function readColours() {
  const probe = document.createElement("span");
  document.body.append(probe);
  for (const name of NAMES) {
    probe.style.color = `var(--${name})`;
    colours[name] = getComputedStyle(probe).color;
  }
  probe.remove();
}

/** @param {string} name @returns {string} a colour for the canvas */
export function colour(name) {
  return colours[name];
}

/** @param {number} index of a robot in the mission @returns {number} which colour it has */
export function robotHue(index) {
  return index % ROBOTS;
}

/** @param {number} index of a robot in the mission @returns {string} its colour on the canvas */
export function robotColour(index) {
  return colours[`robot-${robotHue(index)}`];
}

/**
 * Let the user switch between the system's theme, light and dark; the choice is kept.
 * @param {HTMLSelectElement} select @param {() => void} changed after colours have been read anew
 */
export function setUpTheme(select, changed) {
  const apply = () => {
    const choice = select.value;
    if (choice === "auto") delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = choice;
    readColours();
    changed();
  };
  select.value = localStorage.getItem("theme") ?? "auto";
  select.addEventListener("change", () => {
    localStorage.setItem("theme", select.value);
    apply();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", apply);
  apply();
}

/** @returns {boolean} whether the user wants little motion on the screen */
export function calm() {
  return matchMedia("(prefers-reduced-motion: reduce)").matches;
}
