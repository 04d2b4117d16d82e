"""The watchdog takes one module of canbase_config: it must cost nothing but Python itself."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import canbase_config

IMPORTED = """
import sys
sys.path.append(sys.argv[1])
before = set(sys.modules)
import canbase_config.watchdog
new = {name.partition(".")[0] for name in set(sys.modules) - before}
print(*sorted(new - set(sys.stdlib_module_names)))
"""


def test_the_watchdogs_dataclass_pulls_in_the_standard_library_alone() -> None:
    packages = Path(str(canbase_config.__file__)).parents[1]
    environment = os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}

    command = [sys.executable, "-c", IMPORTED, str(packages)]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=30, check=True)

    assert result.stdout == "canbase_config\n"
