import { colour } from "./theme.js";

/** @typedef {CanvasRenderingContext2D} Context */

/** Paint what never moves: the floor, its grid, zones, walls and places. */
export class Ground {
  /** @param {any} mission */
  constructor(mission) {
    this.mission = mission;
    this.cells = mission.grid && cellsOf(mission.grid);
    this.tint = "";
  }

  /** @param {Context} g @param {import("./camera.js").Camera} camera */
  paint(g, camera) {
    const [x0, y0, x1, y1] = this.mission.bounds;
    const [left, top] = camera.toScreen(x0, y1);
    const [right, bottom] = camera.toScreen(x1, y0);
    g.fillStyle = colour("bg");
    g.fillRect(0, 0, camera.width, camera.height);
    g.fillStyle = colour("floor");
    g.fillRect(left, top, right - left, bottom - top);
    paintMesh(g, camera, this.mission.bounds);
    for (const [name, polygon] of Object.entries(this.mission.zones)) {
      paintZone(g, camera, name, polygon);
    }
    if (this.cells) this.#paintCells(g, camera);
    g.strokeStyle = colour("wall");
    g.lineWidth = 1.5;
    g.strokeRect(left, top, right - left, bottom - top);
    this.#paintWalls(g, camera);
    this.#paintPlaces(g, camera);
  }

  /** @param {Context} g @param {import("./camera.js").Camera} camera */
  #paintWalls(g, camera) {
    g.lineWidth = Math.max(1.5, this.mission.wall_thickness * camera.scale);
    g.lineJoin = g.lineCap = "round";
    g.beginPath();
    for (const wall of this.mission.walls) trace(g, camera, wall);
    g.stroke();
  }

  /** @param {Context} g @param {import("./camera.js").Camera} camera */
  #paintPlaces(g, camera) {
    g.font = "600 12px system-ui, sans-serif";
    g.textAlign = "center";
    g.textBaseline = "middle";
    for (const [name, at] of Object.entries(this.mission.places)) {
      const [x, y] = camera.toScreen(at[0], at[1]);
      const half = Math.max(9, g.measureText(name).width / 2 + 4);
      g.beginPath();
      g.roundRect(x - half, y - 9, 2 * half, 18, 4);
      g.fillStyle = colour("panel");
      g.fill();
      g.strokeStyle = colour("muted");
      g.lineWidth = 1.25;
      g.stroke();
      g.fillStyle = colour("text");
      g.fillText(name, x, y + 0.5);
    }
  }

  /** @param {Context} g @param {import("./camera.js").Camera} camera */
  #paintCells(g, camera) {
    const { grid } = this.mission;
    if (this.tint !== colour("wall")) {
      this.tint = colour("wall");
      const own = /** @type {Context} */ (this.cells.getContext("2d"));
      own.globalCompositeOperation = "source-in";
      own.fillStyle = this.tint;
      own.fillRect(0, 0, grid.columns, grid.rows);
    }
    const [x, y] = grid.origin;
    const [left, top] = camera.toScreen(x, y + grid.rows * grid.resolution);
    const size = grid.resolution * camera.scale;
    g.imageSmoothingEnabled = size < 3;
    g.drawImage(this.cells, left, top, grid.columns * size, grid.rows * size);
  }
}

/** One pixel a cell; row 0 of the grid is the lowest. @param {any} grid @returns {HTMLCanvasElement} */
function cellsOf(grid) {
  const canvas = document.createElement("canvas");
  canvas.width = grid.columns;
  canvas.height = grid.rows;
  const g = /** @type {Context} */ (canvas.getContext("2d"));
  for (const [row, first, last] of grid.runs) {
    g.fillRect(first, grid.rows - 1 - row, last - first + 1, 1);
  }
  return canvas;
}

/** Lines each so many metres, whatever reads well. @param {Context} g @param {any} camera @param {number[]} bounds */
function paintMesh(g, camera, [x0, y0, x1, y1]) {
  const step = [1, 5, 10, 50, 100, 500].find((metres) => metres * camera.scale >= 24) ?? 1000;
  g.strokeStyle = colour("line");
  g.lineWidth = 1;
  g.globalAlpha = 0.55;
  g.beginPath();
  for (let x = Math.ceil(x0 / step) * step; x <= x1; x += step) {
    trace(g, camera, [[x, y0], [x, y1]]);
  }
  for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) {
    trace(g, camera, [[x0, y], [x1, y]]);
  }
  g.stroke();
  g.globalAlpha = 1;
}

/** @param {Context} g @param {any} camera @param {string} name @param {any} polygon */
function paintZone(g, camera, name, polygon) {
  g.save();
  g.beginPath();
  trace(g, camera, polygon);
  g.closePath();
  g.strokeStyle = g.fillStyle = colour("zone");
  g.globalAlpha = 0.12;
  g.fill();
  g.globalAlpha = 0.9;
  g.lineWidth = 1.25;
  g.setLineDash([2, 3]);
  g.stroke();
  const xs = polygon.map((/** @type {number[]} */ p) => p[0]);
  const ys = polygon.map((/** @type {number[]} */ p) => p[1]);
  const [x, y] = camera.toScreen(Math.min(...xs), Math.max(...ys));
  g.font = "500 11px system-ui, sans-serif";
  g.textAlign = "left";
  g.textBaseline = "top";
  g.fillText(name, x + 4, y + 4);
  g.restore();
}

/** Add a polyline to the path. @param {Context} g @param {any} camera @param {readonly number[][]} points */
export function trace(g, camera, points) {
  points.forEach(([x, y], i) => {
    const [px, py] = camera.toScreen(x, y);
    if (i) g.lineTo(px, py);
    else g.moveTo(px, py);
  });
}
