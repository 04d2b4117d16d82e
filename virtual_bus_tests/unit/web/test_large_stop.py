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


def large_stop(driver: Part, commissioning: Part) -> tuple[bool, str]:
    async def end(_loop: object) -> tuple[bool, str]:
        return await commissioning.stop()

    pages: Any = SimpleNamespace(link=driver, commissioning=commissioning, _end_commissioning=end)
    return asyncio.run(Pages.stop(pages, asyncio.new_event_loop()))


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


def test_commissioning_is_ended_in_the_loop_of_the_pages_from_another_thread() -> None:
    async def story() -> tuple[int, str]:
        commissioning = Part(ENDED)
        pages: Any = SimpleNamespace(link=Part(None), commissioning=SimpleNamespace(runs=True, end=commissioning.stop))
        pages.stop = lambda loop: Pages.stop(pages, loop)
        pages._end_commissioning = lambda loop: Pages._end_commissioning(pages, loop)
        return await asyncio.to_thread(Pages.stop_page, pages, asyncio.get_running_loop())

    status, page = asyncio.run(story())
    assert (status, "<p>Stop: commissioning has ended</p>" in page) == (200, True)


def test_pages_that_do_not_answer_are_no_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("canbase_web.pages.ENDS_S", 0.005)

    async def end() -> tuple[bool, str]:
        await asyncio.Event().wait()
        return ENDED

    async def story() -> tuple[bool, str]:
        pages: Any = SimpleNamespace(commissioning=SimpleNamespace(end=end))
        return await Pages._end_commissioning(pages, asyncio.get_running_loop())

    done, sentence = asyncio.run(story())
    assert (done, "wheels may turn" in sentence) == (False, True)
