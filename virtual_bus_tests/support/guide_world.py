"""A guided procedure before simulated drives in virtual time, with a person who answers from a list."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

from canbase_commissioning.guide import Guide, Script, Tell
from canbase_commissioning.powered_drives import PoweredDrives
from canbase_commissioning.safe_stop import SafeStop
from canbase_config.robot import Robot
from support.session_world import SessionWorld

T = TypeVar("T")


class GuideWorld(SessionWorld):
    """`told`: the reports of the procedure; `answers`: by the key of the question, words or how to find them."""

    def __init__(
        self,
        robot: Robot | None = None,
        drives: Robot | None = None,
        answers: Mapping[str, str | Callable[[], str]] | None = None,
    ) -> None:
        super().__init__(robot, drives)
        self.told: list[Tell] = []
        self.asked: list[str] = []
        self.answers = dict(answers or {})
        self.rig = PoweredDrives(self.robot)
        self.wait(1.0)

    def guide(self, script: Callable[[PoweredDrives], Script[T]], limit_s: float = 300.0) -> T:
        """The whole script, then the farewell; what it returned. Raises what it raised, after the farewell too."""
        guide = Guide(self.rig, script(self.rig), self.told.append)
        start = self.now_s
        try:
            while not guide.done:
                assert self.now_s - start < limit_s, f"the procedure does not end: {self.told[-1:]}"
                self.turn(guide)
                if guide.question is not None:
                    self.asked.append(guide.question.key)
                    answer = self.answers[guide.question.key]
                    guide.answer(answer if isinstance(answer, str) else answer())
        finally:
            self.run(SafeStop(self.rig))
        assert guide.result is not None
        return guide.result

    @property
    def speeds(self) -> tuple[float, float]:
        """What the rims really do [m/s]."""
        truth = self.bench.truth(self.now_s)
        return truth.v_left_mps, truth.v_right_mps
