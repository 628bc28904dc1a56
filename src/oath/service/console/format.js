/** How times, places and lengths are written. */

/** @param {number} t mission clock [s] @returns {string} "12.3 s", "3:07.2" or "1:03:07" */
export function showTime(t) {
  const tenths = Math.max(0, Math.floor(t * 10 + 1e-6));
  if (tenths < 600) return `${(tenths / 10).toFixed(1)} s`;
  const seconds = Math.floor(tenths / 10);
  const two = (/** @type {number} */ n) => String(n).padStart(2, "0");
  const [h, m, s] = [Math.floor(seconds / 3600), Math.floor(seconds / 60) % 60, seconds % 60];
  return h ? `${h}:${two(m)}:${two(s)}` : `${m}:${two(s)}.${tenths % 10}`;
}

/** @param {number} seconds @returns {string} "8 s" or "3 min" */
export function showAge(seconds) {
  return seconds < 100 ? `${Math.floor(seconds)} s` : `${Math.floor(seconds / 60)} min`;
}

/** @param {readonly number[]} at @returns {string} "(5.0, 19.5)" */
export function showPoint(at) {
  return `(${at[0].toFixed(1)}, ${at[1].toFixed(1)})`;
}

/** @param {number} metres @returns {string} */
export function showLength(metres) {
  return metres < 1000 ? `${metres.toFixed(0)} m` : `${(metres / 1000).toFixed(2)} km`;
}

/** @param {number} count @param {string} noun @returns {string} "1 task", "2 tasks" */
export function plural(count, noun) {
  return `${count} ${noun}${count === 1 ? "" : "s"}`;
}

/** @param {any} stop a stop of a task @returns {string} its place's name, or its point */
export function showStop(stop) {
  return stop.place ?? showPoint(stop.at);
}
