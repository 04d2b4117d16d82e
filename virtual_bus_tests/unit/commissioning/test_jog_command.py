"""`canbase bus jog` where it refuses. With a wheel that turns: bus/test_jog_command.py."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from canbase_commissioning.onbus import jog_command
from support.command_world import CommandWorld


@pytest.mark.parametrize(
    ("joint", "why"), [("left_wheel", "jog needs an interactive terminal"), ("wheel", "there is no wheel 'wheel'")]
)
def test_without_a_terminal_and_for_no_wheel_it_is_2(world: CommandWorld, joint: str, why: str) -> None:
    done = world.canbase("bus", "jog", joint)
    assert done.exit_code == 2
    assert why in done.stderr


def test_beside_a_driver_it_is_refused(world: CommandWorld, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jog_command, "sys", SimpleNamespace(stdin=SimpleNamespace(isatty=lambda: True)))
    world.repeat(0x77F, b"\x05", 0.1)
    done = world.canbase("bus", "jog", "left_wheel", "--yes")
    assert done.exit_code == 1
    assert "canbase's motor driver" in done.stderr
    assert world.said == []
