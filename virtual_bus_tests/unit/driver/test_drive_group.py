"""All drives as one: sentences, standstill, power, travel of each side; and how their samples enter the odometry."""

from __future__ import annotations

import math

import pytest

from canbase_driver.cia301.emcy import Emcy
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.drives.canopen_node import Presence
from canbase_driver.drives.drive_group import Drives, age_s
from canbase_driver.drives.odometry_feed import OdometryFeed
from support.chain_world import BITS_PER_MPS, bench_robot, robot_of

ENABLED, SWITCHED_ON, QUICK_STOP, FAULT, REACTION, NO_STATE = 0x0637, 0x0633, 0x0617, 0x0618, 0x061F, 0x0601
COUNTS_PER_M = 4096 * 20 / (2.0 * math.pi * 0.1)
FOUR = robot_of((1, 0, "left"), (2, 0, "right"), (3, 0, "left"), (4, 0, "right"))


class Story:
    """Drives that are ready; `say` is what one of them answers to a SYNC."""

    def __init__(self, drives: Drives | None = None) -> None:
        self.drives = drives or Drives(bench_robot())
        self.feed = OdometryFeed(self.drives, bench_robot())
        self.now_s = 10.0
        for node in self.drives.nodes:
            node.presence, node.nmt_state = Presence.READY, NmtState.OPERATIONAL

    def say(self, number: int, word: int = ENABLED, travel_m: float = 0.0, speed_mps: float = 0.0) -> None:
        axis = self.drives.axes[number]
        counts, raw = (
            round(axis.drive.direction * value) for value in (travel_m * COUNTS_PER_M, speed_mps * BITS_PER_MPS)
        )
        axis.on_status(word.to_bytes(2, "little") + counts.to_bytes(4, "little", signed=True), self.now_s)
        axis.on_velocity(raw.to_bytes(4, "little", signed=True), self.now_s)
        self.feed.update(self.now_s)

    def all_say(self, *travels_m: float) -> None:
        self.now_s += 0.01
        for number, travel_m in enumerate(travels_m):
            self.say(number, travel_m=travel_m)

    @property
    def pose(self) -> tuple[float, float, float]:
        pose = self.feed.odometry.pose
        return pose.x_m, pose.y_m, pose.yaw_rad


@pytest.fixture
def story() -> Story:
    """Both wheels have just said that they stand, enabled."""
    made = Story()
    made.say(0)
    made.say(1)
    return made


def test_when_all_is_well_there_is_nothing_to_tell(story: Story) -> None:
    drives = story.drives
    assert (drives.booting(10.0), drives.absent(), drives.fault(), drives.disabled()) == ("", "", "", "")
    assert drives.are_fresh(10.0)
    assert drives.stand(10.0)
    assert drives.have_references()


@pytest.mark.parametrize(("speed_mps", "stands"), [(0.0049, True), (-0.0049, True), (0.0052, False), (-0.0052, False)])
def test_it_stands_while_every_rim_is_slower_than_the_limit(story: Story, speed_mps: float, stands: bool) -> None:
    story.say(1, speed_mps=speed_mps)
    assert story.drives.stand(10.0) is stands


def test_what_is_not_fresh_cannot_be_seen_to_stand_and_may_have_power(story: Story) -> None:
    story.say(0, SWITCHED_ON)
    story.now_s = 10.11
    story.say(1, SWITCHED_ON)
    assert not story.drives.stand(10.11)
    assert story.drives.may_have_power(10.11)


@pytest.mark.parametrize(
    ("word", "power"),
    [(ENABLED, True), (QUICK_STOP, True), (REACTION, True), (NO_STATE, True), (SWITCHED_ON, False), (FAULT, False)],
)
def test_which_states_may_have_power(story: Story, word: int, power: bool) -> None:
    story.say(0, SWITCHED_ON)
    story.say(1, word)
    assert story.drives.may_have_power(10.0) is power


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (SWITCHED_ON, "switched on (an input that enables it, or a brake that opens slowly?)"),
        (NO_STATE, "in no state known"),
    ],
)
def test_who_is_not_enabled_is_named(story: Story, word: int, state: str) -> None:
    story.say(1, word)
    assert story.drives.disabled() == f"right_wheel (node 2) is {state}"


def test_an_emcy_of_the_wheel_that_does_not_follow_is_told(story: Story) -> None:
    story.drives.nodes[1].emcy = Emcy(2, 0x8250, 0x20, b"")
    assert story.drives.not_following(1) == ""
    assert story.drives.not_following(2).startswith("right_wheel (node 2) reports 8250h")


@pytest.mark.parametrize(
    ("left", "right", "node_id", "said"),
    [
        (ENABLED, ENABLED, 0, ""),
        (ENABLED, ENABLED & ~0x0200, 0, "right_wheel (node 2) may be in local mode"),
        (ENABLED, ENABLED & ~0x0200, 2, "right_wheel (node 2) may be in local mode"),
        (ENABLED, ENABLED & ~0x0200, 1, ""),
        (
            ENABLED,
            ENABLED | 0x0800,
            0,
            "right_wheel (node 2): a limit in the drive is active (statusword bit 11): 607Fh",
        ),
        (ENABLED | 0x0800, ENABLED | 0x0800, 1, "left_wheel (node 1): a limit in the drive is active"),
        (ENABLED | 0x0800, ENABLED, 2, ""),
    ],
)
def test_what_a_statusword_says_about_a_wheel_that_does_not_follow(
    story: Story, left: int, right: int, node_id: int, said: str
) -> None:
    story.say(0, left)
    story.say(1, right)
    found = story.drives.not_following(node_id)
    assert found.startswith(said)
    assert bool(found) is bool(said)


@pytest.mark.parametrize("word", [FAULT, REACTION])
def test_a_fault_is_named_with_the_code_that_the_drive_gave(story: Story, word: int) -> None:
    story.say(1, word)
    assert story.drives.fault().startswith("right_wheel (node 2): no code given: see canbase bus emcy")
    story.drives.nodes[1].emcy = Emcy(2, 0x7305, 0x20, b"")
    assert story.drives.fault() == "right_wheel (node 2): 7305h encoder"


@pytest.mark.parametrize(
    ("word", "emcy", "said"),
    [
        (0x0640, None, "switch on disabled; if it stays: STO, main voltage, RPDO1?"),
        (
            0x0640,
            Emcy(2, 0xFF90, 0x80, b""),
            "switch on disabled; if it stays: STO, main voltage, RPDO1?; it reports FF90h",
        ),
        (0x0600, None, "not ready to switch on; if it stays: see its display"),
        (0x0440, None, "switch on disabled; if it stays: STO, main voltage, RPDO1?; it is in local mode"),
    ],
)
def test_a_drive_that_is_not_switched_on_is_told_with_where_to_look(
    story: Story, word: int, emcy: Emcy | None, said: str
) -> None:
    story.drives.nodes[1].emcy = emcy
    story.say(1, word)
    assert story.drives.unprepared().startswith(f"right_wheel (node 2) is in {said}")


def test_a_position_that_wraps_is_told_until_there_is_no_power(story: Story) -> None:
    travel = story.drives.axes[1].travel
    assert story.drives.wrapping() == ""
    travel.wraps_by = 64_321
    assert story.drives.wrapping().startswith("right_wheel (node 2): 6064h has jumped twice by about 64000 counts")
    story.drives.forget_jumps()
    assert story.drives.wrapping() == ""


def test_an_emergency_message_alone_is_no_fault_and_goes_with_a_reset(story: Story) -> None:
    story.drives.nodes[1].emcy = Emcy(2, 0x7305, 0x20, b"")
    assert story.drives.fault() == ""
    assert story.drives.snapshots(10.0)[1].error_text == "encoder"
    story.drives.forget_emcys()
    assert story.drives.snapshots(10.0)[1].error_code == 0


def test_the_first_node_that_is_silent_is_named(story: Story) -> None:
    for node in story.drives.nodes:
        node.heartbeat_at = 10.0
    assert story.drives.silent(10.0, 9.0) == ""
    assert (
        story.drives.silent(10.2, 9.0)
        == "node 1 (left_wheel): no status (6041h, 6064h) for 0.20 s (timeouts.feedback_s 0.1 s)"
    )


def test_several_wheels_on_a_side_are_averaged_and_the_fastest_is_found() -> None:
    story = Story(Drives(FOUR))
    story.all_say(0.0, 0.0, 0.0, 0.0)
    story.all_say(0.002, 0.003, 0.004, 0.005)
    assert story.drives.travel_m() == pytest.approx((0.003, 0.004), abs=1e-5)
    for number, speed_mps in enumerate((0.1, -0.5, 0.3, 0.2)):
        story.say(number, speed_mps=speed_mps)
    assert story.drives.speeds_mps() == pytest.approx((0.2, -0.15), abs=1e-3)
    assert story.drives.fastest().drive.joint == "right_2_0"


def test_a_snapshot_is_in_the_order_of_robot_yaml_and_in_rad() -> None:
    robot = bench_robot()
    story = Story(Drives(robot.model_copy(update={"drives": robot.drives[::-1]})))
    story.say(0, speed_mps=0.2)
    story.drives.nodes[0].nmt_state = None
    right, left = story.drives.snapshots(10.05)
    assert (right.joint, right.node_id, left.joint, left.node_id) == ("right_wheel", 2, "left_wheel", 1)
    assert right.velocity_radps == pytest.approx(2.0, abs=1e-3)
    assert right.feedback_age_s == pytest.approx(0.05)
    assert math.isnan(right.heartbeat_age_s)
    assert math.isnan(left.feedback_age_s)
    assert (left.nmt_state, left.state) == (None, None)


def test_the_age_of_what_never_was_is_nan() -> None:
    assert math.isnan(age_s(10.0, -math.inf))
    assert age_s(10.0, 9.5) == 0.5


def test_a_sample_enters_the_odometry_when_all_wheels_have_given_theirs(story: Story) -> None:
    assert story.feed.serial == 1
    story.now_s = 10.01
    story.say(0, travel_m=0.004)
    assert story.feed.serial == 1
    story.say(1, travel_m=0.004)
    assert story.feed.serial == 2
    assert story.pose == pytest.approx((0.004, 0.0, 0.0), abs=1e-5)
    assert story.feed.odometry.twist.linear_mps == pytest.approx(0.4, abs=0.01)


def test_after_a_silence_a_wheel_that_speaks_first_turns_no_pose(story: Story) -> None:
    """The right wheel's last sample before the silence found no partner; the left wheel's first one after it comes."""
    story.now_s = 10.01
    story.say(1, travel_m=0.004)
    story.now_s = 11.0
    story.say(0, travel_m=0.3)
    assert story.pose == (0.0, 0.0, 0.0)
    story.say(1, travel_m=0.3)
    assert story.pose == pytest.approx((0.3, 0.0, 0.0), abs=1e-4)


def test_two_samples_at_the_same_time_are_one(story: Story) -> None:
    story.say(0)
    story.say(1)
    assert story.feed.serial == 1


def test_while_one_wheel_has_no_reference_the_pose_stands_still_and_goes_on_without_a_turn(story: Story) -> None:
    story.drives.axes[0].forget()
    story.all_say(5.0, 0.003)  # the left drive counts from elsewhere, the right one has rolled on
    assert story.pose == pytest.approx((0.0, 0.0, 0.0))
    assert story.drives.losses() == 1
    story.all_say(5.003, 0.006)
    assert story.pose == pytest.approx((0.003, 0.0, 0.0), abs=1e-5)


def test_a_counter_that_jumps_for_good_costs_all_wheels_the_same_way(story: Story) -> None:
    for cycle in range(1, 4):
        story.all_say(7.0 + 0.003 * cycle, 0.003 * cycle)
    assert story.drives.losses() == 1
    story.all_say(7.012, 0.012)
    assert story.pose == pytest.approx((0.003, 0.0, 0.0), abs=1e-4)


def test_a_single_jump_that_comes_back_costs_nothing(story: Story) -> None:
    story.all_say(7.0, 0.003)
    assert not story.drives.have_references()
    story.all_say(0.006, 0.006)
    assert story.drives.losses() == 0
    assert story.pose == pytest.approx((0.006, 0.0, 0.0), abs=1e-5)
