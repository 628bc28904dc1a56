import { showStop } from "./format.js";

/**
 * A thing of the map in a few lines.
 * @param {import("./world.js").World} world @param {import("./world.js").Thing} thing
 * @returns {string}
 */
export function describe(world, { kind, id }) {
  const { shown, mission, index } = world;
  if (kind === "robot") {
    const robot = shown.robots.find((one) => one.id === id);
    const about = mission.robots[index.get(id) ?? 0];
    if (!robot) return id;
    const next = robot.route[0] ? `\nto ${robot.route[0].stop} of ${robot.route[0].task}` : "";
    const load = robot.carrying.length ? `: ${robot.carrying.join(", ")}` : "";
    return `${id}, ${about.motion}, ${robot.status}${next}\nload ${robot.carrying.length}/${about.capacity}${load}`;
  }
  if (kind === "task") {
    const task = shown.tasks.find((one) => one.id === id);
    if (!task) return id;
    const who = task.robot ? `, ${task.robot}` : "";
    const why = task.reason ? `\n${task.reason}` : "";
    return `${id}, ${task.type}, ${task.priority}\n${task.status}${who}\n${task.stops.map(showStop).join(" → ")}${why}`;
  }
  const obstacle = shown.obstacles.find((one) => one.id === id);
  return obstacle ? `${id}, ${obstacle.kind}\n${obstacle.source === "map" ? "on the map" : obstacle.source}` : id;
}
