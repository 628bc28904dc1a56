import { byId, el, setText } from "./dom.js";
import { paintLabel } from "./plans.js";
import { trace } from "./ground.js";
import { colour } from "./theme.js";

/** @typedef {[number, number]} Point */
/** @typedef {"obstacle" | "task"} Tool */

/** Clicks this near to the first corner close the polygon [px]. */
const NEAR = 12;

/**
 * Tools that draw on the map: an obstacle by its corners, a task by its pickup and delivery. The
 * same points may be typed, so that no pointer is needed.
 */
export class Draw {
  /**
   * @param {import("./map.js").LiveMap} map
   * @param {(commands: {intent: string, parameters: object}[], words: string, edit: () => void) => void} ask
   */
  constructor(map, ask) {
    this.map = map;
    this.ask = ask;
    /** @type {Tool | null} */
    this.tool = null;
    /** @type {Point | null} */
    this.hovered = null;
    this.form = /** @type {HTMLFormElement} */ (byId("draw"));
    this.kind = field("draw-kind");
    this.corners = field("draw-corners");
    this.pickup = field("draw-pickup");
    this.delivery = field("draw-delivery");
    this.type = field("draw-type");
    const { places, task_types: types } = map.world.mission;
    byId("places").append(...Object.keys(places).map((name) => el("option", { value: name })));
    this.type.append(...types.map((/** @type {string} */ name) => el("option", { value: name }, name)));
    byId("tool-obstacle").addEventListener("click", () => this.toggle("obstacle"));
    byId("tool-task").addEventListener("click", () => this.toggle("task"));
    byId("draw-cancel").addEventListener("click", () => this.close());
    byId("draw-back").addEventListener("click", () => this.back());
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.submit();
    });
    this.form.addEventListener("input", () => this.#changed());
  }

  /** @param {Tool} tool */
  toggle(tool) {
    if (this.tool === tool) this.close();
    else this.open(tool);
  }

  /** @param {Tool} tool */
  open(tool) {
    if (!this.map.world.acts) return;
    this.tool = tool;
    this.form.hidden = false;
    for (const part of this.form.querySelectorAll("[data-tool]")) {
      if (part instanceof HTMLElement) part.hidden = part.dataset.tool !== tool;
    }
    setText(byId("draw-title"), tool === "obstacle" ? "Obstacle" : "Task");
    this.map.host.classList.add("drawing");
    this.map.sketch = (g, camera) => this.#paint(g, camera);
    this.#press();
    this.#changed();
    (tool === "obstacle" ? this.corners : this.pickup).focus({ preventScroll: true });
  }

  /** Put the tool away; nothing happens. */
  close() {
    this.#away();
    this.form.reset();
  }

  #away() {
    const held = this.form.contains(document.activeElement);
    this.tool = null;
    this.form.hidden = true;
    this.map.host.classList.remove("drawing");
    this.map.sketch = null;
    this.#press();
    this.map.touch("robots");
    if (held) this.map.host.focus();
  }

  #press() {
    for (const tool of ["obstacle", "task"]) {
      byId(`tool-${tool}`).setAttribute("aria-pressed", String(this.tool === tool));
    }
  }

  /** A click on the map while a tool is open. @param {number} px @param {number} py */
  click(px, py) {
    const at = snapped(this.map.camera.toWorld(px, py), this.map.camera.scale);
    if (this.tool === "obstacle") {
      const points = this.#points();
      const first = points.length > 2 && this.map.camera.toScreen(...points[0]);
      if (first && Math.hypot(first[0] - px, first[1] - py) < NEAR) return this.submit();
      this.corners.value = [...points, at].map(write).join(", ");
    } else if (!this.pickup.value.trim()) this.pickup.value = write(at);
    else this.delivery.value = this.#placeNear(px, py) ?? write(at);
    return this.#changed();
  }

  /** @param {number} px @param {number} py */
  hover(px, py) {
    this.hovered = snapped(this.map.camera.toWorld(px, py), this.map.camera.scale);
    if (this.tool) this.map.touch("robots");
  }

  /** Take the last point back. */
  back() {
    if (this.tool === "obstacle") this.corners.value = this.#points().slice(0, -1).map(write).join(", ");
    else if (this.delivery.value) this.delivery.value = "";
    else this.pickup.value = "";
    this.#changed();
  }

  /** @param {number} px @param {number} py @returns {string | undefined} */
  #placeNear(px, py) {
    const { places } = this.map.world.mission;
    return Object.keys(places).find((name) => {
      const [x, y] = this.map.camera.toScreen(places[name][0], places[name][1]);
      return Math.hypot(x - px, y - py) < 18;
    });
  }

  /** @returns {Point[]} */
  #points() {
    return readPoints(this.corners.value);
  }

  #changed() {
    const ready = this.tool === "obstacle" ? this.#points().length > 1 : this.#errand() !== null;
    /** @type {HTMLButtonElement} */ (byId("draw-propose")).disabled = !ready;
    this.map.touch("robots");
  }

  /** @returns {{location: Point, delivery_point: string | Point} | null} null: not complete */
  #errand() {
    const [location] = readPoints(this.pickup.value);
    const there = this.delivery.value.trim();
    if (!location || !there) return null;
    const named = there in this.map.world.mission.places;
    const point = readPoints(there)[0];
    return named || point ? { location, delivery_point: named ? there : point } : null;
  }

  /** Ask for what was drawn. */
  submit() {
    const { tool } = this;
    const errand = this.#errand();
    const points = this.#points();
    const edit = () => tool && this.open(tool);
    if (tool === "obstacle" && points.length > 1) {
      const parameters = { obstacle_location: points, obstacle_type: this.kind.value.trim() || "wall" };
      const words = `${parameters.obstacle_type} drawn at ${points.map(write).join(", ")}`;
      this.ask([{ intent: "obstacle_update", parameters }], words, this.#kept(edit));
    } else if (tool === "task" && errand) {
      const parameters = { ...errand, task_type: this.type.value };
      const words = `${this.type.value} task drawn from ${this.pickup.value} to ${this.delivery.value}`;
      this.ask([{ intent: "add_task", parameters }], words, this.#kept(edit));
    } else return;
    this.close();
  }

  /** What reopens the tool with what it holds now. @param {() => void} open */
  #kept(open) {
    const fields = [this.kind, this.corners, this.pickup, this.delivery, this.type];
    const values = fields.map((one) => one.value);
    return () => {
      fields.forEach((one, i) => (one.value = values[i]));
      open();
    };
  }

  /** @param {CanvasRenderingContext2D} g @param {import("./camera.js").Camera} camera */
  #paint(g, camera) {
    g.strokeStyle = g.fillStyle = colour("accent");
    g.lineWidth = 2;
    if (this.tool === "obstacle") this.#paintCorners(g, camera);
    else this.#paintErrand(g, camera);
  }

  /** @param {CanvasRenderingContext2D} g @param {import("./camera.js").Camera} camera */
  #paintCorners(g, camera) {
    const points = this.#points();
    g.beginPath();
    trace(g, camera, points);
    if (points.length > 2) g.closePath();
    g.globalAlpha = 0.2;
    g.fill();
    g.globalAlpha = 1;
    g.stroke();
    points.forEach((point) => dot(g, camera, point));
    const last = points[points.length - 1];
    if (!this.hovered) return;
    if (last) {
      g.setLineDash([4, 4]);
      g.beginPath();
      trace(g, camera, [last, this.hovered]);
      g.stroke();
      g.setLineDash([]);
    }
    const [x, y] = camera.toScreen(...this.hovered);
    paintLabel(g, x + 4, y - 10, write(this.hovered));
  }

  /** @param {CanvasRenderingContext2D} g @param {import("./camera.js").Camera} camera */
  #paintErrand(g, camera) {
    const [from] = readPoints(this.pickup.value);
    const there = this.delivery.value.trim();
    const to = this.map.world.mission.places[there] ?? readPoints(there)[0];
    if (from && (to ?? this.hovered)) {
      g.setLineDash([4, 4]);
      g.beginPath();
      trace(g, camera, [from, to ?? this.hovered]);
      g.stroke();
      g.setLineDash([]);
    }
    for (const [point, label] of /** @type {[Point, string][]} */ ([[from, "pickup"], [to, "delivery"]])) {
      if (!point) continue;
      dot(g, camera, point);
      const [x, y] = camera.toScreen(...point);
      paintLabel(g, x, y - 12, label);
      g.fillStyle = colour("accent");
    }
  }
}

/** @param {string} id @returns {HTMLInputElement} */
function field(id) {
  return /** @type {HTMLInputElement} */ (byId(id));
}

/** @param {CanvasRenderingContext2D} g @param {import("./camera.js").Camera} camera @param {Point} point */
function dot(g, camera, point) {
  const [x, y] = camera.toScreen(...point);
  g.beginPath();
  g.arc(x, y, 4, 0, 2 * Math.PI);
  g.fill();
}

/** Read "7 5, 8 5" or "(7, 5) (8, 5)": every two numbers are a point. @param {string} text @returns {Point[]} */
export function readPoints(text) {
  const numbers = (text.match(/-?\d+(?:\.\d+)?/g) ?? []).map(Number);
  /** @type {Point[]} */
  const points = [];
  for (let i = 0; i + 1 < numbers.length; i += 2) points.push([numbers[i], numbers[i + 1]]);
  return points;
}

/** @param {Point} point */
function write([x, y]) {
  return `${x} ${y}`;
}

/** Round to what the pointer can hit. @param {Point} point @param {number} scale [px/m] @returns {Point} */
function snapped(point, scale) {
  const unit = scale > 60 ? 100 : 10;
  return [Math.round(point[0] * unit) / unit, Math.round(point[1] * unit) / unit];
}
