"""What is asked of an operator, with the names of the live world."""

from __future__ import annotations

from collections.abc import Sequence

from oath.commands import Live
from oath.commands.command import show_point
from oath.instruct.offline.heard import Heard
from oath.instruct.offline.tokens import Token
from oath.model import Point


def outside(heard: Heard, at: Point) -> str | None:
    """Why a point cannot be on the map."""
    x0, y0, x1, y1 = heard.live.scene.mission.map.bounds
    if x0 <= at[0] <= x1 and y0 <= at[1] <= y1:
        return None
    return (
        f"{show_point(at)} lies outside the map, which reaches from {show_point((x0, y0))} to "
        f"{show_point((x1, y1))}. Give a point inside."
    )


def unknown_place(heard: Heard, token: Token) -> str:
    """There is no such place, but these."""
    known = ", ".join(heard.live.scene.mission.places) or "(none)"
    return f"There is no place '{token.raw}'. Places: {known}; or a point such as (5, 19.5)."


def open_tasks(live: Live) -> list[str]:
    """Tasks that are not done."""
    return [id for id in live.state.tasks if id not in live.state.completed]


def ask_location(heard: Heard) -> str:
    """Ask where a task is picked up."""
    return "Where is it picked up? Give a point in metres, e.g. (5, 19.5)."


def ask_delivery(heard: Heard) -> str:
    """Ask where a task goes."""
    places = list(heard.live.scene.mission.places)
    known = (
        f"Places: {', '.join(places)}; e.g. 'to {places[0]}'." if places else "E.g. 'to (6, 3)'."
    )
    return f"Where does it go? {known}"


def ask_extent() -> str:
    """Ask for the points of an obstacle."""
    return (
        "Where does it reach? Give its two ends, e.g. from (7, 5) to (8, 5), or its corners, e.g. "
        "(7, 5), (8, 5), (8, 4)."
    )


def ask_label(heard: Heard) -> str:
    """Ask which task is meant."""
    labels = open_tasks(heard.live)
    shown = ", ".join(labels[:30]) + (", ..." if len(labels) > 30 else "")
    return (
        f"Which task? Say its label, e.g. 'task {labels[0]}'. Open: {shown}"
        if labels
        else "No task is open."
    )


def ask_obstacle(heard: Heard, fits: Sequence[str] = ()) -> str:
    """Ask which obstacle is meant."""
    known = list(fits) or list(heard.live.state.obstacles)
    if not known:
        return "No obstacle is known that could be removed."
    return f"Which obstacle? Say its name, e.g. '{known[0]}'. Known: {', '.join(known[:30])}"


def ask_robot(heard: Heard) -> str:
    """Ask which robot is meant."""
    robots = list(heard.live.state.robots)
    return f"Which robot? E.g. '{robots[0]}'. Known: {', '.join(robots[:30])}"


def ask(heard: Heard, missing: Sequence[str]) -> str:
    """Ask for parameters."""
    questions: dict[str, str] = {
        "location": ask_location(heard),
        "delivery_point": ask_delivery(heard),
        "obstacle_location": ask_extent(),
        "task_label": ask_label(heard),
        "obstacle": ask_obstacle(heard),
        "robot": ask_robot(heard),
        "priority": "Which priority: low, normal or high?",
        "task_type": f"Which type? {', '.join(heard.live.scene.mission.task_types)}",
        "obstacle_type": "Which kind is it, e.g. wall?",
    }
    return " ".join(questions[one] for one in missing)
