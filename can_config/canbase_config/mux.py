"""The keys of robot.yaml below `mux`: the sources of velocity commands."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from canbase_config.section import MisfitError, Name, Section, Topic


class MuxSource(Section):
    """One source of velocity commands."""

    topic: Annotated[Topic, Field(description="relative to the node's namespace")]
    priority: Annotated[int, Field(ge=0, le=255, description="the higher wins; no two alike")]
    timeout_s: Annotated[float, Field(ge=0.05, le=2.0, description="silent for longer: holds no more [s]")]
    stamped: Annotated[bool, Field(description="true: TwistStamped, false: Twist")] = True


DEFAULT_SOURCES = {
    "joystick": MuxSource(topic="cmd_vel_joy", priority=100, timeout_s=0.3),
    "navigation": MuxSource(topic="cmd_vel_nav", priority=50, timeout_s=0.5),
    "action": MuxSource(topic="cmd_vel_action", priority=40, timeout_s=0.3),
}


class Mux(Section):
    """Who may drive."""

    sources: Annotated[dict[Name, MuxSource], Field(min_length=1)] = DEFAULT_SOURCES

    @model_validator(mode="after")
    def _no_two_alike(self) -> Mux:
        for what in ("priority", "topic"):
            seen: dict[object, str] = {}
            for name, source in self.sources.items():
                other = seen.setdefault(getattr(source, what), name)
                if other != name:
                    message = f"sources {other} and {name} have the same {what}; each needs its own"
                    raise MisfitError(message, ("sources", name, what))
        return self
