/** Which part of the world the map shows: y points up there, down on the screen. */
export class Camera {
  /** @param {[number, number, number, number]} bounds of the mission [m] */
  constructor(bounds) {
    this.bounds = bounds;
    this.x = (bounds[0] + bounds[2]) / 2;
    this.y = (bounds[1] + bounds[3]) / 2;
    /** Pixels per metre. */
    this.scale = 1;
    this.width = 1;
    this.height = 1;
    this.fitted = true;
  }

  /** @param {number} width of the view [px] @param {number} height [px] */
  resize(width, height) {
    this.width = width;
    this.height = height;
    if (this.fitted) this.fit();
  }

  /** Show the whole mission. */
  fit() {
    const [x0, y0, x1, y1] = this.bounds;
    this.x = (x0 + x1) / 2;
    this.y = (y0 + y1) / 2;
    this.scale = this.#fitting();
    this.fitted = true;
  }

  #fitting() {
    const [x0, y0, x1, y1] = this.bounds;
    const margin = 24;
    const [w, h] = [this.width - 2 * margin, this.height - 2 * margin];
    return Math.max(0.01, Math.min(w / (x1 - x0 || 1), h / (y1 - y0 || 1)));
  }

  /** @param {number} x @param {number} y @returns {[number, number]} on the screen [px] */
  toScreen(x, y) {
    return [
      this.width / 2 + (x - this.x) * this.scale,
      this.height / 2 - (y - this.y) * this.scale,
    ];
  }

  /** @param {number} px @param {number} py @returns {[number, number]} in the world [m] */
  toWorld(px, py) {
    return [
      this.x + (px - this.width / 2) / this.scale,
      this.y - (py - this.height / 2) / this.scale,
    ];
  }

  /** @param {number} dx [px] @param {number} dy [px] */
  pan(dx, dy) {
    this.centre(this.x - dx / this.scale, this.y + dy / this.scale);
  }

  /** As far as the mission's edge is not left too far behind. @param {number} x @param {number} y */
  centre(x, y) {
    const [x0, y0, x1, y1] = this.bounds;
    this.x = within(x, x0, x1, this.width / this.scale / 4);
    this.y = within(y, y0, y1, this.height / this.scale / 4);
    this.fitted = false;
  }

  /** Zoom about a point that stays where it is. @param {number} factor @param {number} px @param {number} py */
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toWorld(px, py);
    const least = this.#fitting() / 2;
    this.scale = Math.max(least, Math.min(400, this.scale * factor));
    this.centre(x - (px - this.width / 2) / this.scale, y + (py - this.height / 2) / this.scale);
  }
}

/** @param {number} value @param {number} low @param {number} high @param {number} margin */
function within(value, low, high, margin) {
  if (high - low < 2 * margin) return (low + high) / 2;
  return Math.max(low + margin, Math.min(high - margin, value));
}
