import { get } from "./api.js";

/** Waits before the next attempt to connect [ms]; the last one repeats. */
const WAITS = [250, 500, 1000, 2000, 4000];

/** A connection that brings nothing for so long is dead [ms]; the server is asked before. */
const SILENCE = 8000;

/**
 * @typedef {object} Handlers
 * @property {(message: any) => void} onMessage a text frame, parsed
 * @property {(frame: DataView) => void} onPoses a binary frame
 * @property {(link: {status: "connecting" | "live" | "lost" | "refused", retryAt: number}) => void} onStatus
 * @property {() => number} since sequence of the last event that is known; -1: none
 */

/** The live connection: reconnects with growing waits, and resumes after the last known event. */
export class Link {
  /** @param {Handlers} handlers */
  constructor(handlers) {
    this.handlers = handlers;
    this.failures = 0;
    this.heard = 0;
    this.timer = 0;
    /** @type {WebSocket | null} */
    this.socket = null;
    setInterval(() => this.#watch(), 2000);
  }

  /** Connect now, whatever wait is left. */
  connect() {
    clearTimeout(this.timer);
    this.socket?.close();
    this.handlers.onStatus({ status: this.failures ? "lost" : "connecting", retryAt: 0 });
    const url = new URL(`/api/live?since=${this.handlers.since()}`, location.href);
    url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(url, ["oath"]);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => this.#receive(socket, event.data);
    socket.onclose = () => this.#closed(socket);
    this.socket = socket;
    this.heard = performance.now();
  }

  /** @param {WebSocket} socket @param {string | ArrayBuffer} data */
  #receive(socket, data) {
    if (socket !== this.socket) return;
    this.heard = performance.now();
    if (data instanceof ArrayBuffer) return this.handlers.onPoses(new DataView(data));
    const message = JSON.parse(data);
    if (message.type === "hello") {
      this.failures = 0;
      this.handlers.onStatus({ status: "live", retryAt: 0 });
    }
    return this.handlers.onMessage(message);
  }

  /** @param {WebSocket} socket */
  async #closed(socket) {
    if (socket !== this.socket) return;
    this.socket = null;
    const wait = WAITS[Math.min(this.failures, WAITS.length - 1)] * (0.8 + 0.4 * Math.random());
    this.failures += 1;
    this.handlers.onStatus({ status: "lost", retryAt: performance.now() + wait });
    this.timer = setTimeout(() => this.connect(), wait);
    const refused = await get("/api/me").then(() => false, (error) => error.status === 401);
    if (refused && !this.socket) {
      clearTimeout(this.timer);
      this.handlers.onStatus({ status: "refused", retryAt: 0 });
    }
  }

  #watch() {
    const silent = performance.now() - this.heard;
    if (!this.socket || silent < SILENCE / 2) return;
    if (silent > SILENCE) this.socket.close();
    else if (this.socket.readyState === WebSocket.OPEN) this.socket.send('{"type":"ping"}');
  }
}
