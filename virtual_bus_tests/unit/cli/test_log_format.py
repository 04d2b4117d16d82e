"""The times of log lines that ROS writes, read from the text: milliseconds below 100 keep their zeros."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys

from canbase_cli.log_format import log_times

CODE = """
import time
import rclpy.logging
for _ in range(25):
    rclpy.logging.get_logger("part").info(f"{time.time():.6f}")
    time.sleep(0.044)
"""


def test_each_line_has_the_time_at_which_it_was_written() -> None:
    """25 lines within 1.1 s: some of them in the first tenth of a second."""
    environment = {name: value for name, value in os.environ.items() if name != "RCUTILS_CONSOLE_OUTPUT_FORMAT"}
    log_times(environment)
    done = subprocess.run(
        [sys.executable, "-c", CODE], env=environment, capture_output=True, text=True, timeout=60.0, check=True
    )
    lines = [line.split() for line in done.stderr.splitlines()]
    written = [(float(at), float(told)) for at, _severity, _name, told in lines]
    assert len(written) == 25
    assert any(at % 1.0 < 0.1 for at, _ in written)
    assert all(told - 1e-6 <= at for at, told in written)
    assert all(at <= told_next + 1e-6 for (at, _), (_, told_next) in itertools.pairwise(written))
