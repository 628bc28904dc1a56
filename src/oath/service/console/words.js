/** Events in plain words. */

import { plural, showLength, showPoint } from "./format.js";

/** @typedef {"tasks" | "routes" | "obstacles" | "robots" | "commands" | "mission"} Kind */

/** Kinds of events by type; the timeline filters by them and gives each its own shape. */
const KINDS = /** @type {Record<string, Kind>} */ ({
  mission_started: "mission",
  mission_finished: "mission",
  allocated: "routes",
  planned: "routes",
  stop_served: "tasks",
  task_added: "tasks",
  task_cancelled: "tasks",
  priority_changed: "tasks",
  obstacle_found: "obstacles",
  obstacle_added: "obstacles",
  obstacle_removed: "obstacles",
  robot_failed: "robots",
  robot_paused: "robots",
  robot_resumed: "robots",
  commanded: "commands",
});

/** @param {any} event @returns {Kind} */
export function kindOf(event) {
  return KINDS[event.type] ?? "mission";
}

/** @param {any} event an event of the log @returns {string} */
export function inWords(event) {
  switch (event.type) {
    case "mission_started":
      return `mission ${event.mission} starts, allocator ${event.allocator}`;
    case "allocated":
      return allocated(event);
    case "stop_served":
      return served(event);
    case "obstacle_found":
      return `${event.robot} finds obstacle ${event.obstacle}`;
    case "obstacle_added":
      return `${event.kind} ${event.obstacle} stands at ${showPoint(event.polygon[0])}`;
    case "obstacle_removed":
      return `obstacle ${event.obstacle} is gone`;
    case "task_added":
      return `task ${event.task.id} joins, ${event.task.type}`;
    case "task_cancelled":
      return `task ${event.task} is cancelled`;
    case "priority_changed":
      return `task ${event.task} has ${event.priority} priority`;
    case "robot_failed":
      return `${event.robot} has failed`;
    case "robot_paused":
      return `${event.robot} pauses`;
    case "robot_resumed":
      return `${event.robot} goes on`;
    case "commanded":
      return `${event.source}: ${commanded(event.command)}`;
    case "mission_finished":
      return finished(event.summary);
    default:
      return event.type.replaceAll("_", " ");
  }
}

/** @param {any} event */
function served({ robot, task, stop, at }) {
  if (stop === "pickup") return `${robot} picks up ${task} at ${showPoint(at)}`;
  return stop === "delivery" ? `${robot} delivers ${task}` : `${robot} has visited ${task}`;
}

/** @param {any} event */
function allocated({ round, routes, unassigned }) {
  const busy = Object.values(routes).filter((/** @type {any} */ route) => route.length).length;
  const left = Object.keys(unassigned);
  const rest = left.length ? `; without a robot: ${left.join(", ")}` : "";
  return `round ${round} gives routes to ${plural(busy, "robot")}${rest}`;
}

/** @param {any} command */
function commanded({ intent, parameters }) {
  const { task_label, robot, obstacle } = parameters ?? {};
  return [intent.replaceAll("_", " "), task_label ?? robot ?? obstacle ?? ""].join(" ").trim();
}

/** @param {any} summary */
function finished({ completed, tasks, total_distance, makespan }) {
  if (completed === undefined) return "mission ends";
  return `mission ends: ${completed} of ${tasks} tasks, ${showLength(total_distance ?? 0)}, ${(makespan ?? 0).toFixed(1)} s`;
}
