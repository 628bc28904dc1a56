/**
 * Hands on the map: drag to pan, wheel or pinch to zoom, click to select, keys for all of it.
 */

/** How far a press may wander and still be a click [px]. */
const STILL = 5;

/** Pixels that an arrow key pans. */
const STEP = 60;

/**
 * @typedef {object} Hands
 * @property {(px: number, py: number) => void} onClick
 * @property {(px: number, py: number) => void} onDouble
 * @property {(px: number, py: number) => void} onHover
 * @property {() => void} onLeave
 */

/**
 * @param {import("./map.js").LiveMap} map @param {Hands} hands
 */
export function setUpPointer(map, hands) {
  const { host } = map;
  /** Where each finger or button that is down is now. @type {Map<number, [number, number]>} */
  const down = new Map();
  let wandered = 0;

  const at = (/** @type {MouseEvent} */ event) => {
    const box = host.getBoundingClientRect();
    return /** @type {[number, number]} */ ([event.clientX - box.left, event.clientY - box.top]);
  };

  host.addEventListener("pointerdown", (event) => {
    host.setPointerCapture(event.pointerId);
    if (!down.size) wandered = 0;
    down.set(event.pointerId, at(event));
  });

  host.addEventListener("pointermove", (event) => {
    const before = down.get(event.pointerId);
    const now = at(event);
    if (!before) return hands.onHover(now[0], now[1]);
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    wandered += Math.hypot(dx, dy);
    const others = [...down].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    down.set(event.pointerId, now);
    if (others.length) pinch(others[0], before, now);
    else if (wandered > STILL) {
      map.follows = false;
      map.move((camera) => camera.pan(dx, dy));
      host.classList.add("dragging");
    }
  });

  /** @param {[number, number]} other @param {[number, number]} before @param {[number, number]} now */
  function pinch(other, before, now) {
    const apart = (/** @type {number[]} */ p) => Math.max(8, Math.hypot(p[0] - other[0], p[1] - other[1]));
    const middle = [(other[0] + now[0]) / 2, (other[1] + now[1]) / 2];
    map.move((camera) => {
      camera.pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
      camera.zoom(apart(now) / apart(before), middle[0], middle[1]);
    });
  }

  const up = (/** @type {PointerEvent} */ event) => {
    if (down.size === 1 && wandered <= STILL && event.type === "pointerup" && event.button === 0) {
      hands.onClick(...at(event));
    }
    down.delete(event.pointerId);
    host.classList.remove("dragging");
  };
  host.addEventListener("pointerup", up);
  host.addEventListener("pointercancel", up);
  host.addEventListener("pointerleave", hands.onLeave);
  host.addEventListener("dblclick", (event) => hands.onDouble(...at(event)));

  host.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const notch = event.deltaMode === 1 ? 0.05 : 0.0016;
      map.move((camera) => camera.zoom(Math.exp(-event.deltaY * notch), ...at(event)));
    },
    { passive: false },
  );

  const pans = { ArrowLeft: [STEP, 0], ArrowRight: [-STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] };
  host.addEventListener("keydown", (event) => {
    const pan = pans[/** @type {keyof pans} */ (event.key)];
    if (!pan || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    map.follows = false;
    map.move((camera) => camera.pan(pan[0], pan[1]));
  });
}
