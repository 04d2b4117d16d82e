"""The keys of robot.yaml below `mux`: the sources of velocity commands, the locks, and who may publish them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Final, Literal

from pydantic import Field, field_validator, model_validator

from canbase_config.section import MisfitError, Name, NodeName, Section, Topic

OUTPUTS: Final = ("cmd_vel_mux", "cmd_vel")
"""Topics that the chain itself publishes: with such a source the robot would follow its own last command for ever."""
MEASURED: Final = "joint_states"
"""Topic of the measured wheel speeds: with this source the robot would follow its own motion for ever."""
JOINTS: Final = "joint_command"
"""The type of a source that orders the speed of each wheel."""


NEUTRAL_AFTER_S: Final = 2.0
"""Of a program that begins with a velocity: far longer than a radio gap [s]."""
PROGRAMS: Final = ("navigation", "action")
"""Sources with one of these names may start without a zero command, unless their key neutral_after_s is set."""


class MuxSource(Section):
    """One source of velocity commands."""

    topic: Annotated[Topic, Field(description="relative to the node's namespace; with a leading / absolute")]
    priority: Annotated[
        int,
        Field(ge=0, le=255, description="the highest fresh source is active; each value once, see equal_priorities"),
    ]
    timeout_s: Annotated[float, Field(ge=0.05, le=2.0, description="without a message for longer: not active [s]")]
    type: Annotated[
        Literal["twist", "joint_command"],
        Field(description="twist: velocities of the base; joint_command: JointState, wheel speeds of ros2_control"),
    ] = "twist"
    stamped: Annotated[bool, Field(description="true: TwistStamped, false: Twist")] = True
    nodes: Annotated[
        tuple[NodeName, ...],
        Field(min_length=0, max_length=16, strict=False, description="ROS nodes that may publish there; empty: all"),
    ] = ()
    neutral_after_s: Annotated[
        float | None,
        Field(
            ge=1.0,
            le=60.0,
            description="without a message for longer: may start without a zero command; null: never [s]",
        ),
    ] = None
    same_clock: Annotated[
        bool,
        Field(description="true: its stamps use this computer's clock, or one kept in step: their age is the delay"),
    ] = True

    @property
    def message_type(self) -> str:
        """The ROS type of its messages."""
        if self.type == JOINTS:
            return "sensor_msgs/msg/JointState"
        return "geometry_msgs/msg/TwistStamped" if self.stamped else "geometry_msgs/msg/Twist"

    @model_validator(mode="after")
    def _one_silence(self) -> MuxSource:
        """A source that is still active is not absent."""
        if self.neutral_after_s is not None and self.neutral_after_s < self.timeout_s:
            message = (
                f"without a message the source is active for timeout_s ({self.timeout_s:g}); only then is it absent: "
                f"neutral_after_s ({self.neutral_after_s:g}) must not be less"
            )
            raise MisfitError(message, ("neutral_after_s",), ("timeout_s",))
        return self

    @model_validator(mode="after")
    def _joint_commands(self) -> MuxSource:
        """Hardware of ros2_control publishes zero while nothing is ordered: a zero can be waited for."""
        if self.type == JOINTS and not self.stamped:
            raise MisfitError("a JointState always has a header; leave stamped out", ("stamped",))
        if self.type == JOINTS and self.neutral_after_s is not None:
            message = f"a {JOINTS} publishes zero while nothing is ordered; only that may arm it: leave it out"
            raise MisfitError(message, ("neutral_after_s",))
        return self


class MuxLock(Section):
    """A topic (std_msgs/Bool, true = locked) that holds back every source whose priority is lower than its own."""

    topic: Annotated[Topic, Field(description="relative to the node's namespace; with a leading / absolute")]
    priority: Annotated[
        int, Field(ge=0, le=255, description="blocks sources with a lower priority, not those with the same one")
    ]
    required: Annotated[bool, Field(description="true: locked while no message arrives")] = True
    timeout_s: Annotated[
        float, Field(ge=0.05, le=5.0, description="without a message for longer: locked, if required [s]")
    ] = 0.5


DEFAULT_SOURCES = {
    "joystick": MuxSource(topic="cmd_vel_joy", priority=100, timeout_s=0.3),
    "navigation": MuxSource(topic="cmd_vel_nav", priority=50, timeout_s=0.5, neutral_after_s=NEUTRAL_AFTER_S),
    "action": MuxSource(
        topic="cmd_vel_action",
        priority=40,
        timeout_s=0.3,
        nodes=("drive_distance_server",),
        neutral_after_s=NEUTRAL_AFTER_S,
    ),
}


class Mux(Section):
    """The sources of velocity commands, and the locks that block them."""

    sources: Annotated[dict[Name, MuxSource], Field(min_length=1, description="velocity sources, by name")] = (
        DEFAULT_SOURCES
    )
    locks: dict[Name, MuxLock] = Field(default_factory=dict, description="locks that block sources, by name")
    foreign_publishers: Annotated[
        Literal["report", "lock"],
        Field(
            description="publishers on sources' topics and cmd_vel that no key names: report, or report and order zero"
        ),
    ] = "report"
    equal_priorities: Annotated[
        Literal["refuse", "by_name"],
        Field(description="sources of one priority: refuse them, or the first by name is active, as in twist_mux"),
    ] = "refuse"
    twist_mux: Annotated[
        tuple[Annotated[str, Field(min_length=1, max_length=400)], ...],
        Field(min_length=0, max_length=8, strict=False, description="parameter files of twist_mux, added to the above"),
    ] = ()
    twist_mux_timeout_s: Annotated[
        float | None,
        Field(
            ge=0.05,
            le=2.0,
            description="timeout of topics of these files that have timeout 0; null: they are refused [s]",
        ),
    ] = None

    twist_mux_rename: dict[Topic, Topic] = Field(
        default_factory=dict, description="topics of these files, and their names here: {cmd_vel: cmd_vel_external}"
    )

    @property
    def action_source(self) -> str:
        """Name of the source that receives the commands of goals; empty when there is none."""
        ours = ("cmd_vel_action", "geometry_msgs/msg/TwistStamped")
        return next((name for name, each in self.sources.items() if (each.topic, each.message_type) == ours), "")

    @field_validator("sources", mode="before")
    @classmethod
    def _programs(cls, sources: Any) -> Any:
        """What is no section is reported by the model."""
        if not isinstance(sources, dict):
            return sources
        return {
            name: {"neutral_after_s": NEUTRAL_AFTER_S, **source}
            if name in PROGRAMS and isinstance(source, dict) and source.get("type") != JOINTS
            else source
            for name, source in sources.items()
        }

    @model_validator(mode="after")
    def _fits_together(self) -> Mux:
        if self.equal_priorities == "refuse":
            self._no_two_alike("priority", lambda source: source.priority, ", or set equal_priorities: by_name")
        self._no_two_alike("topic", lambda source: same_topic(source.topic))
        for name, source in self.sources.items():
            if same_topic(source.topic) in (*OUTPUTS, MEASURED):
                message = (
                    f"{source.topic} is an output of this robot; a source needs another topic "
                    "(mux.twist_mux_rename renames that of a twist_mux file)"
                )
                raise MisfitError(message, ("sources", name, "topic"))
        for name, lock in self.locks.items():
            self._check_lock(name, lock)
        return self

    def _no_two_alike(self, what: str, value: Callable[[MuxSource], object], cure: str = "") -> None:
        seen: dict[object, str] = {}
        for name, source in self.sources.items():
            other = seen.setdefault(value(source), name)
            if other != name:
                message = f"sources {other} and {name} have the same {what}; each needs its own{cure}"
                raise MisfitError(message, ("sources", name, what))

    def _check_lock(self, name: str, lock: MuxLock) -> None:
        if same_topic(lock.topic) in {same_topic(source.topic) for source in self.sources.values()}:
            message = f"{lock.topic} is the topic of a source too; a lock needs one of its own"
            raise MisfitError(message, ("locks", name, "topic"))
        lowest = min(source.priority for source in self.sources.values())
        if lock.priority <= lowest:
            message = f"{lock.priority} blocks no source: the lowest source has {lowest}, and a lock must be above it"
            raise MisfitError(message, ("locks", name, "priority"))


def same_topic(topic: str) -> str:
    """`joy_vel` for `/joy_vel` too: without a namespace both are one topic, and with one they look like one."""
    return topic.removeprefix("/")
