"""safety.require_self_stop: no power before each drive is proven to stop by itself, and by whom: these drives."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from canopen import SdoAbortedError

from canbase_commissioning.edits import Edit, commissioned_edits, edited, identity_edits
from canbase_config.commissioned import STEPS, Step, identities, is_proven, kind_alone, mark, without_proof
from canbase_config.drive import Identity
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_doctor.check import Check, Verdict, commissioning
from canbase_driver.boot.sequence import BootReport
from canbase_driver.boot.settings import STOPS_BY_NOTHING
from canbase_runtime.driver_state import DriverState
from support.chain_world import World
from support.crews import robot_with

PROOF: tuple[Step, ...] = ("proof",)
PROVE = "With the wheels up: canbase setup commission --steps proof"


def boots(robot: Robot) -> dict[int, BootReport]:
    """What the drives report: a serial number each."""
    return {
        drive.node_id: BootReport(drive.node_id, Identity(serial=0x100 + drive.node_id), STOPS_BY_NOTHING, (), ())
        for drive in robot.drives
    }


class File:
    """A robot.yaml made from the sample for a real bus, which asks for the proof."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "robot.yaml"
        self.path.write_text(sample("example_can0").read_text(encoding="utf-8"), encoding="utf-8")

    @property
    def robot(self) -> Robot:
        return load_robot(self.path).robot

    def prove(self) -> None:
        """As `canbase setup commission --steps proof` writes it."""
        robot = self.robot
        edits = identity_edits(robot, boots(robot))
        self.edit(*edits, *commissioned_edits(robot, edits, PROOF))

    def edit(self, *edits: Edit) -> None:
        self.path.write_text(edited(self.path.read_text(encoding="utf-8"), edits), encoding="utf-8")


@pytest.fixture
def file(tmp_path: Path) -> File:
    return File(tmp_path)


def blocked(robot: Robot) -> str:
    """Why the driver gives no power; empty: it has given it."""
    world = World(robot)
    world.run(2.0)
    if world.core.state is DriverState.ENABLED:
        return ""
    finding = world.core.finding
    assert not any(world.powered)
    assert (world.core.state, finding.cause.value) == (DriverState.DISARMED, "stop unproven")
    assert finding.clears_on == "canbase setup commission, and a new start"
    return finding.detail


def test_a_new_robot_gets_no_power_and_the_message_names_joints_and_command(file: File) -> None:
    detail = blocked(file.robot)
    assert detail.startswith(
        "left_wheel, right_wheel: no proof that each drive stops by itself when this computer fails"
    )
    assert detail.endswith(PROVE)


def test_with_the_proof_of_these_drives_it_gets_power(file: File) -> None:
    file.prove()
    assert without_proof(file.robot) == ""
    assert blocked(file.robot) == ""


def test_an_old_file_without_the_key_gets_power_as_before(file: File) -> None:
    text = file.path.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if "require_self_stop" not in line]
    file.path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert not file.robot.safety.require_self_stop
    assert blocked(file.robot) == ""


def test_a_bus_without_a_wire_needs_no_proof() -> None:
    robot = load_robot(sample("bench")).robot
    strict = robot.model_copy(update={"safety": robot.safety.model_copy(update={"require_self_stop": True})})
    assert blocked(strict) == ""


Change = Callable[[File], None]


def another_serial(file: File) -> None:
    file.edit(Edit(("drives", 1, "identity", "serial"), 0x102, 0x999))


def another_heartbeat(file: File) -> None:
    file.edit(Edit(("timeouts",), None, {"drive_heartbeat_s": 0.4}))


def another_profile(file: File) -> None:
    file.edit(Edit(("drives", 0, "profile"), "generic", "epos4"), Edit(("drives", 1, "profile"), None, "epos4"))


def no_identity(file: File) -> None:
    text = file.path.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if "identity: {" not in line]
    assert len(lines) < len(text.splitlines())
    file.path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def a_proof_of_before(file: File) -> None:
    text = file.path.read_text(encoding="utf-8")
    mark = file.robot.commissioned.identities
    assert f", identities: {mark}" in text
    file.path.write_text(text.replace(f", identities: {mark}", ""), encoding="utf-8")


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (another_serial, "`identity` has changed since the proof"),
        (another_heartbeat, "timeouts.drive_heartbeat_s have changed since the proof"),
        (another_profile, "profile, node ids or timeouts.drive_heartbeat_s have changed"),
        (no_identity, "`identity` of left_wheel, right_wheel is not given"),
        (a_proof_of_before, "does not say with which drives it was made"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_proof_of_something_else_is_none(file: File, change: Change, why: str) -> None:
    file.prove()
    change(file)
    detail = without_proof(file.robot)
    assert why in detail
    assert detail.endswith(PROVE)
    file.prove()
    assert without_proof(file.robot) == ""


def test_another_drive_with_the_node_id_is_not_booted_so_the_proof_is_about_these(file: File) -> None:
    file.prove()
    world = World(file.robot)
    values = world.bench.nodes[2].dictionary.values
    values[0x1018_04] = 0x777
    world.run(2.0)
    assert not any(world.powered)
    errors = [node.boot_error for node in world.core._drives.nodes]
    assert any("1018h:4 (serial) is 00000777h, expected 00000102h" in error for error in errors)


def self_stop_rows(path: Path) -> list[Check]:
    return [row for row in commissioning(load_robot(path)) if row.name == "self-stop proof"]


def test_check_and_doctor_say_so_too(file: File) -> None:
    (told,) = [str(each) for each in load_robot(file.path).warnings if "no drive gets power" in str(each)]
    assert "safety.require_self_stop" in told
    assert PROVE in told
    (row,) = self_stop_rows(file.path)
    assert (row.verdict, "no drive gets power" in row.found) == (Verdict.FAIL, True)
    file.prove()
    assert not any("no drive gets power" in str(each) for each in load_robot(file.path).warnings)
    (row,) = self_stop_rows(file.path)
    assert row.verdict is Verdict.OK


def test_commissioning_without_a_proof_leaves_no_mark_of_drives(file: File) -> None:
    robot = file.robot
    steps: list[Any] = [step for step in STEPS if step != "proof"]
    assert not [edit for edit in commissioned_edits(robot, [], steps) if edit.loc[-1] == "identities"]


def proven(kind: str, identity: int = 0x100) -> Robot:
    """Two drives of this kind on a bus with a wire, each proven by its serial number, and the key set."""
    robot = robot_with(kind)
    drives = tuple(
        drive.model_copy(update={"identity": Identity(serial=identity + drive.node_id)}) for drive in robot.drives
    )
    bus = robot.bus.model_copy(update={"interface": "socketcan", "channel": "can0", "extra": {}})
    safety = robot.safety.model_copy(update={"require_self_stop": True})
    wired = robot.model_copy(update={"bus": bus, "drives": drives, "safety": safety})
    marks = wired.commissioned.model_copy(update={"proof": mark(wired, "proof"), "identities": identities(wired)})
    return wired.model_copy(update={"commissioned": marks})


@pytest.mark.parametrize(
    ("kind", "by"),
    [
        ("generic", "heartbeat of the watchdog (1016h, 6007h)"),
        ("technosoft", "node guarding by the watchdog (100Ch, 100Dh, 6007h)"),
        ("zlac8015d", "communication offline time (2000h:0)"),
        ("roboteq", "as canbase setup commission has proven"),
        ("tmcm1636", "as canbase setup commission has proven"),
    ],
)
def test_what_was_proven_counts_where_the_boot_cannot_see_it(kind: str, by: str) -> None:
    """RWD of Roboteq is set by the manufacturer's tool; 2000h of ZLTECH has no source for what the motors do."""
    world = World(proven(kind))
    world.run_until(DriverState.ENABLED, 3.0)
    assert [(drive.stops_by_itself, drive.self_stop) for drive in world.snapshot.drives] == [(True, by)] * 2


def refuses(world: World, index: int) -> None:
    """From now on node 1 keeps what this object has."""

    def refuse(subindex: int, value: int) -> None:
        raise SdoAbortedError(0x0800_0022)

    world.node.dictionary.guard(index, refuse)


@pytest.mark.parametrize(("kind", "index"), [("generic", 0x1016), ("generic", 0x6007), ("zlac8015d", 0x2000)])
def test_a_drive_that_refuses_what_the_proof_relied_on_gets_no_power(kind: str, index: int) -> None:
    world = World(proven(kind))
    refuses(world, index)
    world.run(4.5)  # 2 s of them wait for its state to allow the write
    assert not any(world.powered)
    finding = world.core.finding
    assert finding.cause.value == "stop unproven"
    assert finding.detail.startswith("node 1 (left_wheel")
    assert "would not stop by itself when this computer fails, whatever was proven" in finding.detail
    assert f"{index:04X}h" in finding.detail


def test_simulated_drives_prove_nothing_about_real_ones() -> None:
    assert not is_proven(robot_with("generic"))
    assert is_proven(proven("generic"))


# proven ── the left drive reports serial number 0, as each of its kind ── another one in its place has the same 1018h
@pytest.mark.parametrize("serial", [0, None])
def test_a_proof_of_drives_without_a_serial_number_is_about_their_kind_and_that_is_reported(
    file: File, serial: int | None
) -> None:
    file.prove()
    assert kind_alone(file.robot) == ""
    kind = Edit(("drives", 0, "identity", "vendor_id"), None, 0x1234)
    file.edit(kind, Edit(("drives", 0, "identity", "serial"), None, serial))
    file.edit(*commissioned_edits(file.robot, (), PROOF))
    why = (
        "left_wheel: 1018h:4 has no serial number, so the proof that it stops by itself is about its kind: after each "
        "exchange of a drive repeat canbase setup commission --steps proof"
    )
    assert without_proof(file.robot) == ""
    assert kind_alone(file.robot) == why
    assert why in [warning.what for warning in load_robot(file.path).warnings]
    row = commissioning(load_robot(file.path))[-1]
    assert (row.verdict, row.found) == (Verdict.WARN, why)
