"""The rows of doctor about the bus: one robot that is well, and one change after another to it."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.can_interface import Link, parse_link
from canbase_config.drive import Identity
from canbase_config.load import load_robot, sample
from canbase_doctor.bus_checks import IN_USE, BusEvidence, bus_checks
from canbase_doctor.check import Verdict
from canbase_doctor.inspection import Inspection, Part
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia402 import DriveState
from canbase_driver.supervision.bus_health import ControllerState

WELL = Link(
    "can0", "can", True, 500_000, ControllerState.ERROR_ACTIVE, restart_ms=100, queue_length=64, counters={"bus_off": 0}
)
DRIVES = ["701 05", "702 05", "181 37 02 00 00 00 00", "182 37 02 00 00 00 00"]
DRIVER, WATCHDOG = ["77F 05", "080"], ["77E 05", "1FE 01 00 00 00 0A 00 00 00", "2FE 00 00 00 00 00 00 00 05"]


def inspection(node_id: int, **changes: Any) -> Inspection:
    """A node that is as in robot.yaml."""
    joint = {1: "left_wheel", 2: "right_wheel"}[node_id]
    well = Inspection(
        node_id, Identity(vendor_id=0, product_code=0xCB402, revision=1, serial=node_id), "", None,
        {joint: DriveState.OPERATION_ENABLED}, {joint: 0}, Part(), Part(), Part(), "heartbeat of the watchdog",
    )  # fmt: skip
    return dataclasses.replace(well, **changes)


def heard(*frames: str) -> Listener:
    """All within the last second; the drives speak last."""
    listener = Listener(10.0)
    for i, text in enumerate(frames):
        cob_id, _, data = text.partition(" ")
        listener.on_frame(Frame(int(cob_id, 16), bytes.fromhex(data)), 10.9 + i * 0.001)
    return listener


def evidence(**changes: Any) -> BusEvidence:
    robot = load_robot(sample("example_can0")).robot
    well = BusEvidence(
        robot, heard(*DRIVER, *WATCHDOG, *DRIVES), 11.0, "", WELL, {node_id: inspection(node_id) for node_id in (1, 2)}
    )
    return dataclasses.replace(well, **changes)


def alone(**changes: Any) -> BusEvidence:
    """Without driver and watchdog."""
    return evidence(**({"heard": heard(*DRIVES)} | changes))


def not_ok(seen: BusEvidence) -> list[tuple[str, Verdict]]:
    return [(check.name, check.verdict) for check in bus_checks(seen) if check.verdict is not Verdict.OK]


def row(seen: BusEvidence, name: str) -> str:
    """What was found, and what to do next."""
    check = next(check for check in bus_checks(seen) if check.name == name)
    return f"{check.found} → {check.advice}"


def test_nothing_is_wrong_with_a_robot_that_is_well_beside_its_driver_or_alone() -> None:
    assert not_ok(evidence()) == []
    assert not_ok(alone()) == []


def test_a_bus_that_cannot_be_opened_is_the_only_row() -> None:
    assert [check.verdict for check in bus_checks(evidence(problem="can0: no such device"))] == [Verdict.FAIL]


@pytest.mark.parametrize(
    ("change", "row_name", "verdict"),
    [
        ({"is_up": False}, "CAN interface", Verdict.FAIL),
        ({"bitrate": 250_000}, "bit rate", Verdict.FAIL),
        ({"state": ControllerState.BUS_OFF}, "CAN controller", Verdict.FAIL),
        ({"state": ControllerState.ERROR_PASSIVE}, "CAN controller", Verdict.FAIL),
        ({"state": ControllerState.ERROR_WARNING}, "CAN controller", Verdict.WARN),
        ({"state": ControllerState.UNKNOWN}, "CAN controller", Verdict.WARN),
        ({"receive_errors": 3}, "CAN controller", Verdict.WARN),
        ({"counters": {"bus_off": 1}}, "CAN controller", Verdict.WARN),
        ({"restart_ms": 0}, "interface settings", Verdict.WARN),
        ({"queue_length": 10}, "interface settings", Verdict.WARN),
        ({"queue_length": 31}, "interface settings", Verdict.WARN),
        ({"queue_length": 1000}, "interface settings", Verdict.WARN),
    ],
)
def test_each_thing_that_can_be_wrong_with_the_interface(
    change: dict[str, Any], row_name: str, verdict: Verdict
) -> None:
    assert not_ok(evidence(link=dataclasses.replace(WELL, **change))) == [(row_name, verdict)]


@pytest.mark.parametrize(("frames", "verdict"), [(2000, None), (3000, Verdict.WARN), (4200, Verdict.FAIL)])
def test_the_load_of_the_bus(frames: int, verdict: Verdict | None) -> None:
    """108 bits each on 500 kbit/s: 0.43, 0.65, 0.91."""
    seen = alone()
    seen.heard.frames, seen.heard.bits = frames, frames * 108
    assert not_ok(seen) == ([("bus load", verdict)] if verdict else [])


def test_another_master_without_canbase_fails() -> None:
    assert not_ok(alone(heard=heard("080", *DRIVES))) == [("masters", Verdict.FAIL)]


def test_a_tripped_watchdog_tells_cause_node_and_rung() -> None:
    seen = evidence(heard=heard(*DRIVER, "77E 05", "1FE 02 06 03 02 0A 00 00 00", *DRIVES))
    told = row(seen, "watchdog's state (1FEh)")
    assert "tripped" in told
    assert "cause: overspeed of node 2, rung: disable voltage" in told


def test_a_watchdog_or_driver_that_is_silent_fails() -> None:
    assert not_ok(evidence(heard=heard(*DRIVER, *DRIVES))) == [("watchdog's state (1FEh)", Verdict.FAIL)]
    assert not_ok(evidence(heard=heard(*WATCHDOG, *DRIVES))) == [("driver's heartbeat (77Fh)", Verdict.FAIL)]
    assert ("watchdog's state (1FEh)", Verdict.FAIL) in not_ok(evidence(now_s=11.2))
    for seen in (evidence(heard=heard(*DRIVER, *DRIVES)), evidence(now_s=11.2)):  # "it hangs" alone helps nobody
        assert "restart its service, or end `canbase up`" in row(seen, "watchdog's state (1FEh)")


def test_the_watchdogs_counters_are_shown_and_refused_leases_are_a_warning() -> None:
    assert "longest pause of its loop 5 ms" in row(evidence(), "watchdog's counters (2FEh)")
    refused = heard(*DRIVER, "77E 05", WATCHDOG[1], "2FE 07 00 00 00 00 00 00 05", *DRIVES)
    assert not_ok(evidence(heard=refused)) == [("watchdog's counters (2FEh)", Verdict.WARN)]


@pytest.mark.parametrize("part", ["settings", "pdos", "self_stop_part"])
def test_a_difference_is_expected_without_the_driver_and_beside_it_accuses_nobody(part: str) -> None:
    """A drive that refuses a value at its boot differs for good, and is well."""
    differs = {1: inspection(1, **{part: Part(("6085h:0: 01h → 02h",))}), 2: inspection(2)}
    assert not_ok(alone(inspections=differs)) == []
    seen = evidence(inspections=differs)
    [(name, verdict)] = not_ok(seen)
    assert verdict is Verdict.WARN
    assert "or it has been changed since: cannot tell → restart motor_driver" in row(seen, name)
    stopped = evidence(inspections=differs, heard=heard(*DRIVER, *WATCHDOG, "701 7F", *DRIVES[1:]))
    assert [verdict for _, verdict in not_ok(stopped)].count(Verdict.FAIL) == 2
    assert "could not boot this drive" in row(stopped, name)


def test_a_drive_that_cannot_stop_by_itself_is_a_warning_that_names_sto() -> None:
    never = inspection(1, self_stop="", self_stop_part=Part((), ("1016h: the drive watches no heartbeat",)))
    seen = alone(inspections={1: never, 2: inspection(2)})
    assert not_ok(seen) == [("node 1 (left_wheel): stops by itself", Verdict.WARN)]
    assert "STO" in row(seen, "node 1 (left_wheel): stops by itself")


def test_faults_identity_profile_and_emergencies() -> None:
    broken = {
        1: inspection(1, states={"left_wheel": DriveState.FAULT}, error_codes={"left_wheel": 0x2310}),
        2: inspection(2, wrong_identity="vendor_id is 1h, robot.yaml expects 2h"),
    }
    assert not_ok(alone(inspections=broken)) == [
        ("node 1 (left_wheel): state", Verdict.FAIL),
        ("node 2 (right_wheel)", Verdict.FAIL),
    ]
    assert "2310h over-current" in row(alone(inspections=broken), "node 1 (left_wheel): state")
    other = {1: inspection(1, guessed="epos4"), 2: inspection(2)}
    assert not_ok(alone(inspections=other)) == [("node 1 (left_wheel)", Verdict.WARN)]
    with_emcy = heard(*DRIVES, "081 10 42 08 00 00 00 00 00")
    assert not_ok(alone(heard=with_emcy)) == [("node 1 (left_wheel): state", Verdict.WARN)]


def test_a_node_that_the_driver_boots_is_a_warning_and_one_that_is_not_there_fails() -> None:
    seen = evidence(inspections={1: inspection(1)}, unread={2: "its SDO channel is in use all the time"})
    assert not_ok(seen) == [("node 2 (right_wheel)", Verdict.WARN)]
    gone = evidence(heard=heard(*DRIVER, *WATCHDOG, "701 05"), inspections={1: inspection(1)}, unread={2: "no answer"})
    assert not_ok(gone) == [("node 2 (right_wheel)", Verdict.FAIL)]


def test_a_node_that_is_not_in_robot_yaml_is_a_warning() -> None:
    assert not_ok(alone(heard=heard(*DRIVES, "709 05"))) == [("other nodes", Verdict.WARN)]


IP = """[{"ifindex":4,"ifname":"can0","flags":["NOARP","UP","LOWER_UP","ECHO"],"mtu":16,"qdisc":"pfifo_fast",
"operstate":"UP","linkmode":"DEFAULT","group":"default","txqlen":64,"link_type":"can","promiscuity":0,"allmulti":0,
"min_mtu":0,"max_mtu":0,"linkinfo":{"info_kind":"can","info_data":{"ctrlmode_supported":["LOOPBACK","LISTEN-ONLY",
"TRIPLE-SAMPLING","ONE-SHOT","BERR-REPORTING","PRESUME-ACK","CC-LEN8-DLC"],"state":"ERROR-ACTIVE",
"berr_counter":{"tx":0,"rx":0},"restart_ms":100,"bittiming":{"bitrate":500000,"sample_point":"0.875","tq":125,
"prop_seg":6,"phase_seg1":7,"phase_seg2":2,"sjw":1,"brp":1},"bittiming_const":{"name":"sja1000",
"tseg1":{"min":1,"max":16},"tseg2":{"min":1,"max":8},"sjw":{"min":1,"max":4},"brp":{"min":1,"max":64},"brp_inc":1},
"clock":8000000},"info_xstats":{"restarts":0,"bus_error":0,"arbitration_lost":0,"error_warning":0,"error_passive":0,
"bus_off":0}},"num_tx_queues":1,"num_rx_queues":1,"gso_max_size":65536,"gso_max_segs":65535,"tso_max_size":65536,
"tso_max_segs":65535,"gro_max_size":65536,"parentbus":"pci","parentdev":"0000:00:10.0","stats64":{"rx":{"bytes":46571,
"packets":9591,"errors":0,"dropped":0,"over_errors":0,"multicast":0},"tx":{"bytes":34848,"packets":8014,"errors":0,
"dropped":0,"carrier_errors":0,"collisions":0}}}]"""
"""`ip -details -statistics -json link show can0` of iproute2 6.1, an SJA1000 that a driver and a watchdog use."""
NO_ERRORS = {"restarts": 0, "bus_error": 0, "error_warning": 0, "error_passive": 0, "bus_off": 0}


def test_what_ip_tells_about_a_can_interface() -> None:
    assert parse_link(IP) == Link("can0", "can", True, 500_000, ControllerState.ERROR_ACTIVE, 0, 0, 100, 64, NO_ERRORS)


def test_each_number_is_taken_from_its_own_place() -> None:
    told = json.loads(IP)
    info = told[0]["linkinfo"]
    info["info_data"] |= {"state": "ERROR-WARNING", "berr_counter": {"tx": 8, "rx": 127}}
    counters = {"restarts": 1, "bus_error": 2, "error_warning": 3, "error_passive": 4, "bus_off": 5}
    info["info_xstats"] |= counters

    found = parse_link(json.dumps(told))

    assert found == Link("can0", "can", True, 500_000, ControllerState.ERROR_WARNING, 8, 127, 100, 64, counters)


@pytest.mark.parametrize("text", ["", "[]", "[{}]", "{}", "Device does not exist"])
def test_no_interface_is_none(text: str) -> None:
    assert parse_link(text) is None


def test_a_drive_that_the_driver_could_not_boot_is_a_failure_and_nobody_is_accused() -> None:
    """It sends no heartbeat, or a pre-operational one: the driver is alive and the robot never starts."""
    for beats in ([], ["701 7F"]):
        seen = evidence(
            heard=heard(*DRIVER, *WATCHDOG, *beats, *DRIVES[1:]),
            inspections={1: inspection(1, pdos=Part(("1400h:2: FFh → 01h",))), 2: inspection(2)},
        )
        failed = {check.name: check for check in bus_checks(seen) if check.verdict is Verdict.FAIL}
        assert "node 1 (left_wheel): state" in failed
        assert failed["node 1 (left_wheel): PDO mapping"].advice.startswith("the driver could not boot this drive")


def test_more_syncs_than_the_drivers_are_another_masters_and_a_frame_twice_now_and_then_is_none() -> None:
    for syncs, verdict in ((100, Verdict.OK), (140, Verdict.OK), (200, Verdict.FAIL)):
        seen = evidence(heard=heard(*DRIVER, *WATCHDOG, *["080"] * (syncs - 1), *DRIVES), now_s=11.0)
        assert next(check for check in bus_checks(seen) if check.name == "masters").verdict is verdict
    alone_with_it = evidence(heard=heard("080", *WATCHDOG, *DRIVES))
    assert "of which canbase's driver sends 0 → another program" in row(alone_with_it, "masters")


@pytest.mark.parametrize(
    ("cause", "frames", "advice"),
    [
        (1, DRIVER, "does safety_filter run"),
        (2, DRIVER, "motor_driver lives now"),
        (2, [], "does motor_driver run"),
        (8, DRIVER, "another program"),
        (10, DRIVER, "is this computer overloaded"),
        (3, DRIVER, "remove the cause"),
    ],
)
def test_a_trip_that_is_about_no_drive_names_the_part(cause: int, frames: list[str], advice: str) -> None:
    seen = evidence(heard=heard(*frames, "77E 05", f"1FE 02 {cause:02X} 01 00 0A 00 00 00", *DRIVES))
    assert f" → {advice}" in row(seen, "watchdog's state (1FEh)")
    assert row(seen, "watchdog's state (1FEh)").endswith("canbase reset")


def test_a_drive_that_sends_frames_and_does_not_answer_is_no_matter_of_its_channel() -> None:
    silent = evidence(inspections={1: inspection(1)}, unread={2: "node 2, 6041h:0: no answer to 3 requests"})
    assert "frames get lost" in row(silent, "node 2 (right_wheel)")
    busy = evidence(inspections={1: inspection(1)}, unread={2: IN_USE})
    assert "run doctor again" in row(busy, "node 2 (right_wheel)")


def test_a_drive_that_is_booted_and_waits_for_another_one_is_not_accused() -> None:
    waits = heard(*DRIVER, *WATCHDOG, "701 7F", *DRIVES[1:])
    assert not_ok(evidence(heard=waits)) == [("node 1 (left_wheel): state", Verdict.WARN)]
    assert "when all drives are ready" in row(evidence(heard=waits), "node 1 (left_wheel): state")
    for differs in ({"settings": Part(("6085h",))}, {"pdos": Part(problem="no")}, {"wrong_identity": "another"}):
        seen = evidence(heard=waits, inspections={1: inspection(1, **differs), 2: inspection(2)})
        assert ("node 1 (left_wheel): state", Verdict.FAIL) in not_ok(seen)
