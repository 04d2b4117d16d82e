"""What `canbase up` says at its start: READY with what to try next, or once why not."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_cli import main, up
from canbase_cli.readiness import NOT_READY_S, Seen, Teller, missing
from canbase_runtime.driver_state import DriverState

READY = Seen(DriverState.ENABLED, "", hears_command=True, has_odometry=True, has_server=True)


def test_a_robot_that_takes_a_goal_is_ready_and_two_commands_are_named() -> None:
    line = Teller("", 100.0).line(READY, 104.2)
    assert line == "READY after 4 s; in another terminal: `canbase drive 0.5`, `canbase monitor`"


def test_the_commands_have_the_namespace() -> None:
    line = Teller("/robot1", 0.0).line(READY, 1.0)
    assert line is not None
    assert "`canbase drive 0.5 --namespace /robot1`" in line


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        (Seen(), "motor_driver/status"),
        (replace(READY, state=DriverState.BOOTING, detail="node 1 is silent"), "booting: node 1 is silent"),
        (replace(READY, hears_command=False), "cmd_vel"),
        (replace(READY, has_odometry=False), "odom"),
        (replace(READY, has_server=False), "drive_distance"),
    ],
)
def test_without_one_of_its_parts_it_is_not_ready_and_says_so_once_after_a_while(seen: Seen, why: str) -> None:
    teller = Teller("", 0.0)
    assert missing(seen) is not None
    assert teller.line(seen, NOT_READY_S) is None
    line = teller.line(seen, NOT_READY_S + 0.1)
    assert line is not None
    assert line.startswith("NOT READY: ")
    assert why in line
    assert line.endswith("; in another terminal: `canbase doctor`")
    assert teller.line(seen, NOT_READY_S + 60.0) is None
    after = teller.line(READY, 80.0)
    assert after is not None
    assert after.startswith("READY after 80 s")


def test_a_latched_robot_is_told_at_once_and_how_to_reset_it() -> None:
    seen = Seen(DriverState.LATCHED, "first start on this bus")
    line = Teller("", 0.0).line(seen, 1.0)
    assert line == (
        "NOT READY: motor_driver is latched: first start on this bus; "
        "in another terminal: `canbase doctor`, `canbase reset`"
    )


@pytest.mark.parametrize(("words", "quiet"), [([], 1), (["-v"], 0), (["--verbose"], 0)])
def test_v_shows_the_log_of_the_simulated_drives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], quiet: int
) -> None:
    started: list[list[str]] = []

    def popen(argv: list[str], **_: object) -> subprocess.Popen[bytes]:
        started.append(argv)
        raise InterruptedError("no process of a unit test")

    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(up, "_refuse_twice", lambda robot: None)
    monkeypatch.setattr("canbase_cli.stack.subprocess.Popen", popen)
    CliRunner().invoke(main.app, ["up", "--bench", *words])
    (sim,) = started
    assert (sim[sim.index("serve") + 1], sim.count("--quiet")) == ("sim", quiet)
