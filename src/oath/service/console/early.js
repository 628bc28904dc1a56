import { get } from "./api.js";

/** What the console starts with; asked for while its other modules still load. */
export const beginning = Promise.all([get("/api/me"), get("/api/mission"), get("/api/state")]);
beginning.catch(() => {}); // whoever waits for it tells
