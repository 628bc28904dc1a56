import { showTime } from "./format.js";
import { colour } from "./theme.js";
import { kindOf } from "./words.js";

/** Room around the plot [px]. */
const EDGE = { left: 34, right: 14, top: 8, bottom: 30 };

/** Kinds of events that stand below the plot. */
const MARKED = ["tasks", "obstacles", "robots", "commands"];

/** While it is live it is painted at most so often [ms]. */
const LIVE_EVERY = 500;

/** The plot's own moments: routine deliveries are its steps already. */
const ROUTINE = new Set(["stop_served"]);

/** Tasks done over time, and what happened meanwhile. */
export class Plot {
  /** @param {HTMLElement} host @param {import("./world.js").World} world */
  constructor(host, world) {
    this.host = host;
    this.world = world;
    const canvas = document.createElement("canvas");
    canvas.setAttribute("aria-hidden", "true");
    host.append(canvas);
    this.g = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    this.asked = 0;
    this.paintedAt = 0;
    new ResizeObserver(() => this.#resize()).observe(host);
    this.#resize();
  }

  #resize() {
    const ratio = devicePixelRatio || 1;
    this.box = { width: this.host.clientWidth, height: this.host.clientHeight };
    this.g.canvas.width = Math.round(this.box.width * ratio);
    this.g.canvas.height = Math.round(this.box.height * ratio);
    this.g.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.paint();
  }

  /** Paint it anew, at once while the past is looked at, else a little later. */
  touch() {
    if (this.asked) return;
    const wait = this.world.past ? 0 : this.paintedAt + LIVE_EVERY - performance.now();
    this.asked = setTimeout(() => requestAnimationFrame(() => this.paint()), Math.max(0, wait));
  }

  /** The end of the time axis [s]. */
  get span() {
    return Math.max(10, this.world.t * 1.02);
  }

  get width() {
    return this.box.width - EDGE.left - EDGE.right;
  }

  /** @param {number} px from the left @returns {number} [s] */
  timeAt(px) {
    return Math.max(0, ((px - EDGE.left) / this.width) * this.span);
  }

  /** @param {number} t [s] @returns {number} from the left [px] */
  xAt(t) {
    return EDGE.left + (t / this.span) * this.width;
  }

  /** Paint it. */
  paint() {
    this.asked = 0;
    this.paintedAt = performance.now();
    const { g } = this;
    const { width, height } = this.box;
    g.clearRect(0, 0, width, height);
    const floor = height - EDGE.bottom;
    const total = this.world.live.tasks.length || 1;
    const y = (/** @type {number} */ n) => floor - (n / total) * (floor - EDGE.top);
    this.#axes(floor, y(total), total);
    this.#steps(floor, y);
    this.#marks(floor + 9);
    this.#head(floor);
  }

  /** @param {number} floor @param {number} top @param {number} total */
  #axes(floor, top, total) {
    const { g } = this;
    g.font = "11px system-ui, sans-serif";
    g.fillStyle = colour("muted");
    g.strokeStyle = colour("line");
    g.lineWidth = 1;
    g.beginPath();
    for (const at of [floor + 0.5, Math.round(top) + 0.5]) {
      g.moveTo(EDGE.left, at);
      g.lineTo(EDGE.left + this.width, at);
    }
    g.stroke();
    g.textAlign = "right";
    g.textBaseline = "middle";
    g.fillText(String(total), EDGE.left - 6, top + 3);
    g.fillText("0", EDGE.left - 6, floor);
    g.textAlign = "center";
    g.textBaseline = "bottom";
    const step = tick(this.span, this.width);
    for (let t = 0; this.xAt(t) < EDGE.left + this.width - 12; t += step) {
      g.fillText(t ? showTime(t).replace(/\.0/, "") : "0", this.xAt(t), floor + EDGE.bottom - 1);
    }
  }

  /** @param {number} floor @param {(n: number) => number} y */
  #steps(floor, y) {
    const { g, world } = this;
    const { done } = world.history;
    g.beginPath();
    g.moveTo(this.xAt(0), floor);
    done.forEach((t, i) => {
      g.lineTo(this.xAt(t), y(i));
      g.lineTo(this.xAt(t), y(i + 1));
    });
    g.lineTo(this.xAt(world.t), y(done.length));
    g.strokeStyle = g.fillStyle = colour("accent");
    g.lineWidth = 1.75;
    g.stroke();
    g.lineTo(this.xAt(world.t), floor);
    g.globalAlpha = 0.12;
    g.fill();
    g.globalAlpha = 1;
  }

  /** @param {number} y */
  #marks(y) {
    const { g, world } = this;
    let before = -9;
    for (const event of world.history.notable) {
      const kind = kindOf(event);
      if (ROUTINE.has(event.type) || !MARKED.includes(kind)) continue;
      const x = this.xAt(event.t);
      if (x - before < 3) continue;
      before = x;
      g.fillStyle = g.strokeStyle = colour(kind === "obstacles" || kind === "robots" ? "alarm" : "text");
      shape(g, x, y, kind);
    }
  }

  /** The line at what is looked at. @param {number} floor */
  #head(floor) {
    const { g, world } = this;
    const x = this.xAt(world.time);
    g.strokeStyle = g.fillStyle = colour(world.past ? "past" : "accent");
    g.lineWidth = 2;
    g.beginPath();
    g.moveTo(x, EDGE.top - 4);
    g.lineTo(x, floor + 3);
    g.stroke();
    g.beginPath();
    g.arc(x, EDGE.top - 2, 4, 0, 2 * Math.PI);
    g.fill();
  }
}

/** @param {CanvasRenderingContext2D} g @param {number} x @param {number} y @param {string} kind */
function shape(g, x, y, kind) {
  g.lineWidth = 1.5;
  g.beginPath();
  if (kind === "tasks") g.arc(x, y, 3, 0, 2 * Math.PI);
  else if (kind === "obstacles") {
    g.moveTo(x, y - 4);
    g.lineTo(x + 4, y + 3);
    g.lineTo(x - 4, y + 3);
    g.closePath();
  } else if (kind === "robots") g.rect(x - 3, y - 3, 6, 6);
  else {
    g.moveTo(x, y - 4);
    g.lineTo(x + 4, y);
    g.lineTo(x, y + 4);
    g.lineTo(x - 4, y);
    g.closePath();
  }
  g.fill();
}

/** @param {number} span [s] @param {number} width [px] @returns {number} between two labels [s] */
function tick(span, width) {
  const steps = [1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 28800];
  return steps.find((step) => (step / span) * width >= 64) ?? 86400;
}
