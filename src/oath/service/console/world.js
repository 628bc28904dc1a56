import { get } from "./api.js";
import { History } from "./history.js";

/**
 * @typedef {object} Robot a robot of a snapshot
 * @property {string} id @property {[number, number]} position [m] @property {number} heading [rad]
 * @property {"idle" | "driving" | "serving" | "paused" | "failed"} status
 * @property {string[]} carrying @property {{task: string, stop: string, at: [number, number]}[]} route
 * @property {[number, number][]} path @property {number} seen [s] @property {number} driven [m]
 * @property {number} tasks
 *
 * @typedef {object} Task a task of a snapshot
 * @property {string} id @property {string} type @property {"low" | "normal" | "high"} priority
 * @property {"waiting" | "assigned" | "carried" | "done" | "stranded"} status
 * @property {string | null} robot @property {string | null} reason
 * @property {{name: string, at: [number, number], place: string | null, served: boolean}[]} stops
 *
 * @typedef {object} Snapshot
 * @property {number} seq @property {number} t [s] @property {boolean} finished
 * @property {{speed: number, paused: boolean}} clock @property {Robot[]} robots
 * @property {Task[]} tasks @property {any[]} obstacles @property {string | null} undo
 * @property {{t: number, text: string}[]} alerts
 *
 * @typedef {{kind: "robot" | "task" | "obstacle", id: string}} Thing
 * @typedef {"state" | "events" | "link" | "clock" | "view" | "select" | "poses"} Topic
 */

/** A robot that has not been heard of for longer is lost [s]. */
export const LOST = 3;

const TOO_MANY = 429;

const FIELDS = 4; // x, y, heading, age

/** What the console knows: the mission, its newest state, its history, and what is looked at. */
export class World {
  /** @param {any} mission @param {Snapshot} state @param {"operator" | "viewer"} role */
  constructor(mission, state, role) {
    this.mission = mission;
    this.role = role;
    /** The newest snapshot. */
    this.live = state;
    this.history = new History();
    /** The moment of the past that is looked at. @type {{t: number, seq: number, state: Snapshot} | null} */
    this.past = null;
    /** @type {{status: string, retryAt: number, lostAt: number}} */
    this.link = { status: "connecting", retryAt: 0, lostAt: 0 };
    /** @type {Thing | null} */
    this.selected = null;
    this.clock = state.clock;
    /** Index of every robot in `poses`, in the order of the mission. */
    this.index = new Map(mission.robots.map((/** @type {any} */ robot, /** @type {number} */ i) => [robot.id, i]));
    /** x, y [m], heading [rad], age [s] of each robot now. */
    this.poses = new Float32Array(mission.robots.length * FIELDS);
    this.before = new Float32Array(this.poses.length);
    this.after = new Float32Array(this.poses.length);
    /** @type {number[]} */
    this.order = mission.robots.map((/** @type {any} */ _, /** @type {number} */ i) => i);
    this.arrived = 0;
    this.interval = 100;
    this.t = state.t;
    /** @type {Map<Topic, ((data?: any) => void)[]>} */
    this.listeners = new Map();
    this.wanted = -1;
    this.fetching = false;
    this.#posesOf(state, this.after);
    this.poses.set(this.after);
    this.before.set(this.after);
  }

  /** The snapshot that is looked at: the newest, or one of the past. */
  get shown() {
    return this.past?.state ?? this.live;
  }

  /** The mission clock that is looked at [s]. */
  get time() {
    return this.past?.t ?? this.t;
  }

  /** Whether the user may change things now. */
  get acts() {
    return this.role === "operator" && !this.past && this.link.status === "live";
  }

  /** @param {Topic} topic @param {(data?: any) => void} listener */
  on(topic, listener) {
    const listeners = this.listeners.get(topic) ?? [];
    this.listeners.set(topic, [...listeners, listener]);
  }

  /** @param {Topic} topic @param {any} [data] */
  emit(topic, data) {
    for (const listener of this.listeners.get(topic) ?? []) listener(data);
  }

  /** @param {Thing | null} thing @param {boolean} [centre] whether the map goes there */
  select(thing, centre = false) {
    this.selected = thing;
    this.emit("select", { thing, centre });
  }

  /** @param {any} message a text frame of the live connection */
  receive(message) {
    if (message.type === "hello") this.#greet(message);
    else if (message.type === "events") this.#happened(message.events);
    else if (message.type === "state") this.#changed(message.state);
    else if (message.type === "clock") this.#ticks(message);
  }

  /** @param {any} hello */
  #greet({ seq, robots }) {
    this.order = robots.map((/** @type {string} */ id) => this.index.get(id) ?? -1);
    if (seq < this.history.last) location.reload(); // another mission runs there now
  }

  /** @param {any[]} events */
  #happened(events) {
    const fresh = this.history.add(events);
    if (fresh.length) this.emit("events", fresh);
  }

  /** @param {Snapshot} state */
  #changed(state) {
    this.live = state;
    this.clock = state.clock;
    if (!this.arrived) this.t = state.t;
    if (!this.past) this.emit("state");
    this.emit("clock");
  }

  /** @param {{speed: number, paused: boolean}} clock */
  #ticks({ speed, paused }) {
    this.clock = { speed, paused };
    this.emit("clock");
  }

  /** @param {{status: string, retryAt: number}} link */
  setLink({ status, retryAt }) {
    const lostAt = status === "live" ? 0 : this.link.lostAt || performance.now();
    this.link = { status, retryAt, lostAt };
    this.emit("link");
  }

  /** @param {DataView} frame poses at 10 Hz: float64 t, then x, y, heading, age of each robot */
  receivePoses(frame) {
    const now = performance.now();
    this.#interpolate(now, true);
    this.before.set(this.poses);
    this.t = frame.getFloat64(0, true);
    this.order.forEach((target, i) => {
      if (target < 0 || 8 + 16 * (i + 1) > frame.byteLength) return;
      for (let k = 0; k < FIELDS; k++) {
        this.after[target * FIELDS + k] = frame.getFloat32(8 + 16 * i + 4 * k, true);
      }
    });
    this.interval = Math.min(250, Math.max(50, now - this.arrived));
    this.arrived = now;
    this.emit("poses");
  }

  /** Bring `poses` to this moment. @param {number} now [ms] @param {boolean} smooth @returns {boolean} whether robots still move */
  advance(now, smooth) {
    if (this.past) {
      this.#posesOf(this.past.state, this.poses, this.past.t);
      return false;
    }
    return this.#interpolate(now, smooth);
  }

  /** @param {number} now @param {boolean} smooth @returns {boolean} */
  #interpolate(now, smooth) {
    const part = smooth ? Math.min(1, (now - this.arrived) / this.interval) : 1;
    const { poses, before, after } = this;
    for (let i = 0; i < poses.length; i += FIELDS) {
      poses[i] = before[i] + part * (after[i] - before[i]);
      poses[i + 1] = before[i + 1] + part * (after[i + 1] - before[i + 1]);
      const turn = after[i + 2] - before[i + 2];
      poses[i + 2] = before[i + 2] + part * Math.atan2(Math.sin(turn), Math.cos(turn));
      poses[i + 3] = after[i + 3];
    }
    if (this.link.lostAt) {
      const lost = (now - this.link.lostAt) / 1000;
      for (let i = 3; i < poses.length; i += FIELDS) poses[i] += lost;
    }
    return part < 1;
  }

  /** @param {Snapshot} state @param {Float32Array} target @param {number} [t] a moment of the past [s] */
  #posesOf(state, target, t) {
    for (const robot of state.robots) {
      const i = (this.index.get(robot.id) ?? -1) * FIELDS;
      if (i < 0) continue;
      const then = t === undefined ? null : this.history.poseAt(robot.id, t);
      target.set(then?.at ?? robot.position, i);
      target[i + 2] = then?.heading ?? robot.heading;
      target[i + 3] = 0;
    }
  }

  /** @param {string} id @returns {{x: number, y: number, heading: number, age: number}} of a robot now */
  pose(id) {
    const i = (this.index.get(id) ?? 0) * FIELDS;
    const [x, y, heading, age] = this.poses.subarray(i, i + FIELDS);
    return { x, y, heading, age };
  }

  /** Look at a moment of the past. @param {number} t [s] */
  lookAt(t) {
    const clamped = Math.max(0, Math.min(t, this.t));
    this.past = { seq: this.live.seq, state: this.live, ...this.past, t: clamped };
    this.wanted = this.history.seqAt(clamped);
    this.emit("view");
    this.#fetchPast();
  }

  /** Look at what is now. */
  returnToLive() {
    if (!this.past) return;
    this.past = null;
    this.wanted = -1;
    this.emit("view");
    this.emit("state");
  }

  /** Get the snapshot that is wanted; one request at a time, the latest wish wins. */
  async #fetchPast() {
    if (this.fetching) return;
    this.fetching = true;
    while (this.past && this.past.seq !== this.wanted) {
      const seq = this.wanted;
      try {
        const state = await get(`/api/state?seq=${seq}`);
        if (this.past) this.past = { ...this.past, seq, state };
        if (this.past) this.emit("state");
      } catch (error) {
        if (error.status !== TOO_MANY) this.returnToLive();
        await new Promise((resume) => setTimeout(resume, 300));
      }
    }
    this.fetching = false;
  }
}
