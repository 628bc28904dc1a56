import { post } from "./api.js";
import { byId, el, setAttribute, setIcon, setText } from "./dom.js";
import { showAge, showLength, showTime } from "./format.js";
import { messageOf } from "./chat.js";

const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 20, 50];

/** The bar above the map: connection, mission clock, figures. */
export class Bar {
  /** @param {import("./world.js").World} world @param {(text: string, alarm?: boolean) => void} tell */
  constructor(world, tell) {
    this.world = world;
    this.tell = tell;
    this.speed = /** @type {HTMLSelectElement} */ (byId("speed"));
    setText(byId("mission"), world.mission.name);
    document.title = `${world.mission.name} – OATH`;
    document.body.dataset.role = world.role;
    byId("hold").addEventListener("click", () => this.hold());
    byId("step").addEventListener("click", () => this.setClock({ step: true }));
    byId("finish").addEventListener("click", () => this.#finish());
    this.speed.addEventListener("change", () => this.setClock({ speed: Number(this.speed.value) }));
    world.on("clock", () => this.#clock());
    world.on("link", () => this.#link());
    for (const topic of /** @type {const} */ (["state", "view"])) world.on(topic, () => this.#figures());
    for (const topic of /** @type {const} */ (["view", "poses"])) world.on(topic, () => this.#time());
    this.#clock();
    this.#figures();
    this.#time();
  }

  /** Hold the mission clock, or let it run. */
  hold() {
    this.setClock({ paused: !this.world.clock.paused });
  }

  /** @param {{speed?: number, paused?: boolean, step?: boolean}} change */
  async setClock(change) {
    if (this.world.role !== "operator") return;
    try {
      this.world.receive({ type: "clock", ...(await post("/api/clock", change)) });
    } catch (error) {
      this.tell(messageOf(error), true);
    }
  }

  #finish() {
    const dialog = /** @type {HTMLDialogElement} */ (byId("finish-dialog"));
    dialog.returnValue = "";
    dialog.showModal();
    dialog.onclose = () => {
      if (dialog.returnValue === "yes") post("/api/finish", {}).catch((error) => this.tell(messageOf(error), true));
    };
  }

  #time() {
    setText(byId("time"), showTime(this.world.time));
  }

  #clock() {
    const { paused, speed } = this.world.clock;
    const hold = byId("hold");
    setIcon(/** @type {Element} */ (hold.firstElementChild), paused ? "play" : "pause");
    setAttribute(hold, "aria-label", paused ? "Let the clock run" : "Hold the clock");
    setAttribute(hold, "title", `${paused ? "Let the clock run" : "Hold the clock"} (space)`);
    const speeds = SPEEDS.includes(speed) ? SPEEDS : [...SPEEDS, speed].sort((a, b) => a - b);
    if (this.speed.children.length !== speeds.length) {
      this.speed.replaceChildren(...speeds.map((one) => el("option", { value: one }, `${one}×`)));
    }
    if (document.activeElement !== this.speed) this.speed.value = String(speed);
    byId("clock").classList.toggle("held", paused);
    setText(byId("clock-note"), this.world.live.finished ? "finished" : paused ? "held" : "");
  }

  #link() {
    const { status, retryAt, lostAt } = this.world.link;
    const node = byId("link");
    node.dataset.status = status;
    const wait = Math.max(0, Math.ceil((retryAt - performance.now()) / 1000));
    const age = showAge((performance.now() - lostAt) / 1000);
    const texts = /** @type {Record<string, string>} */ ({
      live: "Live",
      connecting: "Connecting …",
      lost: "Connection lost",
      refused: "Signed out",
    });
    setText(byId("link-text"), texts[status]);
    byId("lost-banner").hidden = status === "live" || status === "connecting";
    setText(byId("lost-text"), status === "refused"
      ? "The server has a new token. Open the link that it printed at its start."
      : "Connection lost. What you see is as it was last known.");
    setText(byId("lost-age"), status === "refused" ? "" : `${age} ago${wait ? `, next try in ${wait} s` : ", trying"}`);
    byId("retry").hidden = status === "refused";
  }

  #figures() {
    const { shown, role } = this.world;
    const count = (/** @type {string} */ status) => shown.tasks.filter((task) => task.status === status).length;
    const driven = shown.robots.reduce((sum, robot) => sum + robot.driven, 0);
    setText(byId("figure-done"), `${count("done")} / ${shown.tasks.length}`);
    setText(byId("figure-open"), String(count("waiting") + count("assigned")));
    setText(byId("figure-carried"), String(count("carried")));
    setText(byId("figure-stranded"), String(count("stranded")));
    byId("figure-stranded").classList.toggle("alarm", count("stranded") > 0);
    setText(byId("figure-driven"), showLength(driven));
    byId("viewer-note").hidden = role !== "viewer";
    setText(byId("clock-note"), this.world.live.finished ? "finished" : this.world.clock.paused ? "held" : "");
  }
}
