"""Two drives of another author, the CiA 402 slave of ros2_canopen on lely-core, under an installed canbase.

They have no control socket: candump shows their positions, and their own log when their motor has stopped.
docs/verification.md has what differed.
"""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from canbase_config.commissioned import mark
from canbase_config.load import load_robot
from canbase_config.robot import Robot as Config
from canbase_sim.cia402.raw_units import Scale
from exit_matrix.stop_limits import ALLOWANCE_S
from vm.guest.candump import boot_s, samples, speed
from vm.guest.integrator import CANBASE
from vm.guest.robot import SPEED_MPS, Robot
from vm.guest.scenario import LATCHED, Row
from vm.guest.system import (
    ROBOT_YAML,
    STACKS,
    BrokenPromiseError,
    background,
    run,
    send_signal,
    unit,
    virtual_interface,
)

NAME: Final = "slaves"
BUS: Final = "vcan0"
CONFIG: Final = Path(f"/run/{NAME}.yaml")
DUMP: Final = Path("/run/candump.log")
STOPPED: Final = "Leaving run_profile_velocity_mode"
"""The slave logs it when its motor turns no longer."""
SHARE: Final = 0.05
"""How far the speed of a slave may be off: it integrates its position in steps of 10 ms and a little more."""


def drives_of_ros2_canopen(robot: Robot) -> Row:
    """They boot, are enabled and driven at speed. The driver is killed: the watchdog's quick stop stops both."""
    CONFIG.write_text(_config(ROBOT_YAML.read_text()))
    config = load_robot(CONFIG).robot
    with CONFIG.open("a") as file:
        print(f"commissioned: {{scale: {mark(config, 'scale')}}}", file=file)
    with virtual_interface(BUS), _candump(), _slaves(config):
        robot.spin(2.0)  # they send their boot-up after a second
        with _installed():
            _say("canbase is installed for them")
            base = Robot(f"{NAME}/", robot, "")
            base.make_ready()
            took_s = boot_s(DUMP.read_text().splitlines(), [drive.node_id for drive in config.drives])
            _say(f"enabled, {took_s:.2f} s after the driver's first heartbeat")
            base.order(SPEED_MPS)
            base.wait("speed", lambda: _slowest(config) >= (1.0 - SHARE) * SPEED_MPS, 10.0)
            base.spin(0.5)
            if (mps := _fastest(config)) > (1.0 + SHARE) * SPEED_MPS:
                raise BrokenPromiseError(f"a slave turns at {mps:.3f} m/s, ordered {SPEED_MPS} m/s")
            _say("they turn at speed")
            moment_s = time.time()
            send_signal("driver", signal.SIGKILL, NAME)
            base.spin(1.5)
            stood_s = max(_stopped(drive.node_id) for drive in config.drives) - moment_s
            base.stays_disarmed()
            base.order(None)
            _tripped("driver silent")
    limit_s = config.timeouts.drive_heartbeat_s + ALLOWANCE_S  # the slave has no ramp
    if not 0.0 <= stood_s <= limit_s:
        raise BrokenPromiseError(f"the slaves stood after {stood_s:.3f} s, limit {limit_s:.3f} s")
    caught, then = "watchdog: driver silent", f"{LATCHED}; boot: {took_s:.2f} s"
    return Row("drives of ros2_canopen", "driver SIGKILL", caught, stood_s, limit_s=limit_s, then=then)


def _say(what: str) -> None:
    """The host takes a guest that is silent for long for dead; beside an enabled robot this scenario takes minutes."""
    print(what, flush=True)


def _config(text: str) -> str:
    """The guest's robot with these drives: 60FFh in counts/s, which no step has shown yet."""
    text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("commissioned:"))
    text = text.replace("name: robot", f"name: {NAME}").replace("channel: can0", f"channel: {BUS}")
    text = text.replace("velocity_unit: rpm", "velocity_unit: counts/s")
    text = text.replace("    direction: -1", "    direction: -1\n    velocity_unit: counts/s")
    return text.replace("/run/canbase/robot/lease.sock", f"/run/canbase/{NAME}/lease.sock")


@contextmanager
def _candump() -> Iterator[None]:
    with DUMP.open("w") as file:
        process = subprocess.Popen(["candump", "-L", BUS], stdout=file)
        try:
            yield
        finally:
            process.kill()
            process.wait()


@contextmanager
def _slaves(config: Config) -> Iterator[None]:
    """Real time, as the simulated drives have it: no computer is too busy for a drive."""
    with ExitStack() as stack:
        for drive in config.drives:
            program = (str(STACKS / "cia402_slave"), BUS, str(drive.node_id), str(STACKS / "cia402_slave.eds"))
            stack.enter_context(background(_slave(drive.node_id), "chrt", "--fifo", "60", *program))
        yield


def _slave(node_id: int) -> str:
    return f"slave{node_id}.service"


@contextmanager
def _installed() -> Iterator[None]:
    run(*CANBASE, "setup", "install", "--config", str(CONFIG), "--no-can", "--namespace", NAME)
    try:
        run("systemctl", "start", f"canbase@{NAME}.target")
        yield
    finally:
        run(*CANBASE, "setup", "uninstall", NAME, "--purge")


def _speeds(config: Config) -> Iterator[float]:
    """Of each slave in the last half second of the dump, forward positive [m/s]."""
    lines = DUMP.read_text().splitlines()
    for drive in config.drives:
        counts_per_m = Scale.of(drive, config.base.wheel_radius_m).counts_per_m
        yield drive.direction * speed(samples(lines, drive.node_id), 0.5) / counts_per_m


def _slowest(config: Config) -> float:
    return min(_speeds(config))


def _fastest(config: Config) -> float:
    return max(_speeds(config))


def _stopped(node_id: int) -> float:
    """When its motor stopped last, by its own log [s, Unix time]."""
    lines = run("journalctl", "-b", "-q", "-o", "json", "-u", _slave(node_id)).splitlines()
    times = [int(entry["__REALTIME_TIMESTAMP"]) for entry in map(json.loads, lines) if STOPPED in entry["MESSAGE"]]
    if not times:
        raise BrokenPromiseError(f"node {node_id} turns on: its log has no {STOPPED!r}")
    return times[-1] / 1e6


def _tripped(cause: str) -> None:
    told = run("journalctl", "-b", "-q", "-o", "cat", "-u", unit("watchdog", NAME))
    if f"tripped: {cause}" not in told:
        raise BrokenPromiseError(f"the watchdog did not trip by {cause!r}: {told[-1500:]}")
