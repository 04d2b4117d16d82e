"""The large STOP of the pages: it reaches every part that may move the wheels, and says what became of each."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from canbase_web.pages import Pages

ENDED, HANGS = (True, "commissioning has ended"), (False, "commissioning has not ended")
STOPS, SILENT = (True, "stopping"), (False, "motor_driver/stop did not answer")


class Part:
    """The driver, or commissioning, which answers as a test wants."""

    def __init__(self, answer: tuple[bool, str] | None) -> None:
        self.answer, self.stopped = answer, 0
        self.runs = self.has_driver = answer is not None

    async def stop(self) -> tuple[bool, str]:
        self.stopped += 1
        return self.answer or (False, "no motor driver is there")

    end = stop


def large_stop(driver: Part, commissioning: Part) -> tuple[bool, str]:
    pages: Any = SimpleNamespace(link=driver, commissioning=commissioning)
    return asyncio.run(Pages.stop(pages))


@pytest.mark.parametrize(
    ("driver", "commissioning", "answer"),
    [
        (STOPS, None, (True, "stopping")),
        (SILENT, None, (False, "motor_driver/stop did not answer")),
        (None, None, (False, "no motor driver is there")),
        (None, ENDED, (True, "commissioning has ended")),
        (None, HANGS, (False, "commissioning has not ended")),
        (STOPS, ENDED, (True, "commissioning has ended; stopping")),
        (SILENT, ENDED, (False, "commissioning has ended; motor_driver/stop did not answer")),
        (STOPS, HANGS, (False, "commissioning has not ended; stopping")),
    ],
)
def test_whoever_may_move_the_wheels_is_stopped_and_one_that_does_not_is_told(
    driver: tuple[bool, str] | None, commissioning: tuple[bool, str] | None, answer: tuple[bool, str]
) -> None:
    parts = Part(driver), Part(commissioning)
    assert large_stop(*parts) == answer
    assert [part.stopped for part in parts] == [driver is not None or commissioning is None, commissioning is not None]
