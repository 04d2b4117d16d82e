"""The black box: what is kept, how it is written, and that nothing about a disk is ever raised."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import can
import pytest

from canbase_config.black_box import BlackBox
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.watchdog import WatchdogConfig
from canbase_driver.runtime.black_box import (
    MAX_EVENTS,
    MAX_FRAMES,
    WAITED,
    EventEntry,
    Recording,
    Ring,
    asc_lines,
    in_order,
)
from canbase_driver.runtime.black_box_about import about, sha256_of
from canbase_driver.runtime.black_box_json import json_lines
from canbase_driver.runtime.black_box_writer import WAITING, BlackBoxWriter, Written
from canbase_driver.runtime.bus_port import BusPort
from canbase_driver.supervision.stop_history import NOBODY, StopRecord
from canbase_runtime.input_files import state_folder

WALL_S = 1_700_000_000.0
SETPOINT = bytes.fromhex("0f 00 10 27 00 00")


def recording(frames: int = 3) -> Recording:
    """Setpoints every 10 ms with a command after each."""
    ring = Ring(seconds=10.0)
    for k in range(frames):
        ring.frame(100.0 + 0.01 * k, 0x201, SETPOINT, received=False)
        ring.note(100.0 + 0.01 * k + 0.001, f"cmd_vel 0.{k} m/s")
        ring.event(100.0 + 0.01 * k + 0.001, "cmd_vel", {"linear_mps": k / 10, "stamp_s": WALL_S})
    return ring.cut(now_s=105.0, wall_offset_s=WALL_S)


def text(of: Recording) -> str:
    return "".join(asc_lines(of, "stop by watchdog: lease lost"))


def test_the_ring_gives_back_the_last_seconds_alone() -> None:
    ring = Ring(seconds=2.0)
    for k in range(50):
        ring.frame(100.0 + 0.1 * k, k, b"", received=True)
        ring.note(100.0 + 0.1 * k, str(k))
        ring.event(100.0 + 0.1 * k, "order", {"k": k})
    cut = ring.cut(now_s=105.0, wall_offset_s=0.0)
    assert [entry[1] for entry in cut.frames] == list(range(30, 50))
    assert [entry[1] for entry in cut.notes] == [str(k) for k in range(30, 50)]
    assert [entry[2]["k"] for entry in cut.events] == list(range(30, 50))


def test_a_frame_that_waited_in_the_socket_stands_where_it_came() -> None:
    """A driver that hung sends again before it has taken in all that waited."""
    ring = Ring(seconds=60.0)
    for k in range(3 * WAITED):
        ring.frame(100.0 + 0.001 * k, 0x80, b"", received=False)
        ring.frame(100.0 + 0.001 * k - 0.5005, 0x181, b"", received=True)
    cut = ring.cut(now_s=108.0, wall_offset_s=0.0)
    times = [frame[0] for frame in in_order(cut.frames)]
    assert times == sorted(times)
    assert len(times) == 6 * WAITED
    assert cut.began_s == times[0]


@pytest.mark.parametrize(("later_s", "at_s"), [(0.5, 199.5), (0.0, 200.0), (-3600.0, 200.0), (3600.0, 200.0)])
def test_the_time_of_a_frame_is_the_kernels_unless_the_wall_clock_was_set(
    later_s: float, at_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`later_s`: by the wall clock, when the control thread takes it out."""
    arguments: dict[str, Any] = {"interface": "virtual", "channel": f"received {later_s}"}
    with can.Bus(**arguments) as other:
        port = BusPort(arguments)
        other.send(can.Message(arbitration_id=0x181, is_extended_id=False))
        assert port.receive(1.0) is not None
        now_s = time.time()
        monkeypatch.setattr("canbase_driver.runtime.bus_port.time", SimpleNamespace(time=lambda: now_s + later_s))
        assert port.received_at(200.0) == pytest.approx(at_s, abs=0.1)
        port.close()


def test_memory_is_bounded_however_full_the_bus_is() -> None:
    ring = Ring(seconds=60.0)
    for k in range(MAX_FRAMES + 10):
        ring.frame(100.0 + k * 1e-5, 0x181, b"", received=True)
        ring.event(100.0 + k * 1e-5, "safety_filter/state", {})
    cut = ring.cut(now_s=101.0, wall_offset_s=0.0)
    frames = cut.frames
    assert (len(frames), len(cut.events)) == (MAX_FRAMES, MAX_EVENTS)
    assert frames[0][0] == pytest.approx(100.0001)


def test_python_can_reads_the_frames_and_people_read_the_commands_between_them(tmp_path: Path) -> None:
    file = tmp_path / "stop.asc"
    file.write_text(text(recording()), encoding="utf-8")
    with can.LogReader(file) as reader:
        messages = list(reader)
    assert [(round(m.timestamp, 3), m.arbitration_id, bytes(m.data), m.is_rx) for m in messages] == [
        (0.0, 0x201, SETPOINT, False),
        (0.01, 0x201, SETPOINT, False),
        (0.02, 0x201, SETPOINT, False),
    ]
    lines = file.read_text(encoding="utf-8").splitlines()
    assert " 0.000000 // stop by watchdog: lease lost" in lines
    commands = [line for line in lines if "cmd_vel" in line]
    assert commands == [f"// {0.01 * k + 0.001:.6f} cmd_vel 0.{k} m/s" for k in range(3)]
    assert [lines.index(command) - lines.index(commands[0]) for command in commands] == [0, 2, 4]


def test_a_bus_on_which_nothing_was_said_gives_a_file_with_the_commands(tmp_path: Path) -> None:
    only = Recording(frames=(), notes=((100.0, "cmd_vel 0.1"),), wall_offset_s=WALL_S)
    assert "// 0.000000 cmd_vel 0.1\n" in text(only)
    file = tmp_path / "stop.asc"
    file.write_text(text(Recording((), (), 0.0)), encoding="utf-8")
    with can.LogReader(file) as reader:
        assert list(reader) == []


def stop_at(at_s: float, cause: str = "drive fault") -> StopRecord:
    return StopRecord("motor_driver", cause, "a stop", True, "a reset", at_s)


class Box:
    """A writer with what it said."""

    def __init__(self, folder: Path, files: int = 3) -> None:
        self.said: list[str] = []
        self.folder = folder
        self.writer = BlackBoxWriter(BlackBox(folder=str(folder), files=files), "r1", self.said.append)

    def stop(self, wall_s: float = WALL_S, cause: str = "drive fault", late: Iterable[EventEntry] = ()) -> str:
        return self.writer.submit(recording(), stop_at(wall_s - WALL_S, cause), lambda _recording: late)

    def finish(self) -> None:
        """Let it do all its work; start it first where a test has not."""
        if not self.writer.is_alive():
            self.writer.start()
        self.writer.finish(20.0)
        assert not self.writer.is_alive()
        assert self.writer.failure is None

    @property
    def files(self) -> list[str]:
        return sorted(path.name for path in self.folder.iterdir())


@pytest.fixture
def box(tmp_path: Path) -> Box:
    return Box(tmp_path / "box")


def test_each_stop_has_a_file_with_its_time_robot_and_cause(box: Box) -> None:
    path = box.stop(WALL_S + 0.25)
    box.finish()
    assert path == str(box.folder / "stop_r1_20231114T221320.250Z_drive_fault.asc")
    assert box.files == [Path(path).name, Path(path).with_suffix(".json").name]
    assert "// stop by motor_driver: drive fault (a stop)" in Path(path).read_text(encoding="utf-8")
    assert box.said == []


def test_the_newest_files_are_kept_and_others_are_left_alone(box: Box) -> None:
    box.folder.mkdir()
    (box.folder / "stop_other_20200101T000000.000Z_x.asc").touch()
    for hour in range(3):
        (box.folder / f"stop_r1_20230101T0{hour}0000.000Z_x.asc").touch()
        (box.folder / f"stop_r1_20230101T0{hour}0000.000Z_x.json").touch()
    box.stop()
    box.finish()
    assert box.files == [
        "stop_other_20200101T000000.000Z_x.asc",
        "stop_r1_20230101T010000.000Z_x.asc",
        "stop_r1_20230101T010000.000Z_x.json",
        "stop_r1_20230101T020000.000Z_x.asc",
        "stop_r1_20230101T020000.000Z_x.json",
        "stop_r1_20231114T221320.000Z_drive_fault.asc",
        "stop_r1_20231114T221320.000Z_drive_fault.json",
    ]


def test_a_folder_that_cannot_be_made_is_said_once_and_no_path_is_told(tmp_path: Path) -> None:
    (tmp_path / "box").write_text("a file", encoding="ascii")
    box = Box(tmp_path / "box")
    box.stop()
    box.stop()
    box.finish()
    assert len(box.said) == 1
    assert box.said[0].startswith(f"the black box cannot write to {tmp_path}/box: ")
    assert box.stop() == ""


def test_a_full_disk_is_said_once_leaves_nothing_behind_and_is_over_when_there_is_room(
    box: Box, monkeypatch: pytest.MonkeyPatch
) -> None:
    failures = iter([True, True, False])

    def lines(_recording: Recording, _title: str) -> Iterator[str]:
        yield "first\n"
        if next(failures):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr("canbase_driver.runtime.black_box_writer.asc_lines", lines)
    for _ in range(3):
        box.stop()
    box.finish()
    assert box.files == [f"stop_r1_20231114T221320.000Z_drive_fault.{kind}" for kind in ("asc", "json")]
    assert [sentence.partition(": ")[2][:23] for sentence in box.said] == ["No space left on device", ""]
    assert box.said[1] == f"the black box writes to {box.folder} again"


def test_where_one_of_the_two_files_cannot_be_written_the_other_one_is(
    box: Box, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lines(*_given: object) -> Iterator[str]:
        yield "{"
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("canbase_driver.runtime.black_box_writer.json_lines", lines)
    box.stop()
    box.finish()
    assert box.files == ["stop_r1_20231114T221320.000Z_drive_fault.asc"]
    assert len(box.said) == 1


def test_what_something_else_has_kept_comes_at_its_place_among_the_events(box: Box) -> None:
    path = box.stop(late=[(100.015, "order", {"source": "joystick"}), (100.005, "order", {"source": "navigation"})])
    box.finish()
    events = json.loads(Path(path).with_suffix(".json").read_text(encoding="utf-8"))["events"]
    assert [(round(each["at_s"], 3), each["what"]) for each in events] == [
        (100.001, "cmd_vel"),
        (100.005, "order"),
        (100.011, "cmd_vel"),
        (100.015, "order"),
        (100.021, "cmd_vel"),
    ]


def read(of: Recording, about_it: dict[str, Any] | None = None) -> dict[str, Any]:
    found = json.loads("".join(json_lines(of, stop_at(100.02), "stop.asc", about_it or {})))
    assert isinstance(found, dict)
    return found


def test_the_second_file_has_the_values_exactly_and_the_clocks_of_both() -> None:
    found = read(recording(2))
    assert found["events"][1] == {"at_s": 100.01 + 0.001, "what": "cmd_vel", "linear_mps": 0.1, "stamp_s": WALL_S}
    assert (found["began_s"], found["at_s"], found["wall_offset_s"]) == (100.0, 100.02, WALL_S)
    assert (found["frames"], found["cause"]) == ("stop.asc", "drive fault")


def test_a_command_that_is_no_number_is_still_json() -> None:
    ring = Ring(10.0)
    ring.event(100.0, "cmd_vel", {"linear_mps": float("nan"), "angular_radps": float("-inf"), "of": [float("inf")]})
    event = read(ring.cut(100.0, 0.0))["events"][0]
    assert (event["linear_mps"], event["angular_radps"], event["of"]) == ("nan", "-inf", ["inf"])


def test_text_of_another_node_forges_no_event() -> None:
    ring = Ring(10.0)
    ring.event(100.0, "safety_filter/state", {"detail": 'x"},\n{"at_s": 1.0, "what": "cmd_vel"'})
    assert len(read(ring.cut(100.0, 0.0))["events"]) == 1


def test_a_recording_without_events_is_whole_too() -> None:
    assert read(Recording((), (), 0.0))["events"] == []


def test_the_configuration_in_it_makes_the_same_robot_and_the_same_watchdog_again() -> None:
    robot = load_robot(sample("bench")).robot
    found = read(recording(), about(robot))
    assert Robot.model_validate(found["robot_yaml"]) == robot
    assert found["robot_yaml_sha256"] == sha256_of(found["robot_yaml"])
    assert WatchdogConfig.from_json(json.dumps(found["watchdog_config"])).robot == robot.name
    assert found["versions"].keys() == {"canbase", "python", "python-can", "canopen", "rclpy"}


def test_a_profile_of_the_users_own_is_in_it(tmp_path: Path) -> None:
    robot = load_robot(sample("bench")).robot
    own = tmp_path / "own.yaml"
    own.write_text("title: mine", encoding="utf-8")
    drives = tuple(drive.model_copy(update={"profile": str(own)}) for drive in robot.drives)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("canbase_driver.runtime.black_box_about.watchdog_config", lambda _robot: WatchdogStub())
        found = about(robot.model_copy(update={"drives": drives}))
    assert found["profiles"] == {str(own): "title: mine"}


class WatchdogStub:
    def to_json(self) -> str:
        return "{}"


def test_more_stops_than_can_wait_are_dropped_and_have_no_path(box: Box) -> None:
    paths = [box.stop(WALL_S + k) for k in range(WAITING + 2)]
    assert [bool(path) for path in paths] == [True] * WAITING + [False] * 2


def test_a_defect_in_it_is_kept_for_the_main_thread(box: Box, monkeypatch: pytest.MonkeyPatch) -> None:
    def defect(_recording: Recording, _title: str) -> Iterator[str]:
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr("canbase_driver.runtime.black_box_writer.asc_lines", defect)
    box.stop()
    box.writer.start()
    box.writer.join(20.0)
    assert isinstance(box.writer.failure, ZeroDivisionError)


@pytest.mark.parametrize(
    ("environment", "folder"),
    [
        ({}, "/home/u/.local/state/canbase"),
        ({"XDG_STATE_HOME": "/state"}, "/state/canbase"),
        ({"XDG_STATE_HOME": ""}, "/home/u/.local/state/canbase"),
        ({"STATE_DIRECTORY": "/var/lib/canbase", "XDG_STATE_HOME": "/state"}, "/var/lib/canbase"),
        ({"STATE_DIRECTORY": "/var/lib/canbase:/var/lib/other"}, "/var/lib/canbase"),
    ],
)
def test_where_files_go_by_default(environment: dict[str, str], folder: str) -> None:
    assert state_folder(None, environment, Path("/home/u")) == Path(folder)


# ---- recordings on request


class Requests:
    """Requests at a writer, and what became of them."""

    def __init__(self, box: Box) -> None:
        self.box = box
        self.told: list[tuple[str, str]] = []

    def at(self, now_s: float, ring: Ring | None = None) -> str:
        """Why not now; empty: it will be written."""
        ring = ring or filled_ring()
        record = StopRecord(NOBODY, "recording requested", "the robot was not stopped", False, "", now_s)
        done: Written = lambda path, problem: self.told.append((path, problem))  # noqa: E731
        return self.box.writer.request(lambda: ring.cut_later(now_s, WALL_S), record, WALL_S, lambda _cut: (), done)


def filled_ring(frames: int = 5000) -> Ring:
    ring = Ring(10.0)
    for number in range(frames):
        ring.frame(95.0 + number * 0.001, 0x181, bytes(8), True)
    ring.event(99.0, "cmd_vel", {"linear_mps": 0.1})
    return ring


def test_a_recording_on_request_has_all_that_one_of_a_stop_has(box: Box) -> None:
    requests = Requests(box)
    assert requests.at(100.0) == ""
    box.finish()
    ((path, problem),) = requests.told
    assert (path, problem) == (str(box.folder / "record_r1_20231114T221500.000Z.asc"), "")
    text = Path(path).read_text(encoding="utf-8")
    assert "// stop by nobody: recording requested (the robot was not stopped)" in text
    with can.LogReader(path) as reader:
        assert len(list(reader)) == 5000
    told = json.loads(Path(path).with_suffix(".json").read_text(encoding="utf-8"))
    assert (told["stopped_by"], told["at_s"], told["began_s"], len(told["events"])) == ("nobody", 100.0, 95.0, 1)


def test_what_comes_after_a_request_is_not_in_it(box: Box) -> None:
    ring, requests = filled_ring(10), Requests(box)
    requests.at(100.0, ring)
    ring.frame(100.1, 0x182, b"", True)
    box.finish()
    with can.LogReader(requests.told[0][0]) as reader:
        assert {message.arbitration_id for message in reader} == {0x181}


def test_a_flood_of_requests_writes_one_file_in_five_seconds(box: Box) -> None:
    requests = Requests(box)
    refusals = [requests.at(100.0 + k * 0.01) for k in range(100)]
    assert refusals[0] == ""
    assert refusals[1] == "a recording was requested less than 5 s ago; again in 5.0 s"
    assert all(refusals[1:])
    box.finish()
    assert len(requests.told) == 1


def test_a_request_is_refused_while_another_one_is_written(box: Box) -> None:
    requests = Requests(box)
    assert requests.at(100.0) == ""
    assert requests.at(110.0) == "a recording that was requested before is still being written"
    box.finish()
    assert len(requests.told) == 1


def test_a_request_takes_no_place_of_a_stop(box: Box) -> None:
    assert Requests(box).at(100.0) == ""
    paths = [box.stop(WALL_S + k) for k in range(WAITING + 1)]
    assert [bool(path) for path in paths] == [True] * WAITING + [False]


def test_recordings_on_request_delete_none_of_stops_and_are_bounded_themselves(box: Box) -> None:
    box.folder.mkdir()
    stops = [f"stop_r1_20200101T00000{k}.000Z_x.asc" for k in range(3)]
    older = [f"record_r1_20200101T00000{k}.000Z.asc" for k in range(3)]
    for name in (*stops, *older):
        (box.folder / name).touch()
    Requests(box).at(100.0)
    box.finish()
    new = [f"record_r1_20231114T221500.000Z.{kind}" for kind in ("asc", "json")]
    assert box.files == sorted([*stops, *older[1:], *new])


def test_a_request_is_told_that_the_disk_is_full_and_the_next_stop_is_recorded(
    box: Box, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, failures = asc_lines, iter([True, False])

    def lines(of: Recording, title: str) -> Iterator[str]:
        if next(failures):
            raise OSError(28, "No space left on device")
        yield from real(of, title)

    monkeypatch.setattr("canbase_driver.runtime.black_box_writer.asc_lines", lines)
    requests = Requests(box)
    requests.at(100.0)
    box.stop()
    box.finish()
    ((_path, problem),) = requests.told
    assert problem == f"the black box cannot write to {box.folder}: No space left on device"
    assert "stop_r1_20231114T221320.000Z_drive_fault.asc" in box.files
    assert requests.at(110.0) == "", "the next request is taken"
