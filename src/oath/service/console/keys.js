import { byId, el, isTyping } from "./dom.js";

/**
 * @typedef {object} Shortcut
 * @property {string} key as the browser names it @property {string} [shown] as the help names it
 * @property {string} does @property {() => void} run
 */

/** Keys of which the help tells, but which their elements handle. */
const OTHERS = [
  ["Arrows", "on the map: pan; on the timeline: 1 s back or on; in tables: next row; in the chat: what was said"],
  ["Page ↑ ↓", "on the timeline: 10 s back or on"],
  ["Enter", "in tables: show it on the map; in the chat: send"],
  ["Ctrl + Enter", "confirm the proposal, also while typing"],
  ["Esc", "put the tool away, leave the field, end the selection"],
];

/**
 * Keys that work wherever nothing is typed; those of the help dialog, too.
 * @param {Shortcut[]} shortcuts
 * @param {{confirm: () => void, escape: () => void}} always
 */
export function setUpKeys(shortcuts, always) {
  const help = /** @type {HTMLDialogElement} */ (byId("help"));
  const rows = [...shortcuts.map(({ key, shown, does }) => [shown ?? key.toUpperCase(), does]), ...OTHERS];
  byId("help-keys").append(...rows.map(([key, does]) => el("li", {}, el("kbd", {}, key), el("span", {}, does))));
  const open = () => help.showModal();
  byId("help-button").addEventListener("click", open);
  addEventListener("keydown", (event) => {
    if (document.querySelector("dialog[open]")) return;
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) {
      event.preventDefault();
      always.confirm();
    } else if (event.key === "Escape") always.escape();
    else if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
    else if (event.key === "?") open();
    else if (!(event.key === " " && event.target instanceof HTMLElement && event.target.matches("button"))) {
      const shortcut = shortcuts.find(({ key }) => key === event.key.toLowerCase());
      if (!shortcut) return;
      event.preventDefault();
      shortcut.run();
    }
  });
}
