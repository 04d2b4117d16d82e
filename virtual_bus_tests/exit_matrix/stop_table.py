"""The table of docs/stop_times.md that `make exit-matrix` and `make stops` write together. Pure: no ROS is needed."""

from __future__ import annotations

from exit_matrix.page_table import PageTable

COMMANDS = "make exit-matrix, make stops"
"""Name the part of docs/stop_times.md that both write."""
REAL_RUN = "one real run"
REAL = ("who caught it", "limit", REAL_RUN)
"""Columns of real processes."""
VIRTUAL = ("runs", "p50", "p99", "max", "power off", "fastest wheel")
"""Columns of virtual time."""
TABLE = PageTable(("what", "how"), (*REAL, *VIRTUAL), ("who caught it",))
