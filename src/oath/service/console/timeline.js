import { byId, setAttribute, setText } from "./dom.js";
import { plural, showTime } from "./format.js";
import { Plot } from "./plot.js";
import { countUntil } from "./history.js";

/** The mission's course: a plot of its progress that is also the way into the past. */
export class Timeline {
  /** @param {import("./world.js").World} world */
  constructor(world) {
    this.world = world;
    this.slider = byId("scrub");
    this.plot = new Plot(this.slider, world);
    this.playing = 0;
    this.slider.addEventListener("pointerdown", (event) => {
      this.slider.setPointerCapture(event.pointerId);
      this.#scrub(event);
    });
    this.slider.addEventListener("pointermove", (event) => {
      if (this.slider.hasPointerCapture(event.pointerId)) this.#scrub(event);
    });
    this.slider.addEventListener("keydown", (event) => this.#key(event));
    byId("earlier").addEventListener("click", () => this.step(-1));
    byId("later").addEventListener("click", () => this.step(1));
    byId("replay").addEventListener("click", () => this.togglePlay());
    byId("to-live").addEventListener("click", () => this.returnToLive());
    for (const topic of /** @type {const} */ (["state", "events", "view"])) world.on(topic, () => this.#show());
    this.#show();
  }

  /** @param {PointerEvent} event */
  #scrub(event) {
    this.stop();
    const box = this.slider.getBoundingClientRect();
    const t = this.plot.timeAt(event.clientX - box.left);
    if (t >= this.world.t) this.world.returnToLive();
    else this.world.lookAt(t);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const steps = /** @type {Record<string, number>} */ ({ ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 });
    if (event.key in steps) this.#go(this.world.time + steps[event.key]);
    else if (event.key === "Home") this.#go(0);
    else if (event.key === "End") this.returnToLive();
    else return;
    event.preventDefault();
  }

  /** @param {number} t [s] */
  #go(t) {
    this.stop();
    if (t >= this.world.t) this.world.returnToLive();
    else this.world.lookAt(t);
  }

  /** Look at the event before or after what is looked at. @param {-1 | 1} way */
  step(way) {
    const { notable } = this.world.history;
    const until = countUntil(notable, this.world.time, (event) => event.t);
    if (way > 0) {
      const next = notable[until];
      return next ? this.#go(next.t) : this.returnToLive();
    }
    let i = until - 1;
    while (i >= 0 && notable[i].t >= this.world.time - 1e-9) i--;
    return this.#go(i >= 0 ? notable[i].t : 0);
  }

  /** Let the past run, or hold it; from the present it starts at the beginning. */
  togglePlay() {
    if (this.playing) return this.stop();
    if (!this.world.past) this.world.lookAt(0);
    let before = performance.now();
    const run = (/** @type {number} */ now) => {
      const t = this.world.time + ((now - before) / 1000) * Math.max(1, this.world.clock.speed);
      before = now;
      if (!this.world.past || t >= this.world.t) return this.returnToLive();
      this.playing = requestAnimationFrame(run);
      return this.world.lookAt(t);
    };
    this.playing = requestAnimationFrame(run);
    return this.#show();
  }

  /** Hold the past where it is. */
  stop() {
    cancelAnimationFrame(this.playing);
    this.playing = 0;
  }

  /** Look at what is now. */
  returnToLive() {
    this.stop();
    this.world.returnToLive();
  }

  #show() {
    const { past, history, shown, time } = this.world;
    const done = countUntil(history.done, time, (t) => t);
    document.body.classList.toggle("past", past !== null);
    byId("past-banner").hidden = past === null;
    if (past) setText(byId("past-time"), showTime(past.t));
    byId("replay").setAttribute("aria-pressed", String(this.playing !== 0));
    setAttribute(this.slider, "aria-valuemax", this.world.t.toFixed(1));
    setAttribute(this.slider, "aria-valuenow", time.toFixed(1));
    const where = past ? showTime(time) : `live, ${showTime(time)}`;
    setAttribute(this.slider, "aria-valuetext", `${where}, ${done} of ${plural(shown.tasks.length, "task")} done`);
    this.plot.touch();
  }
}
