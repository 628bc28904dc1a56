/**
 * @typedef {object} Move one straight drive of a robot
 * @property {number} start [s] @property {number} end [s]
 * @property {[number, number]} from [m] @property {[number, number]} to [m]
 */

/** Moves of each robot that are kept at least; a shift of eight hours has more. */
const KEPT = 4000;

/** Everything that has happened, as the console needs it: by sequence, by robot, by time. */
export class History {
  constructor() {
    this.clear();
  }

  /** Forget everything. */
  clear() {
    /** Mission clock of every event by its sequence [s]. @type {number[]} */
    this.times = [];
    /** All events but single moves and plans, oldest first. @type {any[]} */
    this.notable = [];
    /** Times at which a task was done [s]. @type {number[]} */
    this.done = [];
    /** @type {Map<string, Move[]>} */
    this.moves = new Map();
    /** Robots whose first moves are forgotten. @type {Set<string>} */
    this.cut = new Set();
  }

  /** Sequence of the last event; -1: none. */
  get last() {
    return this.times.length - 1;
  }

  /** @param {any[]} events in order; those known already are skipped @returns {any[]} new ones */
  add(events) {
    const fresh = events.filter((event) => event.seq > this.last);
    for (const event of fresh) {
      this.times[event.seq] = event.t;
      if (event.type === "moved") this.#move(event);
      else if (event.type !== "planned") this.notable.push(event);
      if (event.type === "stop_served" && event.stop !== "pickup") this.done.push(event.t);
    }
    return fresh;
  }

  /** @param {any} event */
  #move({ robot, start, end, from, to }) {
    const moves = this.moves.get(robot);
    if (moves) moves.push({ start, end, from, to });
    else this.moves.set(robot, [{ start, end, from, to }]);
    if (moves && moves.length > 2 * KEPT) {
      moves.splice(0, KEPT);
      this.cut.add(robot);
    }
  }

  /** @param {number} t [s] @returns {number} sequence of the last event at or before t; >= 0 */
  seqAt(t) {
    return Math.max(0, countUntil(this.times, t, (time) => time) - 1);
  }

  /**
   * Where a robot was.
   * @param {string} robot @param {number} t [s]
   * @returns {{at: [number, number], heading: number | null} | null} null: no move of then is known
   */
  poseAt(robot, t) {
    const moves = this.moves.get(robot);
    if (!moves?.length) return null;
    const begun = countUntil(moves, t, (move) => move.start);
    if (begun === 0) return this.cut.has(robot) ? null : { at: moves[0].from, heading: null };
    const { start, end, from, to } = moves[begun - 1];
    const part = end > start ? Math.min(1, (t - start) / (end - start)) : 1;
    const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    return { at: [from[0] + part * dx, from[1] + part * dy], heading: Math.atan2(dy, dx) };
  }

  /** @param {string} robot @param {number} t [s] @param {number} most @returns {Move[]} the last ones */
  movesUntil(robot, t, most) {
    const moves = this.moves.get(robot) ?? [];
    const begun = countUntil(moves, t, (move) => move.start);
    return moves.slice(Math.max(0, begun - most), begun);
  }
}

/**
 * How many of the sorted items lie at or before a value.
 * @template T
 * @param {T[]} items @param {number} value @param {(item: T) => number} key @returns {number}
 */
export function countUntil(items, value, key) {
  let [low, high] = [0, items.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (key(items[middle]) <= value) low = middle + 1;
    else high = middle;
  }
  return low;
}
