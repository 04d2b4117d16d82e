"""From answers about a robot to its robot.yaml: every file that comes of it can be used."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from canbase_commissioning.drive_survey import FoundAxis
from canbase_commissioning.guide import Ask, CommissionError, Tell
from canbase_commissioning.onbus.init_command import answered_draft
from canbase_commissioning.robot_draft import Draft, ask_about, robot_yaml
from canbase_config.load import Loaded, load_robot, sample
from canbase_config.profile_file import profile_names
from canbase_config.robot import Bus

CAN0 = Bus(interface="socketcan", channel="can0", bitrate=250_000, extra={})
FRESH = {"gear_ratio": "20", "counts_per_motor_rev": "4096", "velocity_unit": "rpm", "scanner.x_m": "0.3"}
"""What a person knows of drives that report nothing, and of the scanner."""


def answer(axes: list[FoundAxis], given: Mapping[str, str] = FRESH) -> tuple[Draft, list[str]]:
    """The draft of a person who gives these answers, by key or by its last part, and else the proposed ones."""
    questions = ask_about(axes)
    told: list[str] = []
    value: object = None
    while True:
        try:
            step = questions.send(value)
        except StopIteration as end:
            draft: Draft = end.value
            return draft, told
        value = None
        if isinstance(step, Tell):
            told.append(step.text)
        else:
            value = step.check(words(step, given))


def words(question: Ask, given: Mapping[str, str]) -> str:
    known = given.get(question.key, question.default)
    return given[question.key.rpartition(".")[2]] if known is None else known


def loaded(folder: Path, draft: Draft, bus: Bus = CAN0, name: str = "example_can0") -> Loaded:
    file = folder / "robot.yaml"
    file.write_text(robot_yaml(sample(name).read_text(encoding="utf-8"), draft, bus), encoding="utf-8")
    return load_robot(file)


def two(profile: str = "generic", **found: float | str) -> list[FoundAxis]:
    return [FoundAxis(1, 0, profile, **found), FoundAxis(2, 0, profile, **found)]  # type: ignore[arg-type]


def test_the_proposed_answers_make_a_robot_that_passes_the_check(tmp_path: Path) -> None:
    draft, told = answer(
        two(counts_per_motor_rev=4096, gear_ratio=20.0, velocity_unit="0.1rpm"), {"scanner.x_m": "0.3"}
    )
    robot = loaded(tmp_path, draft).robot
    assert told == []
    assert [(d.joint, d.node_id, d.axis, d.side, d.direction) for d in robot.drives] == [
        ("left_wheel", 1, 0, "left", 1),
        ("right_wheel", 2, 0, "right", -1),
    ]
    assert {(d.gear_ratio, d.counts_per_motor_rev, d.velocity_unit) for d in robot.drives} == {(20.0, 4096, "0.1rpm")}
    assert {d.profile for d in robot.drives} == {"generic"}
    assert (robot.bus.interface, robot.bus.channel, robot.bus.bitrate) == ("socketcan", "can0", 250_000)
    assert (robot.base.wheel_radius_m, robot.base.track_m, robot.limits.linear_mps) == (0.1, 0.5, 0.3)
    assert (robot.safety.scan.required, robot.safety.estop.required) == (True, True)
    assert robot.limits.angular_radps == pytest.approx(1.2)
    assert not robot.commissioned.directions


def test_the_comments_of_the_sample_stay(tmp_path: Path) -> None:
    draft, _ = answer(two())
    loaded(tmp_path, draft)
    text = (tmp_path / "robot.yaml").read_text(encoding="utf-8")
    before = sample("example_can0").read_text(encoding="utf-8")
    sections = [line for line in before.splitlines() if line.startswith("# ---")]
    assert len(sections) >= 6
    assert [line for line in text.splitlines() if line.startswith("# ---")] == sections
    assert "CANopen node id as set on the drive" not in text, "the drives of the sample are gone"


def test_neither_the_lease_socket_nor_the_words_about_the_bench_are_in_a_new_robot(tmp_path: Path) -> None:
    draft, _ = answer(two())
    robot = loaded(tmp_path, draft, Bus(interface="udp_multicast", channel="239.74.163.9", extra={}), "bench").robot
    text = (tmp_path / "robot.yaml").read_text(encoding="utf-8")
    assert f"canbase-{draft.name}/lease.sock" in str(robot.lease.socket)
    assert "bench" not in text
    assert text.startswith("# Written by canbase setup init")


@pytest.mark.parametrize("profile", profile_names())
@pytest.mark.parametrize("bus", [CAN0, Bus(interface="udp_multicast", channel="239.74.163.9", extra={})])
def test_every_kind_of_drive_gives_a_robot_that_passes_the_check(tmp_path: Path, profile: str, bus: Bus) -> None:
    draft, _ = answer(two(profile))
    robot = loaded(tmp_path, draft, bus, "bench" if bus.is_virtual else "example_can0").robot
    assert {drive.profile for drive in robot.drives} == {profile}
    assert (robot.bus.interface, robot.bus.channel) == (bus.interface, bus.channel)


def test_two_axes_of_one_drive_are_two_wheels(tmp_path: Path) -> None:
    draft, _ = answer([FoundAxis(7, 0, "zlac8015d"), FoundAxis(7, 1, "zlac8015d")])
    assert [(d.joint, d.node_id, d.axis) for d in loaded(tmp_path, draft).robot.drives] == [
        ("left_wheel", 7, 0),
        ("right_wheel", 7, 1),
    ]


def test_four_wheels_have_four_names_and_a_drive_that_turns_no_wheel_has_none(tmp_path: Path) -> None:
    axes = [FoundAxis(node_id, 0, "generic") for node_id in (1, 2, 3, 4, 9)]
    sides = {"node1.side": "left", "node2.side": "right", "node3.side": "l", "node4.side": "r", "node9.side": "none"}
    draft, _ = answer(axes, FRESH | sides)
    assert [d.joint for d in loaded(tmp_path, draft).robot.drives] == [
        "left_wheel_1",
        "right_wheel_1",
        "left_wheel_2",
        "right_wheel_2",
    ]


def test_what_is_missing_to_stop_the_robot_is_told_and_written(tmp_path: Path) -> None:
    draft, told = answer(two(), FRESH | {"scanner": "no", "estop": "n"})
    safety = loaded(tmp_path, draft).robot.safety
    assert (safety.scan.required, safety.estop.required) == (False, False)
    assert ["scanner" in line or "emergency stop" in line for line in told] == [True, True]


@pytest.mark.parametrize("name", ["example_can0", "bench"])
def test_the_pose_of_the_scanner_is_asked_and_none_of_the_sample_stays(tmp_path: Path, name: str) -> None:
    pose = {"scanner.x_m": "-0.2", "scanner.y_m": "0.1", "scanner.yaw_deg": "180", "scanner.upside_down": "yes"}
    draft, _ = answer(two(), FRESH | pose)
    scan = loaded(tmp_path, draft, name=name).robot.safety.scan
    assert (scan.x_m, scan.y_m, scan.upside_down) == (-0.2, 0.1, True)
    assert scan.yaw_rad == pytest.approx(math.pi, abs=1e-5)
    with pytest.raises(KeyError):  # nobody answers: nothing is assumed
        answer(two(), {key: value for key, value in FRESH.items() if key != "scanner.x_m"})


@pytest.mark.parametrize(("sides", "reason"), [(("left", "left"), "each side"), (("none", "right"), "each side")])
def test_a_base_with_wheels_on_one_side_is_refused(sides: tuple[str, str], reason: str) -> None:
    with pytest.raises(CommissionError, match=reason):
        answer(two(), FRESH | {"node1.side": sides[0], "node2.side": sides[1]})


def test_more_wheels_than_canbase_drives_are_refused() -> None:
    with pytest.raises(CommissionError, match="9 wheels; canbase drives 8 axes at most"):
        answer([FoundAxis(node_id, 0, "generic") for node_id in range(1, 10)])


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("name", "my robot"), ("name", ""), ("node1.side", "front"), ("gear_ratio", "0"), ("gear_ratio", "10001"),
        ("counts_per_motor_rev", "0"), ("counts_per_motor_rev", "40.5"), ("counts_per_motor_rev", "2147483648"),
        ("wheel_radius_m", "0.005"), ("wheel_radius_m", "nan"), ("track_m", "6"), ("front_m", "-1"),
        ("linear_mps", "5.1"), ("linear_mps", "0"), ("scanner", "perhaps"), ("estop", ""),
        ("scanner.x_m", "6"), ("scanner.yaw_deg", "south"), ("scanner.upside_down", ""),
    ],
)  # fmt: skip
def test_an_answer_that_makes_no_sense_is_refused(key: str, text: str) -> None:
    with pytest.raises(ValueError, match=r".+"):
        answer(two(), FRESH | {key: text})


@pytest.mark.parametrize("speed", ["0.02", "0.5", "5"])
@pytest.mark.parametrize("track", ["0.03", "0.5", "5"])
def test_a_robot_of_any_size_passes_the_check_and_turns_no_faster_than_its_wheels_can(
    tmp_path: Path, speed: str, track: str
) -> None:
    draft, _ = answer(two(), FRESH | {"linear_mps": speed, "track_m": track})
    limits = loaded(tmp_path, draft).robot.limits
    assert limits.linear_mps == float(speed)
    assert 0.0 < limits.angular_radps <= min(2.0 * float(speed) / float(track) * 1.05, 0.81 * math.pi)


class Typist:
    """Types these words, then takes what is proposed."""

    def __init__(self, *typed: str) -> None:
        self.typed, self.asked, self.errors = list(typed), list[str](), list[str]()

    def tell(self, line: Tell) -> None:
        """Nothing is done with it."""

    def ask(self, question: Ask, _turn: Callable[[], None]) -> str:
        self.asked.append(question.key)
        return self.typed.pop(0) if self.typed else words(question, FRESH)

    def again(self, _question: Ask, error: ValueError) -> None:
        self.errors.append(str(error))

    def interrupts(self) -> bool:
        return False


def test_back_returns_to_the_question_before_and_the_later_answer_counts() -> None:
    person = Typist("back", "fred", "right", "back", "back", "anna", "left")
    draft = answered_draft(two(), person)
    asked = ["name", "name", "node1.side", "node1.gear_ratio", "node1.side", "name", "node1.side", "node1.gear_ratio"]
    assert person.asked[: len(asked)] == asked
    assert person.errors == ["this is the first question"]
    assert (draft.name, [wheel.side.value for wheel in draft.wheels]) == ("anna", ["left", "right"])
