"""What one driver alone may have: the bus and the record of its stops. And whether another computer's driver is there.

The bus is opened first of all, before ROS is imported: its frames wait in the socket meanwhile, and the time for which
this driver has to listen before it sends its first frame passes.
"""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path

from canbase_config.robot import Robot
from canbase_config.watchdog import HEARTBEATS_PER_TIMEOUT
from canbase_driver.runtime.bus_port import ANOTHER_DRIVER, BusPort, is_of_a_driver
from canbase_runtime.latch_file import hold
from canbase_runtime.single_instance import TakenError, bus_name, take


class Claim:
    """The bus and the record in `folder`, from its making until `close`."""

    def __init__(self, robot: Robot, folder: Path) -> None:
        """Raises BusError where the bus cannot be opened, TakenError where another driver of this computer has it."""
        self.folder = folder
        with ExitStack() as held:
            held.enter_context(take("driver", bus_name(robot.bus.arguments())))
            held.enter_context(hold(folder, "driver"))
            self.bus = BusPort(robot.bus_arguments(), robot.timeouts.drive_heartbeat_s)
            held.callback(self.bus.close)
            self._held = held.pop_all()
        self._began_s = time.monotonic()
        self._listen_s = robot.timeouts.drive_heartbeat_s

    def listen(self) -> None:
        """Until the timeout of a heartbeat has passed since the bus was opened. Before the first frame is sent.

        All that waits in the socket is looked at. It holds the oldest frames where it was too small, so at least
        one period of the heartbeat is listened to from now on. Raises TakenError: another driver is on the bus.
        """
        fresh_s = self._listen_s / HEARTBEATS_PER_TIMEOUT
        end_s = max(self._began_s + self._listen_s, time.monotonic() + fresh_s)
        while (left_s := end_s - time.monotonic()) > 0.0:
            frame = self.bus.receive(left_s)
            if frame is not None and is_of_a_driver(frame):
                self.close()
                raise TakenError(f"{ANOTHER_DRIVER} ({frame})")

    def close(self) -> None:
        """Closing the bus twice is closing it once: the control thread does it as well."""
        self._held.close()
