"""CANopenNode on a virtual interface: its gateway (CiA 309-3) is the master of the simulated drives, and its slave is
adopted by `canbase bus adopt`.

The gateway reads, writes, is refused, gives node ids, enables the motors and drives; then its process is killed.
docs/verification.md has what differed.
"""

from __future__ import annotations

import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from canbase_config.robot import Robot as Config
from canbase_sim.cia402.raw_units import Scale
from canbase_sim.control import SimControl
from exit_matrix.stop_limits import ALLOWANCE_S, quick
from vm.guest.integrator import CANBASE
from vm.guest.robot import SPEED_MPS, Robot
from vm.guest.scenario import Row, timed
from vm.guest.standstill import standstill
from vm.guest.system import LIMIT_S, ROBOT_YAML, STACKS, BrokenPromiseError, background, run, virtual_interface

BUS: Final = "vcan0"
CONFIG: Final = Path("/run/bench.yaml")
CONTROL: Final = Path("/run/bench.sock")
COMMANDS: Final = Path("/run/canopend.sock")
DRIVES: Final = "bench-drives.service"
DEVICE: Final = "canopend.service"
PROGRAM: Final = str(STACKS / "canopend")
MASTER: Final = 100
"""Node id of the gateway."""
BEAT_MS, LOST_MS = 100, 300
"""Of its heartbeat: 1017h, and 1016h of the drives."""
ANSWER_S: Final = 20.0
"""Longest wait for an answer of the gateway; it gives up an SDO transfer after half a second."""
OPERATION_ENABLED: Final = 0x27
"""6041h with mask 6Fh."""
SCAN_STEP_MS: Final = 20
"""Its wait for an answer to each of 132 requests for one drive."""

READS_AND_REFUSALS: Final = (
    ("1 r 0x1000 0 x32", "0x00020192"),
    ("2 r 0x1000 0 x32", "0x00020192"),
    ("1 r 0x1008 0 vs", '"canbase simulated drive"'),
    ("set sdo_block 1", "OK"),
    ("1 r 0x1008 0 vs", '"canbase simulated drive"'),
    ("set sdo_block 0", "OK"),
    ("1 r 0x2000 0 u8", "ERROR:0x06020000"),
    ("1 r 0x1018 9 u8", "ERROR:0x06090011"),
    ("1 w 0x6041 0 u16 1", "ERROR:0x06010002"),
    ("1 w 0x6040 0 u8 6", "ERROR:0x06070010"),
)
"""Commands of CiA 309-3 and how their answers begin: expedited, segmented, by block; four abort codes of CiA 301."""
NODE_IDS_GONE: Final = ("lss_switch_glob 1", "lss_set_node 255", "lss_switch_glob 0", "0 reset communication")
FOUND: Final = (
    "# Node-ID 2 assigned to: 0x00000000 0x000CB402 0x00010000 0x00000001",
    "# Node-ID 3 assigned to: 0x00000000 0x000CB402 0x00010000 0x00000002",
    "# Found 2 nodes, search finished.",
    "OK",
)


class Gateway:
    """The command socket of CANopenNode's gateway."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(ANSWER_S)
        self._socket.connect(str(COMMANDS))
        self._lines = self._socket.makefile("rb")

    def ask(self, command: str) -> list[str]:
        """The lines of the answer, without the number of the command."""
        self._socket.sendall(f"[1] {command}\n".encode())
        answer: list[str] = []
        while True:
            line = self._lines.readline().decode().strip()
            answer.append(line.removeprefix("[1] "))
            if line.startswith("[1]") or not line:
                return answer

    def gets(self, command: str, wanted: str) -> None:
        """Raises BrokenPromiseError unless the answer begins like this."""
        *_, answer = self.ask(command)
        if not answer.startswith(wanted):
            raise BrokenPromiseError(f"CANopenNode's {command!r} was answered {answer!r}, expected {wanted!r}")

    def close(self) -> None:
        """Hang up."""
        self._lines.close()
        self._socket.close()


def canopennode(robot: Robot) -> Row:
    """Killed at speed: each drive misses its heartbeat, and stops by itself."""
    text = ROBOT_YAML.read_text().replace("name: robot", "name: bench").replace("channel: can0", f"channel: {BUS}")
    CONFIG.write_text(text)
    with virtual_interface(BUS):
        with _drives(robot) as drives, gateway(robot) as commands:
            for command, answer in READS_AND_REFUSALS:
                commands.gets(command, answer)
            row = _killed_at_speed(robot, drives, commands)
        with _drives(robot), gateway(robot) as commands:
            _gives_node_ids(robot, commands)
        _is_adopted(robot)
    return row


@contextmanager
def _drives(robot: Robot) -> Iterator[SimControl]:
    command = (*CANBASE, "serve", "sim", "--config", str(CONFIG), "--control", str(CONTROL))
    with background(DRIVES, *command):
        robot.wait("the simulated drives", CONTROL.exists)
        with SimControl(CONTROL, timeout_s=ANSWER_S) as drives:
            robot.wait("their boot", lambda: drives.truth().standing_s > 0.5)
            yield drives
    CONTROL.unlink(missing_ok=True)


@contextmanager
def gateway(robot: Robot, bus: str = BUS) -> Iterator[Gateway]:
    """CANopenNode as the master of this interface, until it is left."""
    with background(DEVICE, PROGRAM, bus, "-i", str(MASTER), "-c", f"local-{COMMANDS}"):
        robot.wait("CANopenNode's gateway", COMMANDS.exists)
        commands = Gateway()
        try:
            yield commands
        finally:
            commands.close()
    COMMANDS.unlink(missing_ok=True)


def _killed_at_speed(robot: Robot, drives: SimControl, commands: Gateway) -> Row:
    config = robot.config
    commands.gets(f"{MASTER} w 0x1017 0 u16 {BEAT_MS}", "OK")
    for command in (command for drive in config.drives for command in _set_up(config, drive.node_id)):
        commands.gets(command, "OK")
    for drive, target in zip(config.drives, targets(config), strict=True):
        commands.gets(f"{drive.node_id} w 0x60FF 0 i32 {target}", "OK")
    robot.wait("speed", lambda: drives.truth().linear_mps >= 0.97 * SPEED_MPS, 10.0)
    status = int(commands.ask("1 r 0x6041 0 u16")[-1])
    if status & 0x6F != OPERATION_ENABLED:
        raise BrokenPromiseError(f"CANopenNode reads 6041h as {status:04X}h of a drive that turns")
    moment_s = time.monotonic()
    run("systemctl", "kill", "--signal=KILL", DEVICE)
    robot.wait("standstill", lambda: drives.truth().standing_s >= 0.3, 10.0)
    stop = standstill(drives.trace(moment_s), moment_s)
    limit_s = LOST_MS / 1000.0 + quick(config, SPEED_MPS) + ALLOWANCE_S
    return timed(Row("master of CANopenNode", "SIGKILL at speed"), stop, limit_s, "drives: heartbeat lost")


def _set_up(config: Config, node_id: int) -> Iterator[str]:
    """NMT start, the heartbeat, the stop that follows its loss, ramps, then OPERATION ENABLED."""
    scale = Scale.of(config.drives[0], config.base.wheel_radius_m)
    yield f"{node_id} start"
    yield f"{node_id} w 0x1016 1 u32 {MASTER << 16 | LOST_MS:#x}"
    yield f"{node_id} w 0x6007 0 i16 3"
    yield f"{node_id} w 0x605A 0 i16 2"
    yield f"{node_id} w 0x6060 0 i8 3"
    for index, mps2 in (("6083", config.limits.acceleration_mps2), ("6085", config.limits.emergency_deceleration_mps2)):
        yield f"{node_id} w 0x{index} 0 u32 {round(mps2 / scale.slope_mps2)}"
    for word in (6, 7, 15):
        yield f"{node_id} w 0x6040 0 u16 {word}"


def targets(config: Config) -> Iterator[int]:
    """60FFh of each drive at the speed of the scenarios."""
    for drive in config.drives:
        yield round(drive.direction * SPEED_MPS / Scale.of(drive, config.base.wheel_radius_m).target_mps)


def _gives_node_ids(robot: Robot, commands: Gateway) -> None:
    """By LSS to drives that have none: its fastscan finds both."""
    for command in NODE_IDS_GONE:
        commands.gets(command, "OK")
    robot.spin(1.0)  # the drives boot again
    answer = commands.ask(f"lss_allnodes {SCAN_STEP_MS}")
    if answer != list(FOUND):
        raise BrokenPromiseError(f"CANopenNode's LSS master: {answer}, expected {FOUND}")
    commands.gets("3 r 0x1018 4 x32", "0x00000002")


def _is_adopted(robot: Robot) -> None:
    """A slave without a node id gets one from `canbase bus adopt`, which then reports that it is no drive."""
    command = (*CANBASE, "bus", "adopt", "--interface", "socketcan", "--channel", BUS, "--yes")
    with background(DEVICE, PROGRAM, BUS, "-i", "0xFF"):
        robot.spin(1.0)
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    if done.returncode != 1 or "node 1 refuses 6041h, so it is no CiA 402 drive" not in done.stderr:
        raise BrokenPromiseError(f"canbase bus adopt: exit code {done.returncode}: {done.stdout}{done.stderr}")
