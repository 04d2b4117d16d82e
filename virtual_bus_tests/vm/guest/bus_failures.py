"""Between computer and drives: interface down, adapter unplugged, adapter in trouble, a drive without power."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from exit_matrix import stop_limits as by
from vm.guest.robot import Robot
from vm.guest.scenario import LATCHED, Row, elapsed, judged
from vm.guest.system import PARTS, ROBOT_YAML, TARGET, BrokenPromiseError, run, unit

NODE = 1
DEVICE = Path("/sys/class/net")
SLCAN = "slcan0"


def link_down(robot: Robot) -> Row:
    """Driver and watchdog are both cut off: the drives' own heartbeat consumers stop the wheels."""
    robot.make_ready()
    robot.drive()
    moment_s = time.monotonic()
    run("ip", "link", "set", "can0", "down")
    stop = robot.stands(moment_s)
    stood_s = time.monotonic()
    robot.spin(1.0)
    run("ip", "link", "set", "can0", "up")
    up_s = time.monotonic()
    robot.stays_disarmed(2.0)
    robot.stays(stood_s)
    robot.make_ready()
    row = Row("can0", "down, up", again_s=elapsed(up_s), then=LATCHED)
    return judged(row, robot, moment_s, stop, (by.DRIVES,))


def unplugged(robot: Robot) -> Row:
    """The adapter is gone, and comes back: the host does it when it reads these lines."""
    robot.make_ready()
    robot.drive()
    asked_s = time.monotonic()
    print("@host device_del", flush=True)
    robot.wait("can0 to go", lambda: not (DEVICE / "can0").exists())
    gone_s = time.monotonic()
    stop = robot.stands(gone_s)
    stood_s = time.monotonic()
    robot.spin(1.0)
    print("@host device_add", flush=True)
    robot.wait("can0 to come back up", lambda: _is_up("can0"))
    back_s = time.monotonic()
    robot.stays_disarmed()
    robot.stays(stood_s)
    robot.make_ready()
    row = Row("adapter", "unplugged, plugged in", again_s=elapsed(back_s), then=LATCHED)
    return judged(row, robot, asked_s, stop, (by.DRIVES,))


def power_cut(robot: Robot) -> Row:
    """One of two drives is without its supply for half a second: its wheel coasts."""
    robot.make_ready()
    robot.drive()
    moment_s = time.monotonic()
    robot.sim.fault(NODE, "power_cycle")
    stop = robot.stands(moment_s)
    stood_s = time.monotonic()
    robot.spin(1.5)
    robot.stays_disarmed()
    robot.stays(stood_s)
    row = Row("a drive", "without power for 0.5 s", then=LATCHED)
    layers = (by.DRIVER_DRIVE_GONE, by.DRIVER_DRIVE_RESTARTED, by.WATCHDOG_DRIVE_GONE)
    return judged(row, robot, moment_s, stop, layers)


class SerialAdapter:
    """The robot on a serial adapter (slcan), whose other end is a program here. It stays until the reboot."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def say(self, word: str) -> None:
        """A word of slcan_adapter.py."""
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.write(f"{word}\n")
        self._process.stdin.flush()

    def use(self, robot: Robot) -> None:
        """Driver and watchdog are on it afterwards."""
        if self._process is not None:
            return
        robot.order(None)
        run("systemctl", "stop", TARGET, *(unit(part) for part in PARTS))
        module = [sys.executable, "-m", "vm.guest.slcan_adapter"]
        self._process = subprocess.Popen(module, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        name = self._process.stdout.readline().strip()
        if not name:
            raise BrokenPromiseError("the serial adapter did not start")
        run("ip", "link", "set", name, "name", SLCAN)
        run("ip", "link", "set", SLCAN, "type", "can", "bitrate", "500000")
        run("ip", "link", "set", SLCAN, "txqueuelen", "100", "up")
        ROBOT_YAML.write_text(ROBOT_YAML.read_text().replace("channel: can0", f"channel: {SLCAN}"))
        run("systemctl", "start", TARGET)


ADAPTER = SerialAdapter()


def error_passive(robot: Robot) -> Row:
    """Nobody acknowledges any more: the controller becomes error passive, no frame gets through."""
    ADAPTER.use(robot)
    robot.make_ready()
    robot.drive()
    moment_s = time.monotonic()
    ADAPTER.say("passive")
    stop = robot.stands(moment_s)
    stood_s = time.monotonic()
    robot.spin(1.0)
    ADAPTER.say("active")
    back_s = time.monotonic()
    robot.stays_disarmed()
    robot.stays(stood_s)
    robot.make_ready()
    row = Row("slcan adapter", "error passive", again_s=elapsed(back_s), then=LATCHED)
    return judged(row, robot, moment_s, stop, (by.DRIVES,))


def bus_off(robot: Robot) -> Row:
    """The controller takes itself off the bus; the interface is without carrier until somebody sets it down and up."""
    ADAPTER.use(robot)
    robot.make_ready()
    robot.drive()
    moment_s = time.monotonic()
    ADAPTER.say("off")
    stop = robot.stands(moment_s)
    stood_s = time.monotonic()
    robot.spin(1.0)
    _both_begin_while_it_is_bus_off(robot)
    run("ip", "link", "set", SLCAN, "down")
    run("ip", "link", "set", SLCAN, "up")
    back_s = time.monotonic()
    robot.stays_disarmed()
    robot.stays(stood_s)
    robot.make_ready()
    row = Row("slcan adapter", "bus-off; down, up", again_s=elapsed(back_s), then=LATCHED)
    return judged(row, robot, moment_s, stop, (by.DRIVES,))


def _both_begin_while_it_is_bus_off(robot: Robot) -> None:
    """The kernel takes their frames, drops them, and reports nothing: the new driver knows it all the same."""
    run("systemctl", "restart", unit("watchdog"), unit("driver"))
    restarted_s = time.monotonic()

    def knows() -> bool:
        return robot.status is not None and robot.status_at > restarted_s and "bus-off" in robot.status.bus_problem

    robot.wait("the new driver to say bus-off", knows)
    robot.spin(2.0)
    if not knows():
        raise BrokenPromiseError(f"the new driver took the bus for a good one: {robot.told()}")


def _is_up(interface: str) -> bool:
    """IFF_UP of linux/if.h."""
    flags = DEVICE / interface / "flags"
    return flags.exists() and bool(int(flags.read_text(), 16) & 1)
