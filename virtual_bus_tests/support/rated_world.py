"""Conversations of a tool with simulated drives on a cable with bit rates, in virtual time."""

from __future__ import annotations

from typing import TypeVar

from canbase_commissioning.conversation import Conversation, ConversationError, Talk
from canbase_config.bit_rate import BIT_RATES
from canbase_config.robot import Robot
from canbase_driver.cia301.frame import Frame
from canbase_sim.cia301.dictionary import key
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.node import SimulatedNode
from canbase_sim.world.bench import Bench, BenchParameters
from canbase_sim.world.rated_wire import RatedWire
from support.sim_rig import robot as small_robot

T = TypeVar("T")
STEP_S = 0.001


class RatedWorld:
    """Two drives out of their boxes: node id 1 and 125 kbit/s both, serials 1A2Bh and 1A2Ch. `bitrate`: of the tool."""

    def __init__(self, of: Robot | None = None, bitrate: int = 125_000, *, factory_fresh: bool = True) -> None:
        self.now_s, self.bitrate = 100.0, bitrate
        robot = of or small_robot()
        self.bench = Bench(robot, self.now_s, parameters=BenchParameters(factory_fresh=factory_fresh))
        self.wire = RatedWire(self.bench, BIT_RATES)
        for number, node in enumerate(self.nodes):
            node.dictionary.values[key(0x1018, 4)] = 0x1A2B + number
            node.dictionary._fixed[key(0x1018, 4)] = 0x1A2B + number
            node.dictionary._factory[key(0x1018, 4)] = 0x1A2B + number
        self.errors = 0
        """Error frames that the tool has seen."""
        self.received: list[Frame] = []
        self.others: list[Frame] = []
        """Frames of another program at the bit rate of the tool; they are sent with the next turn."""
        self.wait(0.5)

    @property
    def nodes(self) -> tuple[SimulatedNode, ...]:
        """In the order of robot.yaml."""
        return tuple(self.bench.nodes.values())

    @property
    def settings(self) -> list[tuple[int, int]]:
        """Node id and bit rate of each drive."""
        return [(node.node_id, node.lss.bitrate) for node in self.nodes]

    def talk(self, steps: Talk[T], limit_s: float = 120.0) -> T:
        """The steps to their end. Raises ConversationError, and fails after `limit_s`."""
        conversation = Conversation(steps)
        end_s = self.now_s + limit_s
        while not conversation.done:
            assert self.now_s < end_s, "the conversation does not end"
            self.turn(conversation)
        if conversation.error is not None:
            raise conversation.error
        return conversation.result  # type: ignore[return-value]

    def why(self, steps: Talk[object]) -> str:
        """The sentence with which the steps end."""
        try:
            self.talk(steps)
        except ConversationError as error:
            return str(error)
        raise AssertionError("the steps came to their end")

    def power_cycle(self) -> None:
        """All drives off and on."""
        for node in self.nodes:
            node.power_cycle(self.now_s)
        self.wait(1.0)

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.turn(None)

    def turn(self, conversation: Conversation[T] | None) -> None:
        """1 ms."""
        self.now_s = round(self.now_s + STEP_S, 6)
        seen = []
        for frame in conversation.tick(self.now_s) if conversation else ():
            seen += self.wire.on_frame(BenchFrame(frame.cob_id, frame.data), self.bitrate, self.now_s)
        seen += self.wire.tick(self.now_s)
        while self.others:
            self._receive(self.others.pop(0), conversation)
        for bitrate, frame_, is_error in seen:
            if bitrate != self.bitrate:
                continue
            self.errors += is_error
            if not is_error:
                self._receive(Frame(frame_.cob_id, frame_.data), conversation)

    def _receive(self, frame: Frame, conversation: Conversation[T] | None) -> None:
        self.received.append(frame)
        if conversation is not None:
            conversation.on_frame(frame, self.now_s)
