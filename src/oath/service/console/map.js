import { get } from "./api.js";
import { Camera } from "./camera.js";
import { Ground } from "./ground.js";
import { markOf, paintPlans } from "./plans.js";
import { CROWD, paintRobots, sizeOf } from "./robots.js";
import { calm } from "./theme.js";

/** Plans and tasks are painted anew at most so often [ms]; robots in every frame. */
const PLANS_EVERY = 200;

/**
 * The live map: three canvases, from what seldom changes to what always does. Each is painted only
 * when something on it has changed.
 */
export class LiveMap {
  /** @param {HTMLElement} host @param {import("./world.js").World} world */
  constructor(host, world) {
    this.host = host;
    this.world = world;
    this.camera = new Camera(world.mission.bounds);
    this.ground = new Ground(world.mission);
    const few = world.mission.robots.length <= CROWD;
    this.shows = { roadmap: null, trails: few, paths: few, labels: few };
    this.follows = false;
    /** Paints on top what a tool is drawing. @type {((g: CanvasRenderingContext2D, camera: Camera) => void) | null} */
    this.sketch = null;
    this.dirty = { ground: true, plans: true, robots: true };
    this.plansAt = 0;
    this.asked = 0;
    /** Frames painted so far. */
    this.frames = 0;
    this.layers = [false, true, true].map((alpha) => {
      const canvas = document.createElement("canvas");
      canvas.setAttribute("aria-hidden", "true");
      host.append(canvas);
      return /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d", { alpha }));
    });
    new ResizeObserver(() => this.#resize()).observe(host);
    this.#resize();
    for (const topic of /** @type {const} */ (["state", "events", "view", "select", "link"])) {
      world.on(topic, () => this.touch("plans"));
    }
    world.on("poses", () => this.touch("robots"));
    world.on("select", ({ thing, centre }) => centre && this.centreOn(thing));
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.host;
    const ratio = devicePixelRatio || 1;
    for (const { canvas } of this.layers) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    this.ratio = ratio;
    this.camera.resize(width, height);
    this.touch("ground");
    this.#frame(performance.now());
  }

  /** Something has changed on a layer, and so on all above it. @param {"ground" | "plans" | "robots"} layer */
  touch(layer) {
    this.dirty[layer] = true;
    if (layer === "ground") this.dirty.plans = true;
    this.dirty.robots = true;
    if (!this.asked) this.asked = requestAnimationFrame((now) => this.#frame(now));
  }

  /** @param {number} now [ms] */
  #frame(now) {
    this.asked = 0;
    const moves = this.world.advance(performance.now(), !calm());
    const { selected } = this.world;
    if (this.follows && selected?.kind === "robot") this.#keepUp(selected.id);
    if (this.dirty.ground) {
      this.#paint(0, (g) => this.ground.paint(g, this.camera));
      this.plansAt = 0;
    }
    const due = this.world.past || now - this.plansAt >= PLANS_EVERY;
    if (this.dirty.plans && due) {
      this.#paint(1, (g) => paintPlans(g, this.camera, this.world, this.shows));
      this.plansAt = now;
      this.dirty.plans = false;
    }
    this.#paint(2, (g) => {
      paintRobots(g, this.camera, this.world);
      this.sketch?.(g, this.camera);
    });
    this.frames += 1;
    this.dirty.ground = this.dirty.robots = false;
    if (moves || this.dirty.plans) this.asked = requestAnimationFrame((then) => this.#frame(then));
  }

  /** @param {number} layer @param {(g: CanvasRenderingContext2D) => void} paint */
  #paint(layer, paint) {
    const g = this.layers[layer];
    g.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    g.clearRect(0, 0, this.camera.width, this.camera.height);
    paint(g);
  }

  /** @param {string} robot */
  #keepUp(robot) {
    const { x, y } = this.world.pose(robot);
    if (Math.hypot(x - this.camera.x, y - this.camera.y) * this.camera.scale < 0.5) return;
    this.camera.centre(x, y);
    this.dirty.ground = this.dirty.plans = true;
  }

  /** Pan or zoom. @param {(camera: Camera) => void} change */
  move(change) {
    change(this.camera);
    this.touch("ground");
  }

  /** @param {import("./world.js").Thing | null} thing */
  centreOn(thing) {
    const at = thing && this.#whereIs(thing);
    if (at) this.move((camera) => camera.centre(at[0], at[1]));
  }

  /** @param {import("./world.js").Thing} thing @returns {readonly number[] | undefined} */
  #whereIs({ kind, id }) {
    const { shown } = this.world;
    if (kind === "robot") {
      const { x, y } = this.world.pose(id);
      return [x, y];
    }
    if (kind === "task") {
      const task = shown.tasks.find((one) => one.id === id);
      return task && markOf(task).at;
    }
    return shown.obstacles.find((one) => one.id === id)?.polygon[0];
  }

  /** @param {number} px @param {number} py @returns {import("./world.js").Thing | null} what is drawn there */
  hit(px, py) {
    const { shown, mission, index } = this.world;
    const near = (/** @type {readonly number[]} */ at, /** @type {number} */ reach) => {
      const [x, y] = this.camera.toScreen(at[0], at[1]);
      return Math.hypot(x - px, y - py) <= reach;
    };
    for (const { id } of shown.robots) {
      const { x, y } = this.world.pose(id);
      const radius = mission.robots[index.get(id) ?? 0].radius;
      if (near([x, y], sizeOf(this.camera.scale, radius) + 4)) return { kind: "robot", id };
    }
    const task = shown.tasks.find((one) => one.status !== "done" && near(markOf(one).at, 12));
    if (task) return { kind: "task", id: task.id };
    const at = this.camera.toWorld(px, py);
    const obstacle = shown.obstacles.find((one) => inside(at, one.polygon));
    return obstacle ? { kind: "obstacle", id: obstacle.id } : null;
  }

  /** Show or hide the roadmap; it is fetched when first wanted. @returns {Promise<boolean>} whether it shows */
  async toggleRoadmap() {
    this.roadmap ??= await get("/api/roadmap");
    this.shows.roadmap = this.shows.roadmap ? null : this.roadmap;
    this.touch("plans");
    return this.shows.roadmap !== null;
  }
}

/** @param {readonly number[]} at @param {number[][]} polygon @returns {boolean} */
function inside([x, y], polygon) {
  let within = false;
  for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i++) {
    const [[xi, yi], [xj, yj]] = [polygon[i], polygon[j]];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) within = !within;
  }
  return within;
}
