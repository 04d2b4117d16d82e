"""The bench as a whole: robot.yaml, encoders, faults, two-axis nodes, and that looking changes nothing."""

from __future__ import annotations

import struct
from dataclasses import replace
from math import pi

import pytest

from canbase_sim import faults
from canbase_sim.cia402.raw_units import Scale
from canbase_sim.cia402.states import State
from canbase_sim.frame import Frame
from canbase_sim.personality import GENERIC, PERSONALITIES, Personality
from canbase_sim.world.bench import Bench, BenchParameters, Truth
from canbase_sim.world.trace import Trace
from support.sim_rig import MPS, Rig, robot

COUNTS_PER_M = 4096 * 10 / (2 * pi * 0.1)


def test_forward_turns_both_motors_their_own_way() -> None:
    rig = Rig()
    start = rig.read(0x6064), rig.read(0x6064, node=2)
    rig.drive(MPS // 2, MPS // 2, 2.0)
    truth = rig.bench.truth(rig.now_s)
    left, right = rig.read(0x6064) - start[0], rig.read(0x6064, node=2) - start[1]
    assert truth.x_m == pytest.approx(0.875, abs=0.01)  # 0.5 s of ramp count half
    assert left == pytest.approx(truth.x_m * COUNTS_PER_M, abs=1.0)
    assert right == pytest.approx(-truth.x_m * COUNTS_PER_M, abs=1.0)


def test_the_encoder_counts_whole_increments_and_wraps_at_32_bits() -> None:
    scale = Scale(target_mps=0.001, actual_mps=0.001, slope_mps2=0.001, counts_per_m=1000.0)
    assert [scale.counts(way, 0) for way in (0.0, 0.0009, 0.001, -0.0001)] == [0, 0, 1, -1]
    top = 2**31 - 1
    assert [scale.counts(way, top) for way in (0.0, 0.001, 0.002)] == [top, -(2**31), -(2**31) + 1]
    assert scale.counts(-0.001, -(2**31)) == top


@pytest.mark.parametrize(
    ("unit", "raw"),
    [
        ("rpm", 60),
        ("0.1rpm", 600),
        ("0.001rpm", 60_000),
        ("rev/s", 1),
        ("0.001rev/s", 1000),
        ("counts/s", 4096),
        ("0.1counts/s", 40_960),
    ],
)
def test_one_motor_revolution_per_second_in_every_unit(unit: str, raw: int) -> None:
    wheel = {"node_id": 1, "side": "left", "velocity_unit": unit}
    drive = robot({"joint": "left", **wheel}, {"joint": "right", "node_id": 2, "side": "right"}).drives[0]
    assert Scale.of(drive, 0.1).raw(2 * pi * 0.1 / 10) == raw


@pytest.mark.parametrize(
    ("kind", "room"),
    [(GENERIC, 2**31 - 1), (PERSONALITIES["inverter"], 32_767), (replace(GENERIC, widths={0x606C: "h"}), 32_767)],
    ids=["606Ch", "6044h", "606Ch of 16 bits"],
)
def test_a_speed_that_an_object_has_no_room_for_is_shown_as_the_fastest_one(kind: Personality, room: int) -> None:
    """A jumping encoder shows 1e9 m/s for a moment; the other direction of it has room too."""
    wheels: list[dict[str, object]] = [
        {"joint": side, "node_id": node_id, "side": side, "velocity_unit": "rpm"}
        for node_id, side in ((1, "left"), (2, "right"))
    ]
    scale = Scale.of(robot(*wheels).drives[0], 0.1, kind)
    assert [scale.raw(mps) for mps in (1e9, -1e9, 0.0)] == [room, -room, 0]
    assert scale.limited(room + 1) == room


def test_the_result_does_not_depend_on_when_one_looks() -> None:
    truths: list[Truth] = []
    for step in (0.001, 0.01, 0.1):
        rig = Rig()
        rig.drive(MPS // 2, MPS // 3, 0.0)
        rig.wait(1.0, step_s=step)
        truths.append(rig.bench.truth(rig.now_s))
    assert truths[0] == truths[1] == truths[2]


def test_two_axes_of_one_node_have_their_objects_at_800h() -> None:
    both = robot(
        {"joint": "left", "node_id": 5, "axis": 0, "side": "left"},
        {"joint": "right", "node_id": 5, "axis": 1, "side": "right", "direction": -1},
    )
    rig = Rig(both)
    for base, sign in ((0x6000, 1), (0x6800, -1)):
        rig.write(base + 0x60, 3, node=5)
        rig.write(base + 0xFF, sign * MPS // 4, node=5)
        rig.write(base + 0x83, MPS, node=5)
        for word in (0x06, 0x07, 0x0F):
            rig.write(base + 0x40, word, node=5)
    rig.wait(1.0)
    truth = rig.bench.truth(rig.now_s)
    assert truth.linear_mps == pytest.approx(0.25, abs=0.002)
    assert truth.angular_radps == pytest.approx(0.0, abs=0.01)
    rig.write(0x6840, 0x02, node=5)
    assert [axis.state for axis in rig.bench.nodes[5].axes] == [State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE]


def test_a_node_with_only_its_second_axis_in_use_has_an_idle_first_one() -> None:
    rig = Rig(
        robot(
            {"joint": "left", "node_id": 1, "axis": 1, "side": "left"},
            {"joint": "right", "node_id": 2, "side": "right"},
        )
    )
    assert [axis.state for axis in rig.node.axes] == [State.SWITCH_ON_DISABLED] * 2
    assert rig.read(0x6864) != rig.read(0x6064) == 0


def test_identity_is_what_robot_yaml_expects() -> None:
    known = {"vendor_id": 0x9A, "product_code": 7, "revision": 3}
    rig = Rig(
        robot(
            {"joint": "left", "node_id": 1, "side": "left", "identity": known},
            {"joint": "right", "node_id": 2, "side": "right"},
        )
    )
    assert [rig.read(0x1018, sub) for sub in (1, 2, 3, 4)] == [0x9A, 7, 3, 1]
    assert rig.read(0x1018, 2, node=2) == 0xCB402
    assert rig.read(0x608F, 1) == 4096


def test_a_silent_drive_still_obeys() -> None:
    rig = Rig()
    faults.apply(rig.bench.nodes, 1, "silent", rig.now_s, {})
    assert rig.tx("601 40 00 10 00 00 00 00 00") == []
    rig.tx("000 01 01")
    rig.tx("201 06 00")
    assert rig.state() is State.READY_TO_SWITCH_ON
    faults.apply(rig.bench.nodes, 1, "heal", rig.now_s, {})
    assert rig.read(0x1000) == 0x20192


def test_a_deaf_drive_speaks_and_obeys_nothing() -> None:
    rig = Rig()
    rig.write(0x1017, 100)
    faults.apply(rig.bench.nodes, 1, "deaf", rig.now_s, {})
    rig.tx("000 01 01")
    rig.tx("201 06 00")
    assert rig.state() is State.SWITCH_ON_DISABLED
    assert "701 7F" in rig.wait(0.2)
    faults.apply(rig.bench.nodes, 1, "heal", rig.now_s, {})
    rig.tx("000 01 01")
    rig.tx("201 06 00")
    assert rig.state() is State.READY_TO_SWITCH_ON


def test_the_bench_tells_once_whose_heartbeat_was_missed() -> None:
    rig = Rig()
    rig.write(0x1016, 0x7F << 16 | 300, sub=1)
    rig.tx("77F 05")
    rig.wait(0.2)
    assert rig.bench.lost_heartbeats() == []
    rig.wait(0.2)
    assert rig.bench.lost_heartbeats() == [(1, 0x7F)]
    assert rig.bench.lost_heartbeats() == []


def test_a_cut_cable_stops_frames_both_ways() -> None:
    rig = Rig()
    faults.apply(rig.bench.nodes, 1, "cut", rig.now_s, {})
    assert rig.tx("601 40 00 10 00 00 00 00 00") == []
    rig.tx("000 01 01")
    rig.tx("201 06 00")
    assert rig.state() is State.SWITCH_ON_DISABLED


def test_a_power_cycle_boots_again_and_the_encoder_starts_elsewhere() -> None:
    rig = Rig()
    rig.drive(MPS // 2, MPS // 2, 1.0)
    before = rig.read(0x6064)
    faults.apply(rig.bench.nodes, 1, "power_cycle", rig.now_s, {"off_s": 0.3})
    assert not rig.axis.motor.powered
    start = rig.now_s
    rig.heard.clear()
    rig.wait(1.0)
    assert [text for _, text in rig.heard] == ["701 00"]
    assert rig.heard[0][0] - start == pytest.approx(0.4, abs=0.002)  # off, and the boot delay
    assert abs(rig.read(0x6064) - before) > 500_000
    assert rig.read(0x6060) == 0


def test_frozen_encoder_stuck_velocity_and_ignored_setpoints() -> None:
    rig = Rig()
    rig.drive(MPS // 2, MPS // 2, 1.0)
    for kind in ("frozen_encoder", "stuck_velocity", "ignores_setpoints"):
        faults.apply(rig.bench.nodes, 1, kind, rig.now_s, {})
    shown = rig.read(0x6064), rig.read(0x606C)
    rig.write(0x60FF, 0)
    rig.wait(0.5)
    assert (rig.read(0x6064), rig.read(0x606C)) == shown
    assert rig.bench.base.v_left_mps == pytest.approx(0.5, abs=0.01)
    faults.apply(rig.bench.nodes, 1, "heal", rig.now_s, {})
    rig.write(0x60FF, 0)
    rig.wait(1.0)
    assert rig.read(0x606C) == 0
    assert rig.read(0x6064) > shown[0]


def test_a_weak_drive_holds_its_power_and_moves_nothing_until_it_is_healed() -> None:
    rig = Rig()
    for node in (1, 2):
        faults.apply(rig.bench.nodes, node, "weak", rig.now_s, {})
    rig.drive(MPS // 2, MPS // 2, 1.0)
    assert rig.state() is State.OPERATION_ENABLED
    assert rig.bench.base.v_mps == 0.0
    for node in (1, 2):
        faults.apply(rig.bench.nodes, node, "heal", rig.now_s, {})
    rig.wait(1.0)
    assert rig.bench.base.v_mps == pytest.approx(0.5, abs=0.01)


def test_a_drive_fault_with_code_that_holds() -> None:
    rig = Rig()
    faults.apply(rig.bench.nodes, 1, "fault", rig.now_s, {"code": 0x4210, "holds": True})
    assert "081 10 42 09 00 00 00 00 00" in rig.wait(0.001)
    rig.write(0x6040, 0x80)
    assert rig.state() is State.FAULT
    faults.apply(rig.bench.nodes, 1, "heal", rig.now_s, {})
    rig.write(0x6040, 0x00)
    rig.write(0x6040, 0x80)
    assert rig.state() is State.SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("node", "kind", "arguments", "told"),
    [
        (9, "silent", {}, r"no node 9, expected one of \[1, 2\]"),
        (1, "slient", {}, "expected one of silent"),
        (1, "fault", {"axis": 1}, "no axis 1"),
        (1, "fault", {"axis": "x"}, "expected int from 0 to 1"),
        (1, "fault", {"code": 0x10000}, "expected int from 1 to 65535"),
        (1, "fault", {"holds": 1}, "expected bool"),
        (1, "power_cycle", {"off_s": float("nan")}, "expected float from"),
        (1, "silent", {"code": 1}, "does not take"),
    ],
)
def test_orders_that_make_no_sense_say_what_was_expected(
    node: int, kind: str, arguments: dict[str, object], told: str
) -> None:
    with pytest.raises(faults.FaultError, match=told):
        faults.apply(Rig().bench.nodes, node, kind, 0.0, arguments)


def test_every_transition_is_told_once() -> None:
    rig = Rig()
    rig.bench.state_changes()
    rig.enable()
    changes = [(c.node_id, c.number, c.after) for c in rig.bench.state_changes()]
    assert changes == [
        (1, 2, State.READY_TO_SWITCH_ON),
        (1, 3, State.SWITCHED_ON),
        (1, 4, State.OPERATION_ENABLED),
    ]
    assert rig.bench.state_changes() == []


def test_standing_time_starts_when_the_rims_stand() -> None:
    rig = Rig()
    assert rig.bench.truth(rig.now_s).standing_s == pytest.approx(rig.now_s)
    rig.drive(MPS // 2, MPS // 2, 1.0)
    assert rig.bench.truth(rig.now_s).standing_s == pytest.approx(0.0, abs=0.003)
    rig.write(0x6040, 0x02)
    rig.write(0x6040, 0x02, node=2)
    rig.wait(1.25)
    assert rig.bench.truth(rig.now_s).standing_s == pytest.approx(1.0, abs=0.02)


def test_the_trace_samples_on_its_grid_even_when_looked_at_late() -> None:
    bench = Bench(robot(), now_s=50.0, parameters=BenchParameters(boot_delay_s=0.0))
    trace = Trace(bench, 50.0)
    trace.tick(50.5)
    rows = trace.since(50.195)
    assert [row[0] for row in rows] == pytest.approx([50.2 + n / 100 for n in range(len(rows))])
    assert len(rows) == 31
    assert trace.since(51.0) == []


def test_an_sdo_answer_takes_its_time() -> None:
    bench = Bench(robot(), now_s=0.0, parameters=BenchParameters(boot_delay_s=0.0, sdo_delay_s=0.003))
    bench.tick(0.010)
    bench.on_frame(Frame(0x601, bytes.fromhex("4000100000000000")), 0.010)
    answers = {at_ms: [f for f in bench.tick(at_ms / 1000) if f.cob_id == 0x581] for at_ms in (10, 11, 12.9, 13.1, 14)}
    assert [at_ms for at_ms, frames in answers.items() if frames] == [13.1]


def test_own_frames_that_come_back_do_no_harm() -> None:
    rig = Rig()
    said = [*rig.tx("601 40 00 10 00 00 00 00 00"), "701 00", "181 50 02", "081 10 23 03 00 00 00 00 00"]
    assert [rig.tx(text) for text in said] == [[], [], [], []]


def test_frames_at_full_length_for_ids_that_nobody_has_are_ignored() -> None:
    rig = Rig()
    known = {0x000, 0x080, 0x601, 0x602, 0x201, 0x202, 0x301, 0x302, 0x401, 0x402}
    for cob_id in sorted(set(range(0x800)) - known):
        rig.bench.on_frame(Frame(cob_id, struct.pack("<Q", 0x0F0F_0F0F)), rig.now_s)
    assert rig.bench.tick(rig.now_s) == []
    assert rig.state() is State.SWITCH_ON_DISABLED
