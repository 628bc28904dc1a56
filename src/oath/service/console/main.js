import { Alerts } from "./alerts.js";
import { Bar } from "./bar.js";
import { Chat, messageOf } from "./chat.js";
import { byId, setText } from "./dom.js";
import { Draw } from "./draw.js";
import { beginning } from "./early.js";
import { setUpKeys } from "./keys.js";
import { Link } from "./link.js";
import { LiveMap } from "./map.js";
import { setUpPointer } from "./pointer.js";
import { openTab, Tables } from "./tables.js";
import { setUpTheme } from "./theme.js";
import { Timeline } from "./timeline.js";
import { describe } from "./tooltip.js";
import { World } from "./world.js";

/** Put the console together, and connect it. */
async function start() {
  const [me, mission, state] = await beginning;
  const world = new World(mission, state, me.role);
  setUpTheme(/** @type {HTMLSelectElement} */ (byId("theme")), () => world.emit("view"));
  const map = new LiveMap(byId("map"), world);
  const chat = new Chat(world);
  const draw = new Draw(map, (commands, words, edit) => chat.propose(commands, words, edit));
  new Tables(world, (commands, words) => chat.propose(commands, words));
  const bar = new Bar(world, (text, alarm) => chat.tell(text, alarm));
  const timeline = new Timeline(world);
  new Alerts(world);
  setUpHands(world, map, draw);
  const views = setUpViews(world, map);
  const link = new Link({
    since: () => world.history.last,
    onMessage: (message) => world.receive(message),
    onPoses: (frame) => world.receivePoses(frame),
    onStatus: (status) => world.setLink(status),
  });
  byId("retry").addEventListener("click", () => link.connect());
  link.connect();
  setInterval(() => world.link.lostAt && world.emit("link"), 1000); // ages grow
  world.on("view", () => map.touch("ground"));
  setUpKeys(
    [
      { key: "/", does: "write to the mission", run: () => byId("say").focus() },
      { key: "y", does: "confirm the proposal", run: () => chat.card?.confirm() },
      { key: "n", does: "reject the proposal", run: () => chat.card?.reject() },
      { key: "o", does: "draw an obstacle, or type its corners", run: () => draw.toggle("obstacle") },
      { key: "t", does: "draw a task, or type its stops", run: () => draw.toggle("task") },
      { key: " ", shown: "Space", does: "hold the clock, or let it run", run: () => bar.hold() },
      { key: ".", does: "run to the next event", run: () => bar.setClock({ step: true }) },
      { key: "l", does: "return to live", run: () => timeline.returnToLive() },
      { key: ",", does: "look at the event before", run: () => timeline.step(-1) },
      { key: ";", does: "look at the event after", run: () => timeline.step(1) },
      { key: "p", does: "play the past", run: () => timeline.togglePlay() },
      { key: "m", does: "go to the map", run: () => byId("map").focus() },
      ...["tasks", "robots", "obstacles", "events"].map((name, i) => ({
        key: String(i + 1), does: `show the ${name}`, run: () => openTab(name),
      })),
      ...views,
    ],
    {
      confirm: () => chat.card?.confirm(),
      escape: () => {
        if (draw.tool) draw.close();
        else if (document.activeElement instanceof HTMLInputElement) byId("map").focus();
        else world.select(null);
      },
    },
  );
  byId("console").hidden = false;
  byId("start").remove();
  requestAnimationFrame(() => requestAnimationFrame(() => performance.mark("useful")));
  Object.assign(globalThis, { oath: { world, map } }); // for tests, and the curious
}

/** @param {World} world @param {LiveMap} map @param {Draw} draw */
function setUpHands(world, map, draw) {
  const tip = byId("tip");
  setUpPointer(map, {
    onClick: (px, py) => {
      byId("map").focus({ preventScroll: true });
      if (draw.tool) draw.click(px, py);
      else world.select(map.hit(px, py));
    },
    onDouble: () => draw.tool === "obstacle" && draw.submit(),
    onHover: (px, py) => {
      draw.hover(px, py);
      const thing = draw.tool ? null : map.hit(px, py);
      tip.hidden = !thing;
      map.host.classList.toggle("over", thing !== null);
      if (!thing) return;
      setText(tip, describe(world, thing));
      tip.style.translate = `${Math.min(px + 14, map.camera.width - 240)}px ${Math.min(py + 14, map.camera.height - 60)}px`;
    },
    onLeave: () => {
      tip.hidden = true;
      draw.hovered = null;
    },
  });
}

/**
 * Buttons of the map, and their keys.
 * @param {World} world @param {LiveMap} map @returns {import("./keys.js").Shortcut[]}
 */
function setUpViews(world, map) {
  const press = (/** @type {string} */ id, /** @type {boolean} */ on) => byId(id).setAttribute("aria-pressed", String(on));
  const flip = (/** @type {"paths" | "trails" | "labels"} */ what) => {
    map.shows[what] = !map.shows[what];
    press(`show-${what}`, map.shows[what]);
    map.touch("plans");
  };
  const roadmap = async () => press("show-roadmap", await map.toggleRoadmap());
  const follow = () => {
    if (!map.follows && world.selected?.kind !== "robot") world.select({ kind: "robot", id: world.mission.robots[0].id });
    map.follows = !map.follows;
    map.touch("ground");
    press("follow", map.follows);
  };
  const next = () => {
    const { robots } = world.mission;
    const at = world.selected?.kind === "robot" ? (world.index.get(world.selected.id) ?? -1) : -1;
    world.select({ kind: "robot", id: robots[(at + 1) % robots.length].id }, true);
  };
  const fit = () => {
    map.follows = false;
    press("follow", false);
    map.move((camera) => camera.fit());
  };
  const nearer = () => map.move((camera) => camera.zoom(1.3));
  const farther = () => map.move((camera) => camera.zoom(1 / 1.3));
  /** @type {[string, string, string, () => void][]} */
  const all = [
    ["fit", "0", "show the whole mission", fit],
    ["zoom-in", "+", "zoom in", nearer],
    ["zoom-out", "-", "zoom out", farther],
    ["follow", "f", "follow the selected robot", follow],
    ["show-paths", "w", "show planned ways", () => flip("paths")],
    ["show-trails", "d", "show driven ways", () => flip("trails")],
    ["show-labels", "b", "show labels", () => flip("labels")],
    ["show-roadmap", "g", "show the roadmap", roadmap],
  ];
  for (const [id, , , run] of all) byId(id).addEventListener("click", run);
  for (const what of /** @type {const} */ (["paths", "trails", "labels"])) press(`show-${what}`, map.shows[what]);
  map.host.addEventListener("pointermove", () => press("follow", map.follows));
  return [...all.map(([, key, does, run]) => ({ key, does, run })), { key: "r", does: "select the next robot", run: next }];
}

start().catch((error) => setText(byId("start"), `The console cannot start: ${messageOf(error)}`));
