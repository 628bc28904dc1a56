import { byId, el, icon, setAttribute, setIcon, setText } from "./dom.js";
import { showStop, showTime } from "./format.js";
import { robotHue } from "./theme.js";
import { Table } from "./table.js";
import { inWords, kindOf } from "./words.js";
import { LOST } from "./world.js";

/** @typedef {import("./world.js").World} World @typedef {import("./world.js").Task} Task */
/** @typedef {import("./world.js").Robot} Robot */

/** So many of the newest events are listed and filtered. */
const EVENTS = 5000;

/** Tables of more rows are long. */
const MANY = 100;

/** Order of tasks by status: what needs attention comes first. */
const URGENCY = ["stranded", "waiting", "assigned", "carried", "done"];
const PRIORITIES = ["low", "normal", "high"];

/**
 * What a row's buttons ask for.
 * @typedef {(commands: {intent: string, parameters: object}[], words: string) => void} Ask
 */

/** The tables beside the map: tasks, robots, obstacles and events. */
export class Tables {
  /** @param {World} world @param {Ask} ask */
  constructor(world, ask) {
    this.world = world;
    this.ask = ask;
    this.waiting = 0;
    this.tasks = this.#table("tasks", "Tasks", this.#taskColumns());
    this.robots = this.#table("robots", "Robots", this.#robotColumns());
    this.obstacles = this.#table("obstacles", "Obstacles", this.#obstacleColumns());
    this.events = new Table(byId("events-table"), "Events", eventColumns(), {
      key: (event) => String(event.seq),
      onChoose: (event) => world.lookAt(event.t),
    });
    const filter = /** @type {HTMLInputElement} */ (byId("filter"));
    filter.addEventListener("input", () => this.#filtered(filter.value));
    byId("kinds").addEventListener("change", () => this.#showEvents());
    world.on("state", () => this.#soon());
    world.on("events", () => this.#showEvents());
    for (const topic of /** @type {const} */ (["link", "view"])) world.on(topic, () => this.show());
    world.on("view", () => this.#showEvents());
    world.on("select", ({ thing }) => this.#selected(thing));
    setUpTabs((name) => (name === "events" ? this.#showEvents() : this.show()));
    this.show();
  }

  /** @param {"tasks" | "robots" | "obstacles"} name @param {string} label @param {any[]} columns */
  #table(name, label, columns) {
    const kind = /** @type {"task" | "robot" | "obstacle"} */ (name.slice(0, -1));
    return new Table(byId(`${name}-table`), label, columns, {
      key: (item) => item.id,
      onChoose: (item) => this.world.select({ kind, id: item.id }, true),
    });
  }

  /** Long tables follow the live state more slowly: the map comes first. */
  #soon() {
    const { tasks, robots } = this.world.shown;
    if (this.world.past || Math.max(tasks.length, robots.length) <= MANY) this.show();
    else this.waiting ||= setTimeout(() => this.show(), 1000);
  }

  /** Show the state that is looked at. */
  show() {
    clearTimeout(this.waiting);
    this.waiting = 0;
    const { shown } = this.world;
    const open = document.querySelector('[role="tab"][aria-selected="true"]')?.id;
    if (open === "tab-tasks") this.tasks.show(this.#byUrgency(shown.tasks));
    if (open === "tab-robots") this.robots.show(shown.robots);
    if (open === "tab-obstacles") this.obstacles.show(shown.obstacles);
    const left = shown.tasks.filter((task) => task.status !== "done").length;
    setText(byId("count-tasks"), String(left));
    setText(byId("count-robots"), String(shown.robots.length));
    setText(byId("count-obstacles"), String(shown.obstacles.length));
    byId("side").toggleAttribute("data-still", !this.world.acts);
  }

  /** @param {Task[]} tasks */
  #byUrgency(tasks) {
    const rank = (/** @type {Task} */ task) => 3 * URGENCY.indexOf(task.status) - PRIORITIES.indexOf(task.priority);
    return [...tasks].sort((a, b) => rank(a) - rank(b));
  }

  #showEvents() {
    const { history, past } = this.world;
    setText(byId("count-events"), String(history.last + 1));
    if (byId("panel-events").hidden) return;
    const kind = /** @type {HTMLSelectElement} */ (byId("kinds")).value;
    const wanted = history.notable.filter((event) => kind === "all" || kindOf(event) === kind);
    const until = past ? wanted.filter((event) => event.t <= past.t) : wanted;
    this.events.show(until.slice(-EVENTS).reverse());
  }

  /** @param {string} text */
  #filtered(text) {
    for (const table of [this.tasks, this.robots, this.obstacles, this.events]) table.setFilter(text);
  }

  /** @param {import("./world.js").Thing | null} thing */
  #selected(thing) {
    if (thing && byId(`panel-${thing.kind}s`).hidden) openTab(`${thing.kind}s`);
    this.tasks.mark(thing?.kind === "task" ? thing.id : null, true);
    this.robots.mark(thing?.kind === "robot" ? thing.id : null, true);
    this.obstacles.mark(thing?.kind === "obstacle" ? thing.id : null, true);
  }

  /** @returns {import("./table.js").Column<Task>[]} */
  #taskColumns() {
    return [
      {
        key: "id", label: "Task", class: "name", text: (task) => task.id,
        build: (cell) => cell.append(icon("waiting"), el("span")),
        update: (cell, task) => {
          const [shape, name] = cell.children;
          setIcon(shape, task.status);
          setAttribute(shape, "data-hue", hueOf(this.world, task.robot));
          setText(name, task.id);
        },
      },
      {
        key: "status", label: "Status", class: "status", text: (task) => task.status,
        sort: (task) => URGENCY.indexOf(task.status),
        update: (cell, task) => {
          setText(cell, task.status);
          setAttribute(cell, "title", task.reason);
          cell.classList.toggle("alarm", task.status === "stranded");
        },
      },
      { key: "robot", label: "Robot", class: "robot", text: (task) => task.robot ?? "–" },
      {
        key: "to", label: "To", class: "clip", text: (task) => showStop(task.stops[task.stops.length - 1]),
        update: (cell, task) => {
          setText(cell, showStop(task.stops[task.stops.length - 1]));
          setAttribute(cell, "title", task.stops.map(showStop).join(" → "));
        },
      },
      { key: "type", label: "Type", class: "type", text: (task) => task.type },
      {
        key: "priority", label: "Priority", class: "priority", text: (task) => task.priority,
        sort: (task) => PRIORITIES.indexOf(task.priority),
        build: (cell, task) => cell.append(this.#priority(task)),
        update: (cell, task) => {
          const select = /** @type {HTMLSelectElement} */ (cell.firstElementChild);
          const free = this.world.acts && task.status !== "done";
          if (document.activeElement !== select && select.value !== task.priority) select.value = task.priority;
          if (select.disabled === free) select.disabled = !free;
          cell.classList.toggle("urgent", task.priority === "high");
        },
      },
      {
        key: "cancel", label: "", class: "act",
        build: (cell, { id }) => cell.append(rowButton("cancel", `Cancel task ${id}`, () =>
          this.#propose("cancel_task", { task_label: id }, `cancel task ${id}`))),
        update: (cell, task) => able(cell, this.world.acts && task.status !== "done"),
      },
    ];
  }

  /** @param {Task} task */
  #priority({ id }) {
    const select = /** @type {HTMLSelectElement} */ (
      el("select", { "aria-label": `Priority of task ${id}` }, ...PRIORITIES.map((name) => el("option", { value: name }, name)))
    );
    select.addEventListener("change", () => {
      const priority = select.value;
      const task = this.world.shown.tasks.find((one) => one.id === id);
      select.value = task?.priority ?? "normal";
      this.#propose("change_task_priority", { task_label: id, priority }, `set the priority of task ${id} to ${priority}`);
    });
    return select;
  }

  /** @returns {import("./table.js").Column<Robot>[]} */
  #robotColumns() {
    const about = (/** @type {Robot} */ robot) => this.world.mission.robots[this.world.index.get(robot.id) ?? 0];
    return [
      {
        key: "id", label: "Robot", class: "name", text: (robot) => robot.id,
        build: (cell, robot) => {
          const shape = about(robot).motion === this.world.mission.robots[0].motion ? "round" : "square";
          const chip = icon(shape);
          setAttribute(chip, "data-hue", hueOf(this.world, robot.id));
          setAttribute(cell, "title", `${about(robot).motion}, ${about(robot).speed} m/s, can ${Object.keys(about(robot).can).join(", ")}`);
          cell.append(chip, el("span", {}, robot.id));
        },
        update: () => {},
      },
      {
        key: "status", label: "Status", class: "status", text: (robot) => this.#statusOf(robot),
        update: (cell, robot) => {
          setText(cell, this.#statusOf(robot));
          cell.classList.toggle("alarm", robot.status === "failed" || this.world.pose(robot.id).age > LOST);
        },
      },
      {
        key: "next", label: "Next", class: "clip", text: nextOf,
        update: (cell, robot) => {
          setText(cell, nextOf(robot));
          setAttribute(cell, "title", robot.route.map(({ stop, task }) => `${stop} ${task}`).join(", "));
        },
      },
      {
        key: "load", label: "Load", class: "load", text: (robot) => `${robot.carrying.length}/${about(robot).capacity}`,
        sort: (robot) => robot.carrying.length / about(robot).capacity,
        build: (cell, robot) => cell.append(el("meter", { min: 0, max: about(robot).capacity, "aria-hidden": "true" }), el("span")),
        update: (cell, robot) => {
          const [meter, text] = cell.children;
          /** @type {HTMLMeterElement} */ (meter).value = robot.carrying.length;
          setText(text, `${robot.carrying.length}/${about(robot).capacity}`);
          setAttribute(cell, "title", robot.carrying.length ? `carries ${robot.carrying.join(", ")}` : "carries nothing");
        },
      },
      { key: "done", label: "Done", class: "number", text: (robot) => String(robot.tasks), sort: (robot) => robot.tasks },
      { key: "driven", label: "Driven", class: "number driven", text: (robot) => `${robot.driven.toFixed(0)} m`, sort: (robot) => robot.driven },
      {
        key: "hold", label: "", class: "act",
        build: (cell, { id }) => cell.append(rowButton("pause", `Pause ${id}`, () => this.#holdOrRelease(id))),
        update: (cell, robot) => {
          const button = /** @type {HTMLButtonElement} */ (cell.firstElementChild);
          const paused = robot.status === "paused";
          setIcon(/** @type {Element} */ (button.firstElementChild), paused ? "play" : "pause");
          setAttribute(button, "aria-label", paused ? `Let ${robot.id} go on` : `Pause ${robot.id}`);
          setAttribute(button, "title", paused ? `Let ${robot.id} go on` : `Pause ${robot.id} at once`);
          able(cell, this.world.acts && robot.status !== "failed");
        },
      },
    ];
  }

  /** @param {Robot} robot */
  #statusOf(robot) {
    const { age } = this.world.pose(robot.id);
    return age > LOST && robot.status !== "failed" ? `lost ${Math.floor(age)} s` : robot.status;
  }

  /** @param {string} id */
  #holdOrRelease(id) {
    const robot = this.world.shown.robots.find((one) => one.id === id);
    const paused = robot?.status === "paused";
    this.#propose(paused ? "resume_robot" : "pause_robot", { robot: id }, `${paused ? "let" : "pause"} ${id}${paused ? " go on" : ""}`);
  }

  /** @returns {import("./table.js").Column<any>[]} */
  #obstacleColumns() {
    const sources = /** @type {Record<string, string>} */ ({ map: "on the map", found: "found", told: "told" });
    return [
      { key: "id", label: "Obstacle", class: "name", text: (obstacle) => obstacle.id },
      { key: "kind", label: "Kind", text: (obstacle) => obstacle.kind },
      { key: "source", label: "Known", text: (obstacle) => sources[obstacle.source] ?? obstacle.source },
      { key: "corners", label: "Corners", class: "number", text: (obstacle) => String(obstacle.polygon.length), sort: (obstacle) => obstacle.polygon.length },
      {
        key: "remove", label: "", class: "act",
        build: (cell, { id }) => cell.append(rowButton("cancel", `Remove obstacle ${id}`, () =>
          this.#propose("remove_obstacle", { obstacle: id }, `remove obstacle ${id}`))),
        update: (cell) => able(cell, this.world.acts),
      },
    ];
  }

  /** @param {string} intent @param {object} parameters @param {string} words */
  #propose(intent, parameters, words) {
    this.ask([{ intent, parameters }], words);
  }
}

/** @returns {import("./table.js").Column<any>[]} */
function eventColumns() {
  return [
    { key: "t", label: "Time", class: "number", text: (event) => showTime(event.t), sort: (event) => event.seq },
    {
      key: "kind", label: "Kind", text: kindOf, class: "kind",
      build: (cell, event) => cell.append(icon(`event-${kindOf(event)}`), el("span", {}, kindOf(event))),
      update: () => {},
    },
    { key: "text", label: "What happened", class: "grow", text: inWords },
  ];
}

/** @param {Robot} robot */
function nextOf({ route }) {
  if (!route.length) return "–";
  return `${route[0].stop} ${route[0].task}`;
}

/** @param {World} world @param {string | null} robot @returns {string | null} */
function hueOf(world, robot) {
  const index = robot === null ? undefined : world.index.get(robot);
  return index === undefined ? null : String(robotHue(index));
}

/** @param {string} shape @param {string} label @param {() => void} onclick */
function rowButton(shape, label, onclick) {
  return el("button", { type: "button", class: "quiet", "aria-label": label, title: label, onclick }, icon(shape));
}

/** @param {HTMLElement} cell @param {boolean} can */
function able(cell, can) {
  const button = /** @type {HTMLButtonElement} */ (cell.firstElementChild);
  if (button.disabled === can) button.disabled = !can;
}

/** @param {string} name of a tab: "tasks", "robots", ... */
export function openTab(name) {
  byId(`tab-${name}`).click();
}

/** @param {(name: string) => void} opened */
function setUpTabs(opened) {
  const tabs = /** @type {HTMLElement[]} */ ([...document.querySelectorAll('#tabs [role="tab"]')]);
  const open = (/** @type {HTMLElement} */ chosen) => {
    for (const tab of tabs) {
      const here = tab === chosen;
      tab.setAttribute("aria-selected", String(here));
      tab.tabIndex = here ? 0 : -1;
      byId(/** @type {string} */ (tab.getAttribute("aria-controls"))).hidden = !here;
    }
    const name = chosen.id.slice("tab-".length);
    byId("kinds").hidden = name !== "events";
    opened(name);
  };
  tabs.forEach((tab, i) => {
    tab.addEventListener("click", () => open(tab));
    tab.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      event.preventDefault();
      const next = tabs[(i + step + tabs.length) % tabs.length];
      open(next);
      next.focus();
    });
  });
}
