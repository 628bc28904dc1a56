import { showAge } from "./format.js";
import { colour, robotColour } from "./theme.js";
import { LOST } from "./world.js";

/** @typedef {CanvasRenderingContext2D} Context @typedef {import("./camera.js").Camera} Camera */

/** Of more robots than this, ways are shown on demand, and names when the map is near. */
export const CROWD = 40;

/** @param {number} scale @param {number} radius [m] @returns {number} of a robot on the screen [px] */
export function sizeOf(scale, radius) {
  return Math.max(7, Math.min(40, radius * scale * 1.25));
}

/**
 * Paint the robots where they are at this moment.
 * @param {Context} g @param {Camera} camera @param {import("./world.js").World} world
 */
export function paintRobots(g, camera, world) {
  const { mission, poses } = world;
  const named = mission.robots.length <= CROWD || camera.scale > 30;
  const usual = mission.robots[0]?.motion;
  world.shown.robots.forEach((robot) => {
    const index = world.index.get(robot.id) ?? 0;
    const about = mission.robots[index];
    const [x, y] = camera.toScreen(poses[4 * index], poses[4 * index + 1]);
    const size = sizeOf(camera.scale, about.radius);
    if (x < -60 || y < -60 || x > camera.width + 60 || y > camera.height + 60) return;
    const age = poses[4 * index + 3];
    const lost = age > LOST && robot.status !== "failed";
    const chosen = world.selected?.kind === "robot" && world.selected.id === robot.id;
    if (chosen) paintHalo(g, x, y, size);
    const dead = lost || robot.status === "failed";
    const tint = dead ? colour("muted") : robotColour(index);
    const square = about.motion !== usual;
    paintBody(g, x, y, poses[4 * index + 2], { tint, size, square, dead });
    paintStatus(g, x, y, size, robot.status);
    if (robot.carrying.length) paintLoad(g, x, y, size, robot.carrying.length, about.capacity);
    if (named || chosen) {
      const note = lost ? ` lost ${showAge(age)}` : "";
      paintName(g, x, y + size + (robot.carrying.length ? 10 : 4), robot.id + note, dead);
    }
  });
}

/**
 * Bodies are painted once for each look and then copied: paths cost much more.
 * @type {Map<string, HTMLCanvasElement>}
 */
const bodies = new Map();

/** So many looks are kept; zooming makes new ones. */
const LOOKS = 100;

/** @typedef {{tint: string, size: number, square: boolean, dead: boolean}} Look */

/** @param {Context} g @param {number} x @param {number} y @param {number} heading @param {Look} look */
function paintBody(g, x, y, heading, look) {
  const ratio = devicePixelRatio || 1;
  const body = bodyOf(look, ratio);
  const half = body.width / 2 / ratio;
  const [sin, cos] = [Math.sin(-heading), Math.cos(-heading)];
  g.setTransform(ratio * cos, ratio * sin, -ratio * sin, ratio * cos, ratio * x, ratio * y);
  g.drawImage(body, -half, -half, 2 * half, 2 * half);
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
}

/** @param {Look} look @param {number} ratio pixels of the screen per pixel @returns {HTMLCanvasElement} */
function bodyOf(look, ratio) {
  const { tint, size, square, dead } = look;
  const key = [tint, colour("floor"), size, square, dead, ratio].join();
  const known = bodies.get(key);
  if (known) return known;
  if (bodies.size >= LOOKS) bodies.clear();
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 2 * Math.ceil((size + 2) * ratio);
  const g = /** @type {Context} */ (canvas.getContext("2d"));
  g.setTransform(ratio, 0, 0, ratio, canvas.width / 2, canvas.width / 2);
  paintLook(g, look);
  bodies.set(key, canvas);
  return canvas;
}

/** A robot that heads to the right. @param {Context} g @param {Look} look */
function paintLook(g, { tint, size, square, dead }) {
  g.beginPath();
  if (square) g.rect(-0.88 * size, -0.88 * size, 1.76 * size, 1.76 * size);
  else g.arc(0, 0, size, 0, 2 * Math.PI);
  g.fillStyle = dead ? colour("floor") : tint;
  g.fill();
  g.lineWidth = dead ? 1.5 : 2;
  g.strokeStyle = dead ? tint : colour("floor");
  if (dead) g.setLineDash([3, 2]);
  g.stroke();
  g.beginPath();
  g.moveTo(size * 0.68, 0);
  g.lineTo(-size * 0.42, size * 0.46);
  g.lineTo(-size * 0.16, 0);
  g.lineTo(-size * 0.42, -size * 0.46);
  g.closePath();
  g.fillStyle = dead ? tint : colour("floor");
  g.fill();
}

/** @param {Context} g @param {number} x @param {number} y @param {number} size */
function paintHalo(g, x, y, size) {
  g.beginPath();
  g.arc(x, y, size + 6, 0, 2 * Math.PI);
  g.strokeStyle = colour("accent");
  g.lineWidth = 2.5;
  g.stroke();
}

/** A small badge: bars if paused, a cross if failed, a dot if at work. @param {Context} g @param {number} x @param {number} y @param {number} size @param {string} status */
function paintStatus(g, x, y, size, status) {
  if (status === "idle" || status === "driving") return;
  const [bx, by] = [x + size * 0.85, y - size * 0.85];
  g.beginPath();
  g.arc(bx, by, 6, 0, 2 * Math.PI);
  g.fillStyle = colour("panel");
  g.fill();
  g.strokeStyle = g.fillStyle = colour(status === "failed" ? "alarm" : "text");
  g.lineWidth = 1;
  g.stroke();
  g.beginPath();
  g.lineWidth = 1.75;
  if (status === "paused") {
    for (const dx of [-1.75, 1.75]) {
      g.moveTo(bx + dx, by - 2.5);
      g.lineTo(bx + dx, by + 2.5);
    }
  } else if (status === "failed") {
    g.moveTo(bx - 2.5, by - 2.5);
    g.lineTo(bx + 2.5, by + 2.5);
    g.moveTo(bx + 2.5, by - 2.5);
    g.lineTo(bx - 2.5, by + 2.5);
  } else g.arc(bx, by, 2, 0, 2 * Math.PI);
  g.stroke();
}

/** How much of its capacity a robot carries. @param {Context} g @param {number} x @param {number} y @param {number} size @param {number} load @param {number} capacity */
function paintLoad(g, x, y, size, load, capacity) {
  const width = Math.max(18, 2 * size);
  const [left, top] = [x - width / 2, y + size + 3];
  g.fillStyle = colour("line");
  g.fillRect(left, top, width, 4);
  g.fillStyle = colour("text");
  g.fillRect(left, top, width * Math.min(1, load / capacity), 4);
  g.fillStyle = colour("floor");
  for (let i = 1; i < Math.min(capacity, 8); i++) g.fillRect(left + (width * i) / capacity - 0.5, top, 1, 4);
}

/** @param {Context} g @param {number} x @param {number} y @param {string} text @param {boolean} dead */
function paintName(g, x, y, text, dead) {
  g.font = "600 11px system-ui, sans-serif";
  g.textAlign = "center";
  g.textBaseline = "top";
  g.lineJoin = "round";
  g.lineWidth = 3;
  g.strokeStyle = colour("floor");
  g.strokeText(text, x, y);
  g.fillStyle = colour(dead ? "muted" : "text");
  g.fillText(text, x, y);
}
