"""`canbase demo`: the whole chain on a simulated bus, seen from outside: by command line, encoders and ground truth."""

from __future__ import annotations

import math
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from rich.console import Console
from rich.table import Table

from canbase_cli.goal import CANCELED, REJECTED
from canbase_cli.options import ros_needed
from canbase_cli.stack import Stack
from canbase_runtime.own_modules import module_command
from canbase_runtime.terminal import FAILED, fail, with_cursor

if TYPE_CHECKING:
    from canbase_sim.control import SimControl

DISTANCE_M: Final = 1.0
ENCODER_TOLERANCE_M: Final = 0.005
TRUTH_TOLERANCE_M: Final = 0.010
READY_S: Final = 60.0
CANCEL_AFTER_M: Final = 0.3
RUN_S: Final = 60.0
DOMAINS: Final = range(215, 232)
QUIET_S: Final = 1.0
"""After a result nothing may move for this long [s]."""
AGAIN_S: Final = 0.5
PATIENCE: Final = {
    "command_s": 0.5,
    "lease_s": 0.5,
    "drive_heartbeat_s": 1.0,
    "feedback_s": 0.5,
    "watchdog_s": 0.5,
    "odometry_s": 1.0,
}
LOOP_LATE_S: Final = 0.5
"""`timeouts` and `watchdog.loop_late_s` of the demo: it shows the chain, and a laptop that is busy may not trip it. A
robot keeps its defaults."""

NEXT: Final = """Next: `canbase up --bench` starts a robot that keeps running.
In another terminal: `canbase drive 1.0`, `canbase monitor`, `canbase web`. First steps: docs/start.md"""


@dataclass
class Report:
    """What was checked, and whether it held."""

    rows: list[tuple[str, str, bool]] = field(default_factory=list)

    def check(self, what: str, found: str, good: bool) -> None:
        """One line of the table."""
        self.rows.append((what, found, good))

    @property
    def good(self) -> bool:
        """Every line held."""
        return all(good for _, _, good in self.rows)

    def table(self) -> Table:
        """For people."""
        table = Table(title="Checks")
        for column in ("check", "found", "passed"):
            table.add_column(column)
        for what, found, good in self.rows:
            table.add_row(what, found, "[green]yes[/]" if good else "[red]NO[/]")
        return table


def demo(
    speed_mps: Annotated[
        float, typer.Option("--speed", "-s", min=0.05, max=0.5, metavar="SPEED", help="of the 1 m drive, m/s")
    ] = 0.4,
) -> None:
    """Start the whole stack on a simulated CANopen bus, drive 1 m, reject one goal and cancel another.

    Only a simulation moves. The demo uses its own bus, socket and ROS domain, and does not disturb other processes.

    Exit codes: 0 every check passed, 1 otherwise.
    """
    console = Console(file=with_cursor(sys.stdout))
    with tempfile.TemporaryDirectory(prefix="canbase-demo-") as folder, _environment() as env:
        with ros_needed():
            import rclpy  # noqa: F401 - fails here, with advice, rather than in five processes
        config = _robot_file(Path(folder))
        env["XDG_STATE_HOME"] = str(Path(folder) / "state")  # no stop of another run, and none is left behind
        report = Report()
        with Stack(config, sim=True, logs=Path(folder), env=env) as stack:
            _show(console, stack, config, report, speed_mps)
            codes = stack.stop()
        bad = ", ".join(f"{part} {code}" for part, code in codes.items() if code != 0)
        report.check("every process ended well", f"exit code {bad or '0 of all'}", not bad)
        console.print(report.table())
        if not report.good:
            for part in codes:
                console.rule(part)
                typer.echo(stack.log(part)[-3000:])
            fail("a check of the demo failed", FAILED)
    console.print(NEXT, highlight=False)


def _show(console: Console, stack: Stack, config: Path, report: Report, speed_mps: float) -> None:
    from canbase_config.load import load_robot
    from canbase_sim.control import ControlError, SimControl, control_path

    parts = "simulated drives, watchdog, velocity, driver, action server"
    with console.status(f"starting (up to {READY_S:.0f} s): {parts}"):
        observer = _Observer()
        started = time.monotonic()
        ready = observer.wait_enabled(READY_S, lambda: stack.death() is not None)
        report.check("drives enabled", f"{time.monotonic() - started:.1f} s after the start", ready)
    if not ready:
        return
    try:
        with SimControl(control_path(load_robot(config).robot)) as sim:
            _drive_one_metre(console, observer, sim, report, speed_mps)
            _refused(console, report)
            _cancelled(console, sim, report)
    except ControlError as error:
        report.check("the simulation answers", str(error), False)
    observer.close()


def _drive_one_metre(console: Console, observer: _Observer, sim: SimControl, report: Report, speed_mps: float) -> None:
    before_odom, before_truth = observer.odometry(), sim.truth()
    deadline = time.monotonic() + READY_S
    while (code := _run(console, "drive", f"{DISTANCE_M}", "--speed", f"{speed_mps}")) == REJECTED:
        if time.monotonic() > deadline:
            break
        left_s = deadline - time.monotonic()
        console.print(f"[dim]Not yet: the processes are still finding each other. Trying for {left_s:.0f} s more.[/]")
        time.sleep(AGAIN_S)
    ended = time.monotonic()
    report.check("drive 1.0 succeeded", f"exit code {code}", code == 0)
    moved = _moves_within(sim, ended)
    after_odom, after_truth = observer.odometry(), sim.truth()
    encoder_m = _distance(before_odom, after_odom)
    truth_m = _distance((before_truth.x_m, before_truth.y_m), (after_truth.x_m, after_truth.y_m))
    report.check(
        f"encoders: 1 m ± {ENCODER_TOLERANCE_M * 1000:.0f} mm",
        f"{encoder_m:.4f} m",
        abs(encoder_m - DISTANCE_M) <= ENCODER_TOLERANCE_M,
    )
    report.check(
        f"ground truth: 1 m ± {TRUTH_TOLERANCE_M * 1000:.0f} mm",
        f"{truth_m:.4f} m",
        abs(truth_m - DISTANCE_M) <= TRUTH_TOLERANCE_M,
    )
    report.check("nothing moved after the result", f"{moved * 1000:.2f} mm in {QUIET_S:.0f} s", moved < 1e-4)


def _refused(console: Console, report: Report) -> None:
    code = _run(console, "drive", "100", "--speed", "9")
    report.check("a goal out of range is rejected", f"exit code {code}", code == REJECTED)


def _cancelled(console: Console, sim: SimControl, report: Report) -> None:
    start = sim.truth()
    code = _run(
        console,
        "drive",
        "3.0",
        "--speed",
        "0.3",
        interrupt=lambda: sim.truth().travel_m - start.travel_m > CANCEL_AFTER_M,
    )
    ended = time.monotonic()
    report.check("Ctrl-C cancels the goal", f"exit code {code}", code == CANCELED)
    moved, truth = _moves_within(sim, ended), sim.truth()
    way_m = _distance((start.x_m, start.y_m), (truth.x_m, truth.y_m))
    report.check("at standstill when the result came", f"{moved * 1000:.2f} mm in {QUIET_S:.0f} s", moved < 1e-4)
    report.check("stopped on the way, before the goal", f"{way_m:.3f} m of 3 m", 0.05 < way_m < 2.0)


def _run(console: Console, *words: str, interrupt: Callable[[], bool] | None = None) -> int:
    """A canbase command as a user would type it, on this terminal. It gets Ctrl-C once `interrupt` holds."""
    typed = " ".join(("canbase", *words))
    console.print(f"\n[bold]$ {typed}[/]" + (f"   (Ctrl-C after {CANCEL_AFTER_M} m)" if interrupt else ""))
    process = subprocess.Popen(module_command("canbase_cli", *words))
    deadline = time.monotonic() + RUN_S
    while process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
        if interrupt is not None and interrupt():
            process.send_signal(signal.SIGINT)
            interrupt = None
    if process.poll() is None:
        process.kill()
    return process.wait()


def _moves_within(sim: SimControl, since: float) -> float:
    """Waits until QUIET_S after `since` (monotonic); the way that the base went meanwhile [m], by ground truth."""
    while time.monotonic() < since + QUIET_S:
        time.sleep(0.05)
    rows = sim.trace(since)
    return max(_distance((rows[0][1], rows[0][2]), (row[1], row[2])) for row in rows)


def _distance(a: tuple[float, float], b: tuple[float, float]) -> float:
    return math.dist(a, b)


class _Observer:
    """Looks at what any ROS node may look at: motor_driver/status, the action's server, and odom."""

    def __init__(self) -> None:
        import rclpy
        from canbase.action import DriveDistance
        from canbase.msg import DriverStatus
        from nav_msgs.msg import Odometry
        from rclpy.action import ActionClient
        from rclpy.signals import SignalHandlerOptions

        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self._rclpy: Any = rclpy
        self._node = rclpy.create_node("canbase_demo", enable_rosout=False)
        self._enabled = False
        self._position: tuple[float, float] | None = None
        self._server = ActionClient(self._node, DriveDistance, "drive_distance")
        self._enabled_state = DriverStatus.ENABLED
        self._node.create_subscription(DriverStatus, "motor_driver/status", self._on_status, 1)
        self._node.create_subscription(Odometry, "odom", self._on_odom, 1)

    def wait_enabled(self, timeout_s: float, given_up: Any) -> bool:
        """Until drives and action server are ready; False when they are not in time, or a process died."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline and not given_up():
            self._rclpy.spin_once(self._node, timeout_sec=0.1)
            if self._enabled and self._position is not None and self._server.server_is_ready():
                return True
        return False

    def odometry(self) -> tuple[float, float]:
        """The newest position by the encoders [m]."""
        self._position, deadline = None, time.monotonic() + 5.0
        while self._position is None and time.monotonic() < deadline:
            self._rclpy.spin_once(self._node, timeout_sec=0.1)
        if self._position is None:
            fail("no message on odom for 5 s", FAILED)
        return self._position

    def close(self) -> None:
        """Leave the ROS graph."""
        self._rclpy.try_shutdown()

    def _on_status(self, message: Any) -> None:
        self._enabled = message.state == self._enabled_state

    def _on_odom(self, message: Any) -> None:
        self._position = (message.pose.pose.position.x, message.pose.pose.position.y)


@contextmanager
def _environment() -> Iterator[dict[str, str]]:
    """ROS on this machine alone, in a domain of its own; for this process and those that it starts."""
    with _domain() as domain:
        ours = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": str(domain)}
        before = {name: os.environ.get(name) for name in ours}
        os.environ.update(ours)
        try:
            yield dict(os.environ)
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value


@contextmanager
def _domain() -> Iterator[int]:
    """A ROS domain that no other demo holds, with ports above those that Linux gives out by itself."""
    for domain in random.sample(DOMAINS, len(DOMAINS)):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as holder:
            try:
                holder.bind(f"\0canbase-demo-domain-{domain}")
            except OSError:
                continue
            yield domain
            return
    fail(f"{len(DOMAINS)} demos run on this machine already", FAILED)


def _robot_file(folder: Path) -> Path:
    """The sample of the bench on a free port, with a separate lease socket and long timeouts."""
    from ruamel.yaml import YAML

    from canbase_config.load import sample

    yaml = YAML()
    values = yaml.load(sample("bench"))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        values["bus"]["extra"]["port"] = free.getsockname()[1]
    values["lease"]["socket"] = str(folder / "lease.sock")
    values["timeouts"] = values.get("timeouts", {}) | PATIENCE
    values["watchdog"] = values.get("watchdog", {}) | {"loop_late_s": LOOP_LATE_S}
    values["safety"]["command_timeout_s"] = PATIENCE["command_s"]
    path = folder / "robot.yaml"
    yaml.dump(values, path)
    return path
