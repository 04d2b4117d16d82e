"""What a test run says of tests in real time that failed once and passed when they ran again, and how many it allows.

Hundreds of tests measure with the clock of a computer that others use too. One that fails runs once more by
itself (`--reruns 1` of pytest-rerunfailures, in `make test-real-time`). The first failure is printed whole: it is a
defect of the test or of canbase, and somebody has to find it. The tests run in a worker process: an interpreter that
crashes in the ROS libraries counts as a first failure of its test, and a new worker runs the others.
"""

from __future__ import annotations

import pytest

MOST = 2
"""So many tests of one run may need a second run: one in a few hundred. Beyond that, the run fails."""


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fails a run in which many tests passed only when they ran again."""
    again = _failed_first(session.config)
    if len(again) > MOST and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Prints each first failure, so that its cause can be found though the run is green."""
    again = _failed_first(config)
    if not again:
        return
    terminalreporter.section("failed first, then ran again: find the cause of each")
    for report in again:
        terminalreporter.write_line(f"{report.nodeid} ({report.when})", yellow=True)
        terminalreporter.write_line(report.longreprtext)
        for title, text in report.sections:
            terminalreporter.write_line(f"--- {title}\n{text}")
    terminalreporter.write_line(f"{len(again)} ran again; more than {MOST} fail the run", yellow=True)


def _failed_first(config: pytest.Config) -> list[pytest.TestReport]:
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    return list(reporter.stats.get("rerun", ())) if reporter else []
