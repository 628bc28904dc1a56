"""Everything that may be asked of a running mission: one typed class per intent.

The classes are the one source of the JSON schema, of what the API takes, of what the program
explains and of what a language model may answer.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from oath.commands.command import Command, Live
from oath.commands.gate import Admitted, Trial, admit
from oath.commands.obstacles import ObstacleUpdate, RemoveObstacle
from oath.commands.robots import PauseRobot, ResumeRobot, RobotFailure
from oath.commands.tasks import AddTask, CancelTask, ChangeTaskPriority
from oath.commands.whole import QueryStatus, Undo
from oath.errors import BadInput, did_you_mean

__all__ = [
    "COMMANDS",
    "AddTask",
    "Admitted",
    "CancelTask",
    "ChangeTaskPriority",
    "Command",
    "Live",
    "ObstacleUpdate",
    "PauseRobot",
    "QueryStatus",
    "RemoveObstacle",
    "ResumeRobot",
    "RobotFailure",
    "Trial",
    "Undo",
    "admit",
    "parse",
    "schema",
    "to_plain",
]

COMMANDS: dict[str, type[Command]] = {
    command.intent: command
    for command in (
        AddTask,
        ObstacleUpdate,
        ChangeTaskPriority,
        CancelTask,
        RemoveObstacle,
        PauseRobot,
        ResumeRobot,
        RobotFailure,
        QueryStatus,
        Undo,
    )
}
"""Every command by its intent."""


def parse(value: object) -> Command:
    """Read a command from plain data, ``{"intent": ..., "parameters": {...}}``.

    Raises
    ------
    BadInput
        Naming the field, its value and the remedy.

    Examples
    --------
    >>> parse({"intent": "cancel_task", "parameters": {"task_label": "aa"}})
    CancelTask(task_label='aa')
    """
    if not isinstance(value, Mapping) or not isinstance(value.get("intent"), str):
        raise BadInput(
            "a command must be a mapping with an intent",
            field="intent",
            remedy=f"known: {', '.join(COMMANDS)}",
        )
    for key in value:
        if key not in ("intent", "parameters"):
            raise BadInput(f"unknown key {key!r}", field=str(key), remedy="give parameters")
    intent, parameters = value["intent"], value.get("parameters") or {}
    if intent not in COMMANDS:
        raise BadInput(
            f"unknown intent {intent!r}",
            field="intent",
            remedy=did_you_mean(intent, list(COMMANDS)),
        )
    if not isinstance(parameters, Mapping):
        raise BadInput("parameters must be a mapping", field="parameters", remedy="write {...}")
    try:
        return COMMANDS[intent].model_validate(dict(parameters))
    except ValidationError as error:
        raise _bad_parameter(intent, error) from None


def _bad_parameter(intent: str, error: ValidationError) -> BadInput:
    first = error.errors(include_url=False)[0]
    where = ".".join(map(str, first["loc"]))
    known = list(COMMANDS[intent].model_fields)
    if first["type"] == "extra_forbidden":
        return BadInput(
            f"{intent}: unknown parameter", field=where, remedy=did_you_mean(where, known)
        )
    if first["type"] == "missing":
        return BadInput(f"{intent}: {where} is missing", field=where, remedy="give it")
    problem = f"{intent}: {str(first['input'])[:60]!r}: {first['msg']}"
    return BadInput(problem, field=where, remedy=f"parameters: {', '.join(known)}")


def to_plain(command: Command) -> dict[str, Any]:
    """Return a command as plain data; `parse` reads it back."""
    return {
        "intent": command.intent,
        "parameters": command.model_dump(mode="json", exclude_none=True),
    }


def schema() -> dict[str, Any]:
    """The JSON schema of all commands as `parse` reads them."""
    choices = []
    for intent, command in COMMANDS.items():
        parameters = command.model_json_schema()
        parameters.pop("title", None)
        choices.append(
            {
                "type": "object",
                "title": intent,
                "description": parameters.pop("description", ""),
                "properties": {"intent": {"const": intent}, "parameters": parameters},
                "required": ["intent", "parameters"],
                "additionalProperties": False,
            }
        )
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "oneOf": choices}
