"""A process with a key of SROS2 is closed to other processes of its user: for real, as an ordinary user."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

NOBODY = 65534
HOLDER = """
import os, sys
from canbase_runtime.private_process import guard_keys
if os.getuid() == 0:
    os.setgid({user})
    os.setuid({user})
    import ctypes; ctypes.CDLL(None).prctl(4, 1, 0, 0, 0)  # what a change of the user has taken
guard_keys({environment!r})
print("ready", flush=True)
sys.stdin.read()
"""
LOOK = """
import os, sys
if os.getuid() == 0:
    os.setgid({user})
    os.setuid({user})
for what in ("root", "environ", "mem"):
    try:
        path = "/proc/{pid}/" + what
        os.listdir(path) if what == "root" else open(path, "rb").close()
        print(what)
    except PermissionError:
        pass
"""


@contextmanager
def holder(environment: dict[str, str]) -> Iterator[int]:
    code = HOLDER.format(user=NOBODY, environment=environment)
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        yield process.pid
        process.communicate()


@pytest.mark.parametrize(
    ("environment", "open_to_others"),
    [({}, True), ({"ROS_SECURITY_ENABLE": "false"}, True), ({"ROS_SECURITY_ENABLE": "true"}, False)],
)
def test_only_with_a_key_the_memory_and_the_files_of_a_process_are_closed_to_its_user(
    environment: dict[str, str], open_to_others: bool
) -> None:
    with holder(environment) as pid:
        code = LOOK.format(user=NOBODY, pid=pid)
        seen = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert seen == (["root", "environ", "mem"] if open_to_others else [])


@pytest.mark.needs_root("look into a process that is closed to its user")
def test_root_still_sees_it() -> None:
    with holder({"ROS_SECURITY_ENABLE": "true"}) as pid:
        assert os.listdir(f"/proc/{pid}/root")
