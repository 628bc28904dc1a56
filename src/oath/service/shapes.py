"""The shapes of what the API takes and gives, for its OpenAPI description."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, WithJsonSchema

from oath.commands import schema as command_schema
from oath.service.clock import FASTEST, SLOWEST

XY = Annotated[list[float], Field(min_length=2, max_length=2, description="[x, y] in metres")]


class Given(BaseModel):
    """Something that is sent to the server; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", strict=True)


class AnyCommand(Given):
    """A typed command as far as all of them are alike."""

    intent: str
    parameters: dict[str, Any]


def _every_command() -> dict[str, Any]:
    shape = command_schema()
    shape.pop("$schema")
    return shape


Command = Annotated[AnyCommand, WithJsonSchema(_every_command())]
"""A typed command; `oath.commands.parse` reads it."""


class Instruction(Given):
    """Words of an operator."""

    text: str = Field(min_length=1, max_length=2000)


class Commands(Given):
    """Typed commands that belong together: all of them are possible, or none is done."""

    commands: list[Command] = Field(min_length=1, max_length=20)


class IdentifiedCommands(Commands):
    """Typed commands that are done once, however often they are sent under this id."""

    id: str = Field(pattern=r"^[A-Za-z0-9._-]{1,64}$", description="unique; made by the client")


class ClockChange(Given):
    """How the mission clock should go; what is left out stays."""

    speed: Annotated[float, Field(ge=SLOWEST, le=FASTEST)] | None = None
    paused: bool | None = None
    step: bool | None = Field(None, description="go to the next event and hold there")


class Nothing(Given):
    """An empty object."""


class Problem(BaseModel):
    """What is wrong, where, and what to do about it."""

    problem: str
    field: str | None
    remedy: str


class Error(BaseModel):
    """Why a request was refused."""

    error: Problem


class Health(BaseModel):
    """The server works."""

    status: Literal["ok"]
    mission: str
    seq: int


class Me(BaseModel):
    """Who asks."""

    role: Literal["operator", "viewer"]


class MissionLine(BaseModel):
    """A mission of this server."""

    name: str
    running: bool
    tasks: int
    completed: int
    robots: int


class Missions(BaseModel):
    """The missions of this server."""

    missions: list[MissionLine]


class Grid(BaseModel):
    """A raster map: every run is the row, first and last column of occupied cells."""

    rows: int
    columns: int
    resolution: float
    origin: XY
    runs: list[Annotated[list[int], Field(min_length=3, max_length=3)]]


class MissionRobot(BaseModel):
    """A robot as the mission's file describes it."""

    id: str
    motion: str
    can: dict[str, float]
    capacity: int
    speed: float
    radius: float
    sensing: float


class MissionMotion(BaseModel):
    """A class of movement."""

    ignores: list[str]
    cost: dict[str, float]


class Mission(BaseModel):
    """What does not change while a mission runs."""

    name: str
    bounds: Annotated[list[float], Field(min_length=4, max_length=4)]
    walls: list[list[XY]]
    wall_thickness: float
    grid: Grid | None
    places: dict[str, XY]
    zones: dict[str, list[XY]]
    task_types: list[str]
    robots: list[MissionRobot]
    motions: dict[str, MissionMotion]
    rules: list[str]


class Roadmap(BaseModel):
    """Where robots can drive."""

    nodes: list[XY]
    edges: list[Annotated[list[int], Field(min_length=2, max_length=2)]]


class Clock(BaseModel):
    """How the mission clock goes."""

    speed: float
    paused: bool


class RouteStop(BaseModel):
    """A stop on a robot's route."""

    task: str
    stop: Literal["pickup", "delivery", "visit"]
    at: XY


class Robot(BaseModel):
    """A robot at some moment."""

    id: str
    position: XY
    heading: float
    status: Literal["idle", "driving", "serving", "paused", "failed"]
    carrying: list[str]
    route: list[RouteStop]
    path: list[XY]
    seen: float
    driven: float
    tasks: int


class TaskStop(BaseModel):
    """A stop of a task."""

    name: Literal["pickup", "delivery", "visit"]
    at: XY
    place: str | None
    served: bool


class Task(BaseModel):
    """A task at some moment."""

    id: str
    type: str
    priority: Literal["low", "normal", "high"]
    status: Literal["waiting", "assigned", "carried", "done", "stranded"]
    robot: str | None
    stops: list[TaskStop]
    reason: str | None


class Obstacle(BaseModel):
    """An obstacle that is known at some moment."""

    id: str
    kind: str
    polygon: list[XY]
    source: Literal["map", "found", "told"]


class Alert(BaseModel):
    """What an operator should know of."""

    t: float
    text: str


class State(BaseModel):
    """The mission at some moment."""

    seq: int
    t: float
    finished: bool
    clock: Clock
    robots: list[Robot]
    tasks: list[Task]
    obstacles: list[Obstacle]
    undo: str | None
    alerts: list[Alert]


class Event(BaseModel):
    """A line of the event log, schema oath/events/1."""

    model_config = ConfigDict(extra="allow")

    seq: int
    t: float
    type: str


class Events(BaseModel):
    """Events in order, and the number of the last there is."""

    events: list[Event]
    last: int


class PlainCommand(BaseModel):
    """A typed command."""

    intent: str
    parameters: dict[str, Any]


class Proposal(BaseModel):
    """Commands that wait for a confirmation."""

    id: str
    commands: list[PlainCommand]
    says: list[str]
    effect: list[str]
    expires_in: float


class Done(BaseModel):
    """What was asked for is in the journal, up to this event."""

    seq: int


class Reply(BaseModel):
    """What the server makes of an instruction."""

    status: Literal["complete", "need_more_info", "clarification"]
    intent: str | None
    parameters: dict[str, Any]
    missing: list[str]
    message: str
    proposal: Proposal | None
    done: Done | None


class Replied(BaseModel):
    """The answer to an instruction."""

    reply: Reply


class Commanded(BaseModel):
    """Commands are durable, up to this event; repeated if they were before."""

    seq: int
    repeated: bool
