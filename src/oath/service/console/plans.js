import { trace } from "./ground.js";
import { colour, robotColour } from "./theme.js";

/** @typedef {CanvasRenderingContext2D} Context @typedef {import("./camera.js").Camera} Camera */
/** @typedef {import("./world.js").World} World @typedef {import("./world.js").Task} Task */

/** Longer rows of tasks are counted, not drawn. */
const ROW = 4;

/** Moves of a robot that its trail shows. */
const TRAIL = 24;

/**
 * Where a task is marked: at its next stop.
 * @param {Task} task @returns {{at: [number, number], stop: any}}
 */
export function markOf(task) {
  const stop = task.stops.find(({ served }) => !served) ?? task.stops[task.stops.length - 1];
  return { at: stop.at, stop };
}

/**
 * Paint what changes with events: roadmap, obstacles, trails, plans and tasks.
 * @param {Context} g @param {Camera} camera @param {World} world
 * @param {{roadmap: any, trails: boolean, paths: boolean, labels: boolean}} shows
 */
export function paintPlans(g, camera, world, shows) {
  const { robots, tasks, obstacles } = world.shown;
  if (shows.roadmap) paintRoadmap(g, camera, shows.roadmap);
  for (const obstacle of obstacles) paintObstacle(g, camera, obstacle, world.selected);
  for (const robot of robots) {
    const index = world.index.get(robot.id) ?? 0;
    const chosen = world.selected?.kind === "robot" && world.selected.id === robot.id;
    g.strokeStyle = robotColour(index);
    if (shows.trails || chosen) paintTrail(g, camera, world, robot.id, chosen ? 100000 : TRAIL);
    if (shows.paths || chosen) paintPath(g, camera, robot, world.pose(robot.id), chosen);
  }
  paintTasks(g, camera, world, tasks, shows.labels);
}

/** @param {Context} g @param {Camera} camera @param {{nodes: number[][], edges: number[][]}} roadmap */
function paintRoadmap(g, camera, { nodes, edges }) {
  g.strokeStyle = colour("muted");
  g.lineWidth = 0.5;
  g.globalAlpha = 0.3;
  g.beginPath();
  for (const [i, j] of edges) trace(g, camera, [nodes[i], nodes[j]]);
  g.stroke();
  g.globalAlpha = 1;
}

/** Known ones are plain, found ones striped, told ones dashed. @param {Context} g @param {Camera} camera @param {any} obstacle @param {any} selected */
function paintObstacle(g, camera, { id, polygon, source }, selected) {
  const strange = source !== "map";
  g.save();
  g.beginPath();
  trace(g, camera, polygon);
  g.closePath();
  g.fillStyle = colour(strange ? "alarm" : "wall");
  g.globalAlpha = strange ? 0.18 : 0.55;
  g.fill();
  g.globalAlpha = 1;
  if (strange) {
    g.strokeStyle = colour("alarm");
    g.lineWidth = 1.5;
    g.setLineDash(source === "told" ? [5, 3] : []);
    g.stroke();
    g.clip();
    if (source === "found") paintStripes(g, camera, polygon);
  }
  g.restore();
  if (selected?.kind === "obstacle" && selected.id === id) {
    g.beginPath();
    trace(g, camera, polygon);
    g.closePath();
    g.strokeStyle = colour("accent");
    g.lineWidth = 3;
    g.stroke();
  }
}

/** @param {Context} g @param {Camera} camera @param {number[][]} polygon */
function paintStripes(g, camera, polygon) {
  const points = polygon.map(([x, y]) => camera.toScreen(x, y));
  const [left, right] = [Math.min(...points.map(([x]) => x)), Math.max(...points.map(([x]) => x))];
  const [top, bottom] = [Math.min(...points.map(([, y]) => y)), Math.max(...points.map(([, y]) => y))];
  g.lineWidth = 1;
  g.setLineDash([]);
  g.beginPath();
  for (let x = left - (bottom - top); x < right; x += 6) {
    g.moveTo(x, bottom);
    g.lineTo(x + bottom - top, top);
  }
  g.stroke();
}

/** @param {Context} g @param {Camera} camera @param {World} world @param {string} id @param {number} most */
function paintTrail(g, camera, world, id, most) {
  const moves = world.history.movesUntil(id, world.time, most);
  if (!moves.length) return;
  const points = [moves[0].from, ...moves.map((move) => move.to)];
  const { x, y } = world.pose(id);
  if (moves[moves.length - 1].end > world.time) points.pop();
  points.push([x, y]);
  g.lineWidth = 2;
  g.globalAlpha = 0.3;
  g.beginPath();
  trace(g, camera, points);
  g.stroke();
  g.globalAlpha = 1;
}

/** @param {Context} g @param {Camera} camera @param {any} robot @param {{x: number, y: number}} pose @param {boolean} chosen */
function paintPath(g, camera, { path, route }, pose, chosen) {
  if (path.length > 1) {
    g.lineWidth = chosen ? 3 : 1.75;
    g.setLineDash([6, 4]);
    g.globalAlpha = 0.9;
    g.beginPath();
    trace(g, camera, ahead(path, pose));
    g.stroke();
  }
  if (chosen && route.length > 1) {
    g.lineWidth = 1;
    g.setLineDash([1, 4]);
    g.beginPath();
    trace(g, camera, route.map((/** @type {any} */ stop) => stop.at));
    g.stroke();
  }
  g.setLineDash([]);
  g.globalAlpha = 1;
}

/** What is left of a way: from the point that is nearest to the robot. @param {number[][]} path @param {{x: number, y: number}} pose @returns {number[][]} */
function ahead(path, { x, y }) {
  let [best, least] = [0, Infinity];
  for (let i = 0; i + 1 < path.length; i++) {
    const [[ax, ay], [bx, by]] = [path[i], path[i + 1]];
    const [dx, dy] = [bx - ax, by - ay];
    const part = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1);
    const on = Math.max(0, Math.min(1, part));
    const far = Math.hypot(ax + on * dx - x, ay + on * dy - y);
    if (far < least) [best, least] = [i, far];
  }
  return [[x, y], ...path.slice(best + 1)];
}

/** Tasks that go to the same point stand in a row above it. @param {Context} g @param {Camera} camera @param {World} world @param {Task[]} tasks @param {boolean} labels */
function paintTasks(g, camera, world, tasks, labels) {
  /** @type {Map<string, Task[]>} */
  const rows = new Map();
  for (const task of tasks) {
    const [x, y] = camera.toScreen(...markOf(task).at);
    if (task.status === "done") paintDone(g, camera, task);
    else if (task.status === "carried") {
      const key = markOf(task).at.join();
      rows.set(key, [...(rows.get(key) ?? []), task]);
    } else paintTask(g, camera, world, task, x, y, labels);
  }
  for (const row of rows.values()) {
    const [x, y] = camera.toScreen(...markOf(row[0]).at);
    const few = row.length <= ROW;
    const marks = few ? row : row.slice(0, 1);
    const left = x - 7 * (marks.length - 1);
    marks.forEach((task, i) => paintTask(g, camera, world, task, left + 14 * i, y - 17, false));
    const names = few ? row.map((task) => task.id).join(" ") : `× ${row.length}`;
    if (labels || !few) paintLabel(g, left + 14 * (marks.length - 1), y - 17, names);
  }
}

/** @param {Context} g @param {Camera} camera @param {Task} task */
function paintDone(g, camera, task) {
  const [x, y] = camera.toScreen(task.stops[0].at[0], task.stops[0].at[1]);
  g.strokeStyle = colour("muted");
  g.globalAlpha = 0.6;
  g.lineWidth = 1.5;
  g.beginPath();
  g.moveTo(x - 3.5, y);
  g.lineTo(x - 1, y + 3);
  g.lineTo(x + 4, y - 3);
  g.stroke();
  g.globalAlpha = 1;
}

/** @param {Context} g @param {Camera} camera @param {World} world @param {Task} task @param {number} x @param {number} y @param {boolean} labels */
function paintTask(g, camera, world, task, x, y, labels) {
  const chosen = world.selected?.kind === "task" && world.selected.id === task.id;
  if (chosen) paintErrand(g, camera, task);
  const index = task.robot === null ? undefined : world.index.get(task.robot);
  const tint = index === undefined ? colour("text") : robotColour(index);
  paintMark(g, x, y, task, task.status === "stranded" ? colour("alarm") : tint);
  if (chosen) paintRing(g, x, y);
  if (labels || chosen) paintLabel(g, x, y, task.priority === "high" ? `${task.id} ▲` : task.id);
}

/** The way of a task from stop to stop. @param {Context} g @param {Camera} camera @param {Task} task */
function paintErrand(g, camera, task) {
  g.strokeStyle = colour("accent");
  g.lineWidth = 1.5;
  g.setLineDash([2, 4]);
  g.beginPath();
  trace(g, camera, task.stops.map((stop) => stop.at));
  g.stroke();
  g.setLineDash([]);
}

/** The shape says the status. @param {Context} g @param {number} x @param {number} y @param {Task} task @param {string} tint */
function paintMark(g, x, y, { status, stops }, tint) {
  g.strokeStyle = g.fillStyle = tint;
  g.lineWidth = 2;
  g.beginPath();
  if (status === "stranded") {
    g.moveTo(x - 5, y - 5);
    g.lineTo(x + 5, y + 5);
    g.moveTo(x + 5, y - 5);
    g.lineTo(x - 5, y + 5);
  } else if (status === "carried") {
    g.moveTo(x - 5, y - 4);
    g.lineTo(x + 5, y - 4);
    g.lineTo(x, y + 5);
    g.closePath();
  } else if (stops.length === 1) {
    g.moveTo(x, y - 6);
    g.lineTo(x + 6, y);
    g.lineTo(x, y + 6);
    g.lineTo(x - 6, y);
    g.closePath();
  } else g.arc(x, y, 5, 0, 2 * Math.PI);
  if (status === "assigned" || status === "carried") g.fill();
  else if (status === "waiting") {
    g.fillStyle = colour("floor");
    g.fill();
  }
  g.stroke();
}

/** @param {Context} g @param {number} x @param {number} y */
function paintRing(g, x, y) {
  g.strokeStyle = colour("accent");
  g.lineWidth = 2;
  g.beginPath();
  g.arc(x, y, 10, 0, 2 * Math.PI);
  g.stroke();
}

/** @param {Context} g @param {number} x @param {number} y @param {string} text */
export function paintLabel(g, x, y, text) {
  g.font = "11px system-ui, sans-serif";
  g.textAlign = "left";
  g.textBaseline = "middle";
  g.lineJoin = "round";
  g.lineWidth = 3;
  g.strokeStyle = colour("floor");
  g.strokeText(text, x + 9, y);
  g.fillStyle = colour("text");
  g.fillText(text, x + 9, y);
}
