"""A simulated drive whose CANopen stack lives, and whose application, power stage or values are faulty."""

from __future__ import annotations

from canbase_sim.cia301.nmt import NmtState
from canbase_sim.cia402.states import State
from support.sim_rig import MPS, Rig

HALF = MPS // 2


def running() -> Rig:
    """Both wheels at 0.5 m/s."""
    rig = Rig()
    rig.drive(HALF, HALF, 1.0)
    return rig


def test_a_hanging_application_keeps_its_values_and_its_motor_until_the_node_is_reset() -> None:
    """t   0 hangs at 0.5 m/s; quick stop and "disable voltage" are written; 0.5 reset node"""
    rig = running()
    rig.axis.refresh()
    before = [rig.read(index) for index in (0x6041, 0x6064, 0x606C)]
    rig.axis.faults.frozen = True
    for word in (0x02, 0x00):
        rig.write(0x6040, word)
    rig.write(0x60FF, 0)
    rig.axis.fail(0x7305)
    rig.axis.abort_connection(0x8130)
    rig.axis.starve()
    rig.wait(0.5)
    assert [rig.read(index) for index in (0x6041, 0x6064, 0x606C)] == before
    assert rig.bench.base.v_left_mps > 0.49
    rig.tx("000 81 01")
    assert not rig.axis.motor.powered
    assert not rig.axis.faults.frozen


def test_a_power_stage_that_is_stuck_on_drives_on_whatever_the_statusword_shows() -> None:
    rig = running()
    rig.axis.faults.stuck_on = True
    rig.write(0x6040, 0x02)
    rig.wait(0.5)
    assert rig.state() is State.SWITCH_ON_DISABLED
    assert rig.bench.base.v_left_mps > 0.49
    rig.tx("000 81 01")
    assert not rig.axis.motor.powered


def test_a_statusword_that_is_stuck_hides_a_stop() -> None:
    rig = running()
    word = rig.read(0x6041)
    rig.axis.faults.stuck_status = word
    rig.write(0x6040, 0x00)
    rig.wait(0.1)
    assert rig.state() is State.SWITCH_ON_DISABLED
    assert rig.read(0x6041) == word


def test_a_torque_that_is_stuck_is_reported_whatever_the_motor_does() -> None:
    rig = running()
    assert rig.read(0x6077) != 0
    rig.axis.faults.stuck_torque = 0
    assert (rig.read(0x6077), rig.read(0x6078)) == (0, 0)


def test_a_power_stage_that_is_not_ready_refuses_operation() -> None:
    rig = Rig()
    rig.axis.faults.cannot_enable = True
    rig.enable()
    assert rig.state() is State.SWITCHED_ON
    rig.axis.faults.cannot_enable = False
    rig.write(0x6040, 0x0F)
    assert rig.state() is State.OPERATION_ENABLED


def test_settings_that_are_lost_take_the_heartbeat_monitoring_with_them() -> None:
    rig = running()
    rig.write(0x1016, 127 << 16 | 300, sub=1)
    ramp = rig.read(0x6084)
    rig.node.lose_settings()
    assert rig.read(0x1016, sub=1) == 0
    assert rig.read(0x6084) != ramp
    assert rig.read(0x60FF) == HALF, "the newest setpoint is no setting"
    rig.wait(0.5)
    assert rig.state() is State.OPERATION_ENABLED
    assert rig.node.settings_lost
    rig.node.power_cycle(rig.now_s)
    assert not rig.node.settings_lost


def test_a_drive_that_leaves_operational_by_itself_drives_on() -> None:
    rig = running()
    rig.tx("000 01 01")
    assert rig.node.state.name == "OPERATIONAL"
    rig.node.leave_operational()
    rig.wait(0.3)
    assert rig.node.state is NmtState.PRE_OPERATIONAL
    assert rig.bench.base.v_left_mps > 0.49
