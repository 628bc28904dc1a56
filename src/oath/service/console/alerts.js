import { byId, el, setText } from "./dom.js";
import { plural, showTime } from "./format.js";
import { LOST } from "./world.js";

/** Notes that stand on the map at once. */
const MOST = 3;

/** How long a note stays [ms]; the list keeps it. */
const STAYS = 20000;

/** What needs the operator's eye: found obstacles, failures, stranded tasks, lost robots. */
export class Alerts {
  /** @param {import("./world.js").World} world */
  constructor(world) {
    this.world = world;
    this.host = byId("alerts");
    this.list = byId("alert-list");
    /** Alerts that were there when the page opened are listed, not announced. */
    this.known = world.live.alerts.length;
    /** @type {Set<string>} */
    this.lost = new Set();
    this.#list();
    world.on("state", () => this.#state());
    setInterval(() => this.#robots(), 1000);
    byId("alerts-button").addEventListener("click", () => this.#toggle());
    byId("alerts-close").addEventListener("click", () => this.#toggle());
  }

  #state() {
    if (this.world.past) return;
    const { alerts } = this.world.live;
    if (alerts.length === this.known) return;
    for (const alert of alerts.slice(this.known)) {
      this.raise(`${alert.text}`, showTime(alert.t));
    }
    this.known = alerts.length;
    this.#list();
  }

  /** Robots that have not been heard of, and those that came back. */
  #robots() {
    if (this.world.link.status !== "live") return;
    for (const { id, status } of this.world.live.robots) {
      const gone = status !== "failed" && this.world.pose(id).age > LOST;
      if (gone && !this.lost.has(id)) this.raise(`${id} has not been heard of`, showTime(this.world.t));
      if (gone) this.lost.add(id);
      else this.lost.delete(id);
    }
  }

  /** Put a note on the map for a while. @param {string} text @param {string} time */
  raise(text, time) {
    const note = el("li", {}, el("span", { class: "when" }, time), el("span", {}, text));
    const close = el("button", { type: "button", class: "quiet", "aria-label": `Dismiss: ${text}`, onclick: () => note.remove() }, "×");
    note.append(close);
    this.host.append(note);
    setTimeout(() => note.contains(document.activeElement) || note.remove(), STAYS);
    while (this.host.children.length > MOST) this.host.firstElementChild?.remove();
  }

  #list() {
    const { alerts } = this.world.live;
    setText(byId("count-alerts"), plural(alerts.length, "alert"));
    byId("alerts-button").classList.toggle("alarm", alerts.length > 0);
    const lines = alerts.slice(-100).reverse();
    const rows = lines.map(({ t, text }) =>
      el(
        "li",
        {},
        el("button", { type: "button", class: "when", title: "Look at this moment", onclick: () => this.world.lookAt(t) }, showTime(t)),
        el("span", {}, text),
      ),
    );
    this.list.replaceChildren(...(rows.length ? rows : [el("li", {}, "No alerts.")]));
  }

  #toggle() {
    const box = byId("alert-box");
    box.hidden = !box.hidden;
    byId("alerts-button").setAttribute("aria-expanded", String(!box.hidden));
    if (!box.hidden) this.host.replaceChildren();
    (box.hidden ? byId("alerts-button") : byId("alerts-close")).focus();
  }
}
