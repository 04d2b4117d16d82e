"""Whatever arrives: a drive makes torque only in the states that may, never raises, and always can be stopped."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_sim.cia402.states import POWERED, State
from canbase_sim.frame import Frame
from support.sim_rig import MPS, Rig

WORDS = (0x00, 0x02, 0x06, 0x07, 0x0F, 0x10F, 0x80, 0x8F)
OPTIONS = (0x6007, 0x605A, 0x605B, 0x605C, 0x605E)


def _download(index: int, value: int, size: int) -> str:
    """An SDO request to node 1."""
    data = value.to_bytes(size, "little", signed=value < 0).ljust(4, b"\0")
    return f"601 {bytes([0x23 | (4 - size) << 2]).hex()} {index.to_bytes(2, 'little').hex()} 00 {data.hex()}"


words = st.one_of(st.sampled_from(WORDS), st.integers(0, 0xFFFF)).map(lambda word: _download(0x6040, word, 2))
targets = st.integers(-MPS, MPS).map(lambda raw: _download(0x60FF, raw, 4))
modes = st.sampled_from([0, 3, 9]).map(lambda mode: _download(0x6060, mode, 1))
options = st.builds(lambda index, code: _download(index, code, 2), st.sampled_from(OPTIONS), st.integers(0, 8))
commands = st.sampled_from([1, 2, 128, 129, 130]).map(lambda command: f"000 {command:02X} 01")
frames = st.one_of(words, words, targets, modes, options, commands)
steps = st.one_of(
    st.tuples(st.just("frame"), frames),
    st.tuples(st.just("fault"), st.sampled_from([0x2310, 0x8611])),
    st.tuples(st.just("power cycle"), st.just(0)),
    st.tuples(st.just("wait"), st.integers(1, 300)),
)


def _do(rig: Rig, what: str, value: str | int) -> None:
    """One step of a random day. Refusals are fine; exceptions are not."""
    match what, value:
        case "frame", str():
            rig.tx(value)
        case "fault", int():
            rig.node.fail(0, value)
        case "power cycle", _:
            rig.node.power_cycle(rig.now_s, 0.01)
        case "wait", int():
            rig.wait(value / 1000.0, step_s=0.01)


@settings(max_examples=75, deadline=None)
@given(st.lists(steps, max_size=25))
def test_torque_comes_only_from_powered_states_and_disable_voltage_always_ends_it(
    story: list[tuple[str, str | int]],
) -> None:
    rig = Rig()
    rig.enable(target=MPS // 2)
    for what, value in story:
        _do(rig, what, value)
        rig.wait(0.01)
        assert not rig.axis.motor.powered or rig.state() in POWERED
        assert rig.axis.motor.powered or rig.axis.motor.force_n == 0.0
    rig.wait(0.2)
    rig.tx("000 80 01")
    rig.write(0x6040, 0x00)
    rig.wait(20.0, step_s=0.1)
    assert not rig.axis.motor.powered
    assert rig.bench.base.v_left_mps == 0.0
    assert rig.state() in (State.SWITCH_ON_DISABLED, State.FAULT)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8)), max_size=40))
def test_no_frame_makes_the_bench_raise(noise: list[tuple[int, bytes]]) -> None:
    rig = Rig()
    rig.tx("000 01 00")
    for cob_id, data in noise:
        rig.bench.on_frame(Frame(cob_id, data), rig.now_s)
        rig.wait(0.002, step_s=0.002)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.binary(min_size=8, max_size=8), max_size=30))
def test_no_sdo_request_makes_the_server_raise(requests: list[bytes]) -> None:
    rig = Rig()
    for request in requests:
        rig.tx(f"601 {request.hex()}")
    rig.wait(0.05, step_s=0.01)
