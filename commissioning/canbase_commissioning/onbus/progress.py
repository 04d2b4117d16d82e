"""A progress bar on stderr for commands that take long; without a terminal one line for each step."""

from __future__ import annotations

import sys

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from canbase_commissioning.conversation import Progress as Step
from canbase_runtime.terminal import with_cursor


class Bar:
    """One bar that shows one step after the other. Use with `with`; `stop` takes it away for other output."""

    def __init__(self) -> None:
        self._console = Console(file=with_cursor(sys.stderr))
        self._progress: Progress | None = None
        self._task = TaskID(0)
        self._text = ""

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def show(self, step: Step) -> None:
        """How far a conversation is."""
        self.at(step.text, step.done, step.total)

    def at(self, text: str, done: int, total: int) -> None:
        """`done` of `total`."""
        if self._console.is_terminal:
            self._begin().update(self._task, description=text, completed=done, total=total)
        elif text != self._text:
            self._console.print(f"{text} …", highlight=False)
        self._text = text

    def stop(self) -> None:
        """No bar is shown."""
        if self._progress is not None:
            self._progress.stop()
            self._progress = None

    def _begin(self) -> Progress:
        if self._progress is None:
            columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
            self._progress = Progress(*columns, console=self._console, transient=True)
            self._progress.start()
            self._task = self._progress.add_task("", total=1)
        return self._progress
