"""Driver, filter and watchdog write the frames that they share apart from each other; here both sides are compared.

What docs/bus.md says is tested in bytes on each side; this finds the side that was changed alone.
"""

from __future__ import annotations

import pytest

from canbase_config.derive import watched_drive
from canbase_config.drive import Drive
from canbase_config.load import load_robot, sample
from canbase_config.object_map import place
from canbase_config.profile_file import load_profile, profile_names
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID
from canbase_driver import cia402
from canbase_driver.cia301 import nmt as cia301
from canbase_driver.cia301 import pdo
from canbase_driver.cia301.frame import Frame as DriverFrame
from canbase_driver.drive_units import AxisUnits
from canbase_driver.supervision import watchdog_link
from canbase_velocity.lease import lease_datagram
from canbase_velocity.twist import Twist
from canbase_watchdog import frames, lease
from canbase_watchdog.ladder import Step
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import Answer, State

BENCH = load_robot(sample("bench")).robot
WHEEL = {"joint": "wheel", "node_id": 5, "side": "left", "gear_ratio": 20.0, "counts_per_motor_rev": 4096}
NEEDED = {name: {"velocity_unit": "0.001rev/s"} for name in ("nanotec", "dryve_d1")}
"""What profiles do not know."""


@pytest.mark.parametrize(("linear", "angular", "hard"), [(0.0, 0.0, True), (0.25, -1.5, False), (-1e-9, 1e9, True)])
def test_the_watchdog_reads_the_lease_that_the_filter_writes(linear: float, angular: float, hard: bool) -> None:
    read = lease.parse(lease_datagram(2**40, 2**50, Twist(linear, angular), brakes_hard=hard))
    assert isinstance(read, lease.Lease)
    assert (read.sequence, read.stamp_ns, read.linear_mps, read.angular_radps) == (2**40, 2**50, linear, angular)
    assert read.brakes_hard is hard


@pytest.mark.parametrize("state", list(State))
def test_the_driver_reads_the_state_frame_that_the_watchdog_writes(state: State) -> None:
    ours = frames.state(state, TripCause.DRIVE_SILENT, Step.PRE_OPERATIONAL, 7, 0.251, (9, Answer.CAUSE_STANDS))
    read = watchdog_link.parse_state(DriverFrame(ours.cob_id, ours.data))
    assert read == watchdog_link.WatchdogState(int(state), 3, 2, 7, 251, 9, 2)


@pytest.mark.parametrize("step", list(Step))
@pytest.mark.parametrize("armed", [False, True])
@pytest.mark.parametrize("hard", [False, True])
def test_the_bits_beside_the_rung_of_a_state_frame_are_read_apart(step: Step, armed: bool, hard: bool) -> None:
    ours = frames.state(State.WATCHING, 0, step, 0, 0.0, (0, 0), armed=armed, brakes_hard=hard)
    read = watchdog_link.parse_state(DriverFrame(ours.cob_id, ours.data))
    assert read is not None
    assert (read.rung, read.armed, read.brakes_hard) == (int(step), armed, hard)


def test_states_and_answers_have_the_same_numbers() -> None:
    numbers = (watchdog_link.STARTING, watchdog_link.WATCHING, watchdog_link.TRIPPED)
    assert numbers == tuple(State)
    assert set(watchdog_link.ANSWERS) == set(Answer) - {Answer.NONE}
    assert set(watchdog_link.ACCEPTED) == {Answer.DONE, Answer.NOT_TRIPPED}


def test_the_driver_reads_the_counters_that_the_watchdog_writes() -> None:
    ours = frames.counters(refused=1, dropped=2, bus_errors=70_000, trips=4, gap_s=0.0061)
    read = watchdog_link.parse_counters(DriverFrame(ours.cob_id, ours.data))
    assert read == watchdog_link.WatchdogCounters(1, 2, 65_535, 4, 6)


def test_every_cause_of_the_watchdog_has_words_at_the_driver() -> None:
    assert set(watchdog_link.CAUSES) == set(TripCause)


@pytest.mark.parametrize(
    "cause",
    [
        TripCause.NONE,
        TripCause.LEASE_LOST,
        TripCause.DRIVER_SILENT,
        TripCause.DRIVE_SILENT,
        TripCause.FEEDBACK_IMPLAUSIBLE,
        TripCause.FOREIGN_MASTER,
    ],
)
def test_causes_have_the_same_names(cause: TripCause) -> None:
    assert watchdog_link.CAUSES[cause].partition(",")[0] == cause.name.lower().replace("_", " ")


def test_stop_frames_of_canbase_itself_are_not_blamed_on_another_master() -> None:
    assert "stop frames of canbase itself" in watchdog_link.CAUSES[TripCause.FOREIGN_MASTER]


def test_the_watchdog_reads_the_reset_request_that_the_driver_writes() -> None:
    request = watchdog_link.WatchdogLink(0.2).request_reset()
    assert request.cob_id == frames.RESET_REQUEST
    assert frames.decode_reset_request(bytes(request.data)) == request.data[0]


@pytest.mark.parametrize("place", [0, 1])
def test_the_pdos_that_the_driver_maps_are_those_that_the_watchdog_reads_and_writes(place: int) -> None:
    node_id = 5
    mapped = {(p.kind, p.number): p for p in pdo.NodeLayout(node_id, (0, 1)).pdos()}
    assert mapped["TPDO", 1 + 2 * place].cob_id == frames.STATUS_TPDO[place] + node_id
    assert mapped["TPDO", 2 + 2 * place].cob_id == frames.VELOCITY_TPDO[place] + node_id
    assert mapped["RPDO", 1 + place].cob_id == frames.SETPOINT_RPDO[place] + node_id
    assert mapped["RPDO", 4].cob_id == frames.QUICK_STOP_RPDO + node_id
    assert mapped["RPDO", 4].mapping == (0x60400010, 0x68400010)


def test_status_velocity_and_setpoints_mean_the_same_on_both_sides() -> None:
    setpoint = pdo.pack_setpoint(0x0F, -300)
    assert frames.decode_setpoint(setpoint) == (0x0F, -300)
    status, velocity = bytes.fromhex("37 02 fe ff ff ff"), bytes.fromhex("d4 fe ff ff")
    both = pdo.unpack_status(status)
    assert both is not None
    assert frames.decode_status(status) == both
    assert frames.decode_velocity(velocity) == pdo.unpack_velocity(velocity)


def test_node_ids_heartbeats_and_nmt_are_the_same() -> None:
    driver = cia301.heartbeat(DRIVER_NODE_ID, cia301.NmtState.OPERATIONAL)
    watchdog = cia301.heartbeat(WATCHDOG_NODE_ID, cia301.NmtState.OPERATIONAL)
    assert driver.cob_id == frames.DRIVER_HEARTBEAT
    assert frames.heartbeat() == frames.Frame(watchdog.cob_id, bytes(watchdog.data))
    assert cia301.SYNC.cob_id == frames.SYNC
    stop = cia301.nmt(cia301.NmtCommand.ENTER_PRE_OPERATIONAL, 5)
    assert frames.pre_operational(5) == frames.Frame(stop.cob_id, bytes(stop.data))
    assert (cia301.SDO_TO_CLIENT, cia301.SDO_TO_SERVER) == (frames.SDO_ANSWER, frames.SDO_REQUEST)


def test_every_statusword_is_the_same_state_on_both_sides() -> None:
    for word in range(0x10000):
        theirs, ours = cia402.decode_statusword(word), frames.decode_state(word)
        assert getattr(theirs, "name", None) == getattr(ours, "name", None), f"{word:04X}h"


def test_the_words_that_stop_are_the_same() -> None:
    assert cia402.Command.QUICK_STOP.value == frames.QUICK_STOP_WORD
    assert cia402.Command.DISABLE_VOLTAGE.value == frames.DISABLE_VOLTAGE_WORD
    assert [command for command in cia402.Command if frames.asks_for_power(command.value)] == [
        cia402.Command.ENABLE_OPERATION
    ]


def test_the_watchdog_sees_the_enable_of_mode_2_and_that_none_of_its_stops_follows_a_target() -> None:
    """Bits 4 to 6: the ramp of mode 2."""
    assert frames.asks_for_power(cia402.Command.ENABLE_OPERATION.value | cia402.VL_RAMP)
    stops = [command for command in cia402.Command if command is not cia402.Command.ENABLE_OPERATION]
    assert not any(frames.asks_for_power(command.value | cia402.VL_RAMP) for command in stops)


@pytest.mark.parametrize("name", profile_names())
def test_both_sides_read_and_write_every_kind_of_drive_alike(name: str) -> None:
    """The driver by the profile, the watchdog by what it is told of it."""
    profile = load_profile(name)
    layout = profile.layout
    for axis in range(layout.axes):
        drive = Drive.model_validate(WHEEL | NEEDED.get(name, {}) | {"profile": name, "axis": axis})
        watched = watched_drive(drive, 0.1, 8.0)
        bits = pdo.pack_setpoint(0x0F, -300, layout)
        assert frames.decode_setpoint(bits, watched.layout) == (0x0F, -300)
        status = bytes.fromhex("37 02 21 06 fe ff ff ff")[: 8 if layout.statusword == "packed" else 6]
        assert frames.decode_status(status, watched.layout, axis) == pdo.unpack_status(status, layout, axis)
        velocity = (-300).to_bytes(layout.velocity_bits // 8, "little", signed=True)
        assert frames.decode_velocity(velocity, watched.layout) == pdo.unpack_velocity(velocity, layout) == -300
        joined = bytes.fromhex("37 02 fe ff ff ff d4 fe")
        own = pdo.unpack_velocity(pdo.joined_velocity(joined, layout), layout)
        assert frames.decode_joined_velocity(joined, watched.layout) == own
        assert (own == -300) == layout.fits_one_tpdo
        assert frames.decode_status(joined, watched.layout, axis) == pdo.unpack_status(joined, layout, axis)
        for index in (0x6040, 0x6041, 0x606C):
            at = place(profile, index, axis)
            assert frames.place_of(index, axis, watched.layout) == (at.index, at.sub)
        units = AxisUnits(drive, BENCH.base)
        assert watched.mps_per_bit * units.velocity_raw(0.5) == pytest.approx(0.5, abs=abs(watched.mps_per_bit))
        assert watched.velocity_mps_per_bit * 1000 == pytest.approx(units.velocity_mps(1000))
    both = pdo.NodeLayout(5, tuple(range(layout.axes)), profile)
    quick_stop = next(pdo for pdo in both.pdos() if pdo.cob_id == 0x505)
    length = sum(entry & 0xFF for entry in quick_stop.mapping) // 8
    assert len(frames.quick_stop(5, layout.axes, watched.layout).data) == length
