"""The unit files as systemd itself reads them: `systemd-analyze verify` and `security`. Nothing is started.

Without systemd on the computer these tests are skipped, loudly; the virtual robot runs the units for real.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from canbase_config.load import load_robot, sample
from canbase_deploy.execute import Executor
from canbase_deploy.host import read_templates
from canbase_deploy.plan import COMMON, HARDENING, PARTS, Request, install_plan

TEMPLATES = Path(__file__).parents[3] / "deploy" / "systemd"
ANALYZE = shutil.which("systemd-analyze")
needs_systemd = pytest.mark.skipif(
    ANALYZE is None, reason="NOT CHECKED: no systemd-analyze here (apt-get install systemd): unit files go unverified"
)
UNITS_OF_THE_ROBOT = [f"canbase-{part}@.service" for part in PARTS]
EXPOSURE = {"can": 1.8, "watchdog": 1.2, "driver": 1.4, "velocity": 1.3, "action-server": 1.3, "metrics": 1.4}
"""`systemd-analyze security`, from 0 (nothing to be had) to 10: what a unit may have at most."""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root with the services of the example robot, as `canbase setup install --prefix` makes it."""
    root = tmp_path_factory.mktemp("root")
    path = sample("example_can0")
    templates, ros = read_templates(TEMPLATES), {"PYTHONPATH": '/opt/my ros/100% "x":/opt/ws'}
    request = Request(
        "example",
        load_robot(path).robot,
        path.read_text(),
        sys.executable,
        templates,
        sourced=ros,
        sros2=True,
        network="lan",
    )
    Executor(root, lambda line: None).carry_out(install_plan(request, {}))
    return root


def analyze(*words: str, units: Path) -> subprocess.CompletedProcess[str]:
    assert ANALYZE is not None
    environment = os.environ | {"SYSTEMD_UNIT_PATH": f"{units}:"}
    return subprocess.run([ANALYZE, *words], env=environment, capture_output=True, text=True, timeout=60, check=False)


@needs_systemd
@pytest.mark.parametrize(
    "unit",
    [
        "canbase@example.target",
        "canbase-can@can0.service",
        *(f"canbase-{part}@example.service" for part in (*PARTS, "metrics")),
    ],
)
def test_systemd_understands_every_line(installed: Path, unit: str) -> None:
    said = analyze("verify", "--man=no", unit, units=installed / "etc/systemd/system")

    assert [line for line in said.stderr.splitlines() if "canbase" in line] == []


@needs_systemd
def test_a_wrong_line_would_be_noticed(installed: Path, tmp_path: Path) -> None:
    units = installed / "etc/systemd/system"
    (tmp_path / "canbase-driver@.service").write_text((units / "canbase-driver@.service").read_text())
    (tmp_path / "canbase-driver@.service.d").mkdir()
    wrong = (units / COMMON).read_text().replace("Restart=always", "Restart=sometimes")
    (tmp_path / "canbase-driver@.service.d" / "00-common.conf").write_text(wrong)

    said = analyze("verify", "--man=no", "canbase-driver@example.service", units=tmp_path)

    assert "sometimes" in said.stderr


@needs_systemd
@pytest.mark.parametrize(("part", "least"), EXPOSURE.items())
def test_a_unit_is_as_tight_as_stated(installed: Path, part: str, least: float) -> None:
    unit = installed / "etc/systemd/system" / f"canbase-{part}@.service"

    said = analyze("security", "--offline=true", str(unit), units=unit.parent)

    exposure = re.search(r"exposure level for .*: ([\d.]+)", said.stdout)
    assert exposure is not None, said.stderr
    assert float(exposure[1]) <= least


def directives(part: str) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    shared = (HARDENING, COMMON) if part in PARTS else ()
    for line in "\n".join(
        (TEMPLATES / name).read_text() for name in (f"canbase-{part}@.service", *shared)
    ).splitlines():
        key, equals, value = line.partition("=")
        if equals and not line.startswith("#"):
            found.setdefault(key, []).append(value)
    return found


@pytest.mark.parametrize("part", PARTS)
def test_every_part_has_ended_before_the_computer_is_suspended(part: str) -> None:
    found = directives(part)
    assert "sleep.target" in found["Conflicts"]
    assert "sleep.target" in found["Before"]


@pytest.mark.parametrize("part", PARTS)
def test_a_loop_that_hangs_is_found_and_a_dead_process_comes_back(part: str) -> None:
    unit = directives(part)

    assert (unit["Type"], unit["WatchdogSec"], unit["Restart"]) == (["notify"], ["1"], ["always"])
    assert unit["RestartPreventExitStatus"] == ["2"]


def test_metrics_are_no_part_of_the_robot_and_come_last() -> None:
    """Nothing needs it or waits for it, and only its owner starts it; what it can take from the robot is bounded."""
    assert all("metrics" not in (TEMPLATES / unit).read_text() for unit in ("canbase@.target", *UNITS_OF_THE_ROBOT))
    unit = directives("metrics")
    assert unit["Nice"] == ["10"]
    assert {"CPUQuota", "MemoryMax", "TasksMax"} <= unit.keys()
    assert "LimitRTPRIO" not in unit


def cycle_s(part: str) -> float:
    """From one start to the next: a part whose starts follow each other faster, for the whole interval, is given up."""
    unit = directives(part)
    return float(unit["StartLimitIntervalSec"][0]) / float(unit["StartLimitBurst"][0])


def pause_s(part: str) -> float:
    return float(directives(part)["RestartSec"][0])


@pytest.mark.parametrize("part", PARTS)
def test_a_part_that_dies_at_every_start_is_given_up_on_a_slow_computer_too(part: str) -> None:
    assert cycle_s(part) >= pause_s(part) + 5.0


@pytest.mark.parametrize("part", PARTS)
def test_a_part_that_dies_every_ten_seconds_is_never_given_up(part: str) -> None:
    assert cycle_s(part) < 10.0


@pytest.mark.parametrize("part", ["watchdog", "driver"])
def test_who_can_leave_wheels_turning_has_stop_frames_sent_at_its_end(part: str) -> None:
    unit = directives(part)

    (stop,) = unit["ExecStopPost"]
    assert stop.startswith("-")  # a stop that fails must not keep the unit from being started again
    assert stop.endswith("-m canbase_watchdog.post_stop /run/canbase/%i/stop.json")
    assert "--stop-file /run/canbase/%i/stop.json" in unit["ExecStart"][0]


def test_the_watchdog_is_up_first_and_outlives_the_driver() -> None:
    driver = directives("driver")

    assert "canbase-watchdog@%i.service" in driver["After"][0]
    assert "Requires" not in driver  # a driver without watchdog runs and says so; power it gives none


def test_a_robot_that_is_told_to_stop_waits_for_no_other_end() -> None:
    assert directives("action-server")["After"] == ["canbase-driver@%i.service"]


def test_an_adapter_without_restart_after_bus_off_comes_up_too() -> None:
    commands = directives("can")["ExecStart"]

    assert [command for command in commands if "restart-ms" in command] == [
        "-ip link set dev %I type can restart-ms ${RESTART_MS}"
    ]


@pytest.mark.parametrize("part", ["driver", "watchdog", "velocity"])
def test_recordings_and_records_of_latched_stops_have_a_folder(part: str) -> None:
    assert directives(part)["StateDirectory"] == ["canbase canbase/%i"]


@pytest.mark.parametrize("part", PARTS)
def test_a_unit_that_loses_its_sandbox_is_still_punctual_and_not_root(part: str) -> None:
    text = (TEMPLATES / f"canbase-{part}@.service").read_text()

    for line in ("User=canbase", "LimitRTPRIO=45", "LimitRTTIME=2s", "LimitMEMLOCK=infinity", "OOMScoreAdjust=-900"):
        assert f"\n{line}\n" in text


@pytest.mark.parametrize("part", PARTS)
def test_no_line_of_the_sandbox_is_repeated_in_a_unit(part: str) -> None:
    """It would be without effect: a drop-in comes after its unit."""
    sandbox = {line for line in (TEMPLATES / HARDENING).read_text().splitlines() if "=" in line}
    keys = {line.partition("=")[0] for line in sandbox}
    unit = (TEMPLATES / f"canbase-{part}@.service").read_text().splitlines()

    assert len(sandbox) == 29
    assert [line for line in unit if line.partition("=")[0] in keys] == []


@pytest.mark.parametrize("part", PARTS)
def test_no_unit_has_a_capability(part: str) -> None:
    unit = directives(part)

    assert unit["CapabilityBoundingSet"] == [""]
    assert unit["AmbientCapabilities"] == [""]
    assert unit["User"] == ["canbase"]


def test_only_the_two_on_the_bus_reach_it() -> None:
    assert [part for part in PARTS if "AF_CAN" in directives(part)["RestrictAddressFamilies"][0]] == [
        "watchdog",
        "driver",
    ]
    assert directives("watchdog")["RestrictAddressFamilies"] == ["AF_UNIX AF_CAN"]
