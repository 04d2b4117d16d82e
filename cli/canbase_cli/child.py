"""A part of the stack as the child of another process: `python -m canbase_cli.child PARENT_PID serve driver …`.

It gets a signal when that parent ends, however it ends: no part may go on driving.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys

PR_SET_PDEATHSIG = 1
"""prctl(2); kept over execve(2)."""
CHILD = "CANBASE_CHILD"
"""In the environment of a part: its parent prints the warnings of robot.yaml, and the watchdog that of priority."""


def end_with(parent_pid: int, part: str = "") -> None:
    """SIGTERM to this process when `parent_pid` dies; at once when it has died already. Linux alone has this.

    SIGINT to `part` sim, which then ends after the driver: drives that vanish under it are latched for the next start.
    """
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGINT if part == "sim" else signal.SIGTERM)
    if os.getppid() != parent_pid:
        sys.exit(128 + signal.SIGTERM)


if __name__ == "__main__":
    end_with(int(sys.argv.pop(1)), sys.argv[2])
    os.environ[CHILD] = sys.argv[2]
    from canbase_cli.entry import main

    main()
