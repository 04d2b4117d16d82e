"""A bench in virtual time under a test's hands: frames as text, SDO by object, a clock that the test moves."""

from __future__ import annotations

import struct
from typing import Any

from canbase_config.robot import Robot
from canbase_sim.cia301.dictionary import key
from canbase_sim.cia402.axis import Axis
from canbase_sim.cia402.states import State
from canbase_sim.frame import Frame
from canbase_sim.node import SimulatedNode
from canbase_sim.plant.base import PlantParameters
from canbase_sim.world.bench import Bench, BenchParameters

MPS = 9549
"""About 1 m/s at the rim in 0.1 rpm: wheel radius 0.1 m, gear 10, so 0.1 m/s is 955."""


AT_ONCE = BenchParameters(sdo_delay_s=0.0)
"""An SDO answer comes with the next step, so that a story is not full of waiting."""


def robot(*drives: dict[str, Any], **sections: Any) -> Robot:
    """Two drives on nodes 1 (left) and 2 (right, mirrored), or the given ones; 1 m/s is 9549 raw."""
    left = {"joint": "left", "node_id": 1, "side": "left"}
    right = {"joint": "right", "node_id": 2, "side": "right", "direction": -1}
    shared = {"gear_ratio": 10.0, "counts_per_motor_rev": 4096, "velocity_unit": "0.1rpm"}
    return Robot.model_validate(
        {
            "bus": {"interface": "virtual", "channel": "test"},
            "drives": tuple(shared | dict(drive) for drive in (drives or (left, right))),
            "base": {"wheel_radius_m": 0.1, "track_m": 0.5},
            "limits": {
                "linear_mps": 1.0,
                "angular_radps": 2.0,
                "acceleration_mps2": 1.0,
                "deceleration_mps2": 1.0,
                "emergency_deceleration_mps2": 2.0,
                "angular_acceleration_radps2": 4.0,
                "angular_deceleration_radps2": 5.0,
            },
            "safety": {
                "footprint": {"front_m": 0.3, "rear_m": 0.3, "left_m": 0.3, "right_m": 0.3},
                "scan": {"required": False},
                "estop": {"required": False},
            },
            "lease": {"socket": "/nowhere/lease.sock"},
        }
        | sections
    )


class Rig:
    """The bench and its clock. It starts with booted nodes; the frames until then are in `heard`."""

    def __init__(self, of: Robot | None = None, body: PlantParameters | None = None) -> None:
        self.bench = Bench(of or robot(), 0.0, body or PlantParameters(), AT_ONCE)
        self.now_s = 0.0
        self.heard: list[tuple[float, str]] = []
        self.wait(0.2)

    @property
    def node(self) -> SimulatedNode:
        """Node 1."""
        return self.bench.nodes[1]

    @property
    def axis(self) -> Axis:
        """The first axis of node 1."""
        return self.node.axes[0]

    def state(self) -> State:
        """CiA 402 state of the first axis of node 1."""
        return self.axis.state

    def wait(self, seconds: float, step_s: float = 0.001) -> list[str]:
        """Let time pass; the frames sent meanwhile, as "581 60 40 60 00 00 00 00 00"."""
        said: list[str] = []
        for _ in range(round(seconds / step_s)):
            self.now_s = round(self.now_s + step_s, 6)
            said += self._take()
        return said

    def tx(self, text: str) -> list[str]:
        """Send one frame, written as its COB-ID and bytes in hex; the frames that come at once."""
        cob_id, _, data = text.partition(" ")
        self.bench.on_frame(Frame(int(cob_id, 16), bytes.fromhex(data)), self.now_s)
        return self._take()

    def write(self, index: int, value: int, sub: int = 0, node: int = 1) -> str:
        """One expedited SDO download; "ok" or the abort code in hex."""
        code = self.bench.nodes[node].dictionary.entries[key(index, sub)].code
        data = struct.pack(f"<{code}", value)
        request = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, sub) + data.ljust(4, b"\0")
        raw = self._ask(node, request)
        return "ok" if raw[0] == 0x60 else f"{int.from_bytes(raw[4:], 'little'):08X}"

    def read(self, index: int, sub: int = 0, node: int = 1) -> int:
        """One expedited SDO upload of a number."""
        code = self.bench.nodes[node].dictionary.entries[key(index, sub)].code
        (value,) = struct.unpack_from(f"<{code}", self._ask(node, struct.pack("<BHBI", 0x40, index, sub, 0)), 4)
        return int(value)

    def enable(self, target: int = 0, mode: int = 3, node: int = 1) -> None:
        """Bring the first axis of a node to OPERATION ENABLED with ramps of 1 m/s² and a quick stop of 2 m/s²."""
        for index, value in ((0x6083, MPS), (0x6084, MPS), (0x6085, 2 * MPS), (0x6060, mode), (0x60FF, target)):
            assert self.write(index, value, node=node) == "ok"
        for word in (0x06, 0x07, 0x0F):
            assert self.write(0x6040, word, node=node) == "ok"

    def drive(self, left: int, right: int, seconds: float, mode: int = 3) -> None:
        """Enable both wheels with targets forward positive (the right one is mounted mirrored), and let time pass."""
        self.enable(left, mode, node=1)
        self.enable(-right, mode, node=2)
        self.wait(seconds)

    def _ask(self, node: int, request: bytes) -> bytes:
        said = self.tx(f"{0x600 + node:03X} {request.hex()}")
        (answer,) = [text for text in said if text.startswith(f"{0x580 + node:03X} ")]  # EMCYs may come with it
        return bytes.fromhex(answer[4:])

    def _take(self) -> list[str]:
        said = [f"{frame.cob_id:03X} {frame.data.hex(' ').upper()}".strip() for frame in self.bench.tick(self.now_s)]
        self.heard += [(self.now_s, text) for text in said]
        return said
