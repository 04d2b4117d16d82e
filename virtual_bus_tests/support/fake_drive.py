"""A drive of a few lines that keeps CiA 301's rules for PDOs, and the wire between it and a boot, in virtual time."""

from collections.abc import Callable
from dataclasses import dataclass, field

from canbase_config.drive import Drive
from canbase_config.robot import Robot
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.cia301.frame import Frame

Key = tuple[int, int]
OFF = 0x8000_0000

NO_OBJECT, NO_SUB, READ_ONLY, WRITE_ONLY, UNSUPPORTED = 0x06020000, 0x06090011, 0x06010002, 0x06010001, 0x06010000
INVALID, DEVICE_STATE = 0x06090030, 0x08000022


def u8(value: int) -> bytes:
    return value.to_bytes(1, "little")


def u16(value: int) -> bytes:
    return value.to_bytes(2, "little")


def u32(value: int) -> bytes:
    return value.to_bytes(4, "little")


def factory_objects(axes: tuple[int, ...] = (0,), pdos: int = 4, consumers: int = 2) -> dict[Key, bytes]:
    """What a drive has when it comes out of its box: every PDO on, with something else in it."""
    objects = {
        (0x1000, 0): u32(0x0002_0192),
        (0x1016, 0): u8(consumers),
        (0x1017, 0): u16(0),
        (0x1018, 1): u32(0x1111),
        (0x1018, 2): u32(0x2222),
        (0x1018, 3): u32(0x0001_0002),
        (0x1018, 4): u32(0x4444),
        (0x1029, 1): u8(1),
    }
    objects |= {(0x1016, 1 + i): u32(0) for i in range(consumers)}
    for axis in axes:
        base = 0x6000 + 0x800 * axis
        objects |= {(base + 0x07, 0): u16(0), (base + 0x40, 0): u16(0), (base + 0x41, 0): u16(0x0240)}
        objects |= {(base + 0x5A, 0): u16(6), (base + 0x5E, 0): u16(0), (base + 0x60, 0): u8(1)}
        objects |= {(base + 0x6C, 0): u32(0), (base + 0x77, 0): u16(0), (base + 0xFF, 0): u32(777)}
        objects |= {(base + ramp, 0): u32(10) for ramp in (0x83, 0x84, 0x85)}
    for i in range(pdos):
        for communication, cob_id in ((0x1400, 0x4000_0200), (0x1800, 0x4000_0180)):
            objects |= {(communication + i, 1): u32(cob_id + 0x100 * i + 1), (communication + i, 2): u8(254)}
            objects |= {(communication + 0x200 + i, sub): u32(0) for sub in range(1, 5)}
            objects |= {(communication + 0x200 + i, 0): u8(1), (communication + 0x200 + i, 1): u32(0x20000020)}
    return objects


@dataclass
class FakeDrive:
    """An SDO server with CiA 301's rules for PDOs. `refuse` aborts writes, `on_write` may have side effects."""

    node_id: int = 1
    objects: dict[Key, bytes] = field(default_factory=factory_objects)
    refuse: dict[Key, int] = field(default_factory=dict)
    refuse_read: dict[Key, int] = field(default_factory=dict)
    on_write: dict[Key, Callable[["FakeDrive", bytes], None]] = field(default_factory=dict)
    answers_nmt_reset: bool = True
    powered: bool = True
    writes: list[tuple[int, int, int]] = field(default_factory=list)
    nmt: list[int] = field(default_factory=list)
    transfers: int = 0

    def on_frame(self, frame: Frame) -> list[Frame]:
        if not self.powered:
            return []
        if frame.cob_id == 0x000 and frame.data[1] == self.node_id:
            self.nmt.append(frame.data[0])
            is_reset = frame.data[0] == 0x82 and self.answers_nmt_reset
            return [Frame(0x700 + self.node_id, b"\0")] if is_reset else []
        if frame.cob_id != 0x600 + self.node_id or frame.data[0] == 0x80:
            return []
        self.transfers += 1
        return [Frame(0x580 + self.node_id, self._serve(frame.data))]

    def _serve(self, data: bytes) -> bytes:
        key = (int.from_bytes(data[1:3], "little"), data[3])
        is_read = data[0] == 0x40
        abort = self._abort_of_read(key) if is_read else self._write(key, data[4 : 8 - (data[0] >> 2 & 3)])
        if abort:
            return b"\x80" + data[1:4] + u32(abort)
        if is_read:
            value = self.objects[key]
            return u8(0x43 | (4 - len(value)) << 2) + data[1:4] + value.ljust(4, b"\0")
        return b"\x60" + data[1:4] + bytes(4)

    def _abort_of_read(self, key: Key) -> int:
        if key in self.objects:
            return self.refuse_read.get(key, 0)
        return NO_SUB if any(key[0] == index for index, _ in self.objects) else NO_OBJECT

    def _write(self, key: Key, data: bytes) -> int:
        missing = key not in self.objects and self._abort_of_read(key)
        abort = missing or self.refuse.get(key) or self._refused_by_pdo_rules(key, data)
        if not abort:
            self.objects[key] = data
            self.writes.append((*key, int.from_bytes(data, "little")))
            if key in self.on_write:
                self.on_write[key](self, data)
        return abort

    def _refused_by_pdo_rules(self, key: Key, data: bytes) -> int:
        index, sub = key
        if index in range(0x1600, 0x1800) or index in range(0x1A00, 0x1C00):
            is_on = not self.number(index - 0x200, 1) & OFF
            return UNSUPPORTED if is_on or (sub and self.number(index, 0)) else 0
        if index in range(0x1400, 0x1C00) and sub == 1:
            new, old = int.from_bytes(data, "little"), self.number(index, 1)
            changes_id = not (new | old) & OFF and (new ^ old) & 0x7FF
            is_empty = not new & OFF and not self.number(index + 0x200, 0)
            return INVALID if changes_id or is_empty or (new ^ old) & 0x4000_0000 else 0
        return 0

    def number(self, index: int, sub: int = 0) -> int:
        return int.from_bytes(self.objects[index, sub], "little")


class Bench:
    """One node's boot and its drive, joined by a wire without delay; the clock moves in steps of 10 ms."""

    def __init__(
        self, drive: FakeDrive, robot: Robot, drives: tuple[Drive, ...] | None = None, *, identify: bool = True
    ) -> None:
        """`identify`: False: the boot of a driver, which reads what it compares."""
        self.boot = NodeBoot(drive.node_id, drives or robot.drives[:1], robot, identify=identify)
        self.drive = drive
        self.now_s = 100.0

    def run(self, seconds: float = 30.0) -> NodeBoot:
        for _ in range(round(seconds / 0.01)):
            self._exchange()
            if self.boot.done:
                break
            self.now_s += 0.01
        return self.boot

    def _exchange(self) -> None:
        while sent := self.boot.tick(self.now_s):
            for frame in sent:
                for answer in self.drive.on_frame(frame):
                    self.boot.on_frame(answer, self.now_s)


def robot(**identity: int) -> Robot:
    wheel = {"gear_ratio": 20.0, "counts_per_motor_rev": 4096}
    return Robot.model_validate(
        {
            "bus": {"interface": "virtual", "channel": "test"},
            "drives": (
                {"joint": "left", "node_id": 1, "side": "left", "identity": identity, **wheel},
                {"joint": "right", "node_id": 1, "axis": 1, "side": "right", "direction": -1, **wheel},
            ),
            "base": {"wheel_radius_m": 0.1, "track_m": 0.5},
            "limits": {
                "linear_mps": 1.0,
                "angular_radps": 2.0,
                "acceleration_mps2": 0.5,
                "deceleration_mps2": 0.5,
                "emergency_deceleration_mps2": 1.5,
                "angular_acceleration_radps2": 2.0,
                "angular_deceleration_radps2": 6.0,
            },
            "safety": {
                "footprint": {"front_m": 0.3, "rear_m": 0.3, "left_m": 0.3, "right_m": 0.3},
                "scan": {"required": False},
                "estop": {"required": False},
            },
            "lease": {"socket": "/run/test/lease"},
        }
    )


def boot_one_axis(drive: FakeDrive) -> NodeBoot:
    return Bench(drive, robot()).run()


def error_of(boot: NodeBoot) -> str:
    assert boot.report is None
    assert boot.error is not None
    return str(boot.error)


def notes_of(boot: NodeBoot) -> tuple[str, ...]:
    assert boot.error is None
    assert boot.report is not None
    return boot.report.notes
