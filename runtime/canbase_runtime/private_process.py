"""Keeps other processes of the same user out of memory, environment and files of this one (/proc/PID/mem, root)."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping

_PR_SET_DUMPABLE = 4
"""prctl(2)."""


def guard_keys(environment: Mapping[str, str]) -> None:
    """For a process that holds a key of SROS2: its neighbours run as the same user. Raises OSError.

    Without ROS_SECURITY_ENABLE=true there is no key, and a debugger may look in. With it no core file is written.
    """
    if environment.get("ROS_SECURITY_ENABLE", "").lower() != "true":
        return
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_DUMPABLE, 0, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "this process cannot be closed to others of its user (prctl)")
