"""Odd but legal drives boot, drive 1 m and stop, or a message tells what cures them: each alone, some together.

2,000 robots of them: `make odd`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from campaign import odd
from campaign.odd import told, trials
from canbase_campaign.advice import read_advice
from canbase_campaign.odd_trial import Setup, try_out
from canbase_driver.boot import pdo_mapping
from canbase_sim.odd.draw import draw
from canbase_sim.odd.oddities import ALIKE, ODDITIES

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(600)]
NEEDS_A_CURE = {
    "narrow_target",
    "narrow_velocity",
    "cyclic_alone",
    "coasts",
    "soft_stop",
    "guarding_alone",
    "one_tpdo",
    "other_unit",
    "long_tpdo",
    "fixed_mapping",
    "counted_syncs",
    "late_mode",
    "other_counts",
    "short_range",
    "reversed_velocity",
}
UNUSABLE = {"synchronous_alone", "wide_status", "narrow_counter"}
STOPPED = {"answers_again", "taken_local", "passing_fault"}
TOGETHER = range(8)


@pytest.mark.parametrize("name", sorted(ODDITIES))
def test_each_oddity_alone_drives_or_is_cured_by_what_the_message_names(name: str, tmp_path: Path) -> None:
    trial = try_out(1, tmp_path, (name,))
    assert trial.wrong == [], told(trial)
    if name in UNUSABLE:
        assert trial.ended == "cannot be used", told(trial)
    elif name in STOPPED:
        assert trial.ended == "stopped, and told", told(trial)
    elif name in NEEDS_A_CURE:
        assert trial.ended == "drove after cures", told(trial)
    elif name != "slow_heartbeat":
        assert trial.ended == "drove", told(trial)


def test_odd_drives_with_several_oddities_send_nobody_the_wrong_way() -> None:
    done = list(trials(TOGETHER))
    assert [told(trial) for trial in done if trial.wrong] == []
    assert sum(trial.ended.startswith("drove") for trial in done) > len(TOGETHER) / 2
    assert any(trial.cures for trial in done)


def test_the_same_seed_gives_the_same_drives_and_no_two_that_exclude_each_other(tmp_path: Path) -> None:
    for seed in range(300):
        first, again = draw(seed, (1, 2)), draw(seed, (1, 2))
        assert [str(odd_drive) for odd_drive in first.values()] == [str(odd_drive) for odd_drive in again.values()]
        for odd_drive in first.values():
            names = {each.name for each in odd_drive.drawn}
            assert all(len(names & alike) <= 1 for alike in ALIKE)
    one, two = (try_out(2, tmp_path) for _ in range(2))
    assert (one.messages, one.cures, one.virtual_s) == (two.messages, two.cures, two.virtual_s)


def test_a_message_that_names_the_wrong_key_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(pdo_mapping.WIDTH_KEYS, 0x606C, "set `layout.target_bits: {}` in its drive profile")
    trial = try_out(0, tmp_path, ("narrow_velocity",))
    assert trial.wrong == ["no named key helps"]
    assert trial.ended == "not cured"


def test_a_key_whose_value_does_not_help_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(pdo_mapping.WIDTH_KEYS, 0x606C, "set `layout.velocity_bits: 32` in its drive profile")
    trial = try_out(0, tmp_path, ("narrow_velocity",))
    (wrong,) = trial.wrong
    assert wrong.startswith("done before in vain: node 1: layout.velocity_bits: 32")


def test_what_a_message_says_is_read_as_a_person_reads_it() -> None:
    advice = read_advice(
        "node 2: 1400h:2: 0609 0030h value not valid. Set `pdo.synchronous: false` in its drive profile, "
        "or raise timeouts.boot_s in robot.yaml; see docs/bus.md and `mode`"
    )
    assert advice.nodes == (2,)
    assert advice.objects == (0x1400,)
    assert advice.keys == {"pdo.synchronous": False, "timeouts.boot_s": None, "mode": None}
    assert not advice.gives_up
    assert not advice.by_tool
    assert not read_advice("node 1 is not there; check its cable").names_a_thing


def test_keys_go_where_a_person_writes_them(tmp_path: Path) -> None:
    setup = Setup(tmp_path)
    setup.set(1, "pdo.synchronous", False)
    setup.set(2, "mode", 9)
    setup.set(1, "timeouts.boot_s", 20)
    robot = setup.robot()
    assert [drive.kind.pdo.synchronous for drive in robot.drives] == [False, True]
    assert [drive.used_mode for drive in robot.drives] == [3, 9]
    assert robot.timeouts.boot_s == 20


def test_the_command_tells_one_robot_and_its_sums(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["odd", "--seed", "0", "--only", "narrow_target"])
    assert odd.main() == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "seed 0: drove after cures" in shown
    assert "done: node 1: layout.target_bits: 16" in shown
    assert "1 robots: 1 drove after cures" in shown
    assert "60FFh of 16 bits" in shown
    assert " 0 " not in shown.partition("what is odd")[2].partition("1 robots")[0], "a row of what was not drawn"
