"""What one driver alone may have: the bus and the record of its stops. And whether another computer's driver is there.

The bus is opened as soon as robot.yaml and the command line are found right, before the node is imported, and a thread
listens to it meanwhile: the time for which this driver has to listen before it sends its first frame passes.
"""

from __future__ import annotations

import threading
import time
from contextlib import ExitStack
from pathlib import Path

from canbase_base.frame_socket import BusError
from canbase_base.latch_folder import SUFFIX
from canbase_base.single_instance import TakenError, bus_name, hold_record, take
from canbase_config.robot import Robot
from canbase_config.watchdog import HEARTBEATS_PER_TIMEOUT
from canbase_driver.cia301.frame import Frame
from canbase_driver.runtime.bus_port import ANOTHER_DRIVER, BusPort, is_of_a_driver

TURN_S = 0.01
"""The listening thread waits so long for a frame [s]."""
LATE_S = 0.03
"""A bus that was not read empty for longer may have lost frames: the receive buffer holds so much of a full one [s]."""

LONGEST_S = 5.0
"""A bus that was not listened to well by then is more than this computer can read [s]."""
UNREADABLE = (
    "the bus could not be listened to without a gap in 5 s: something floods it, or this computer is overloaded. "
    "Look at it with candump, and at the load with top"
)


class Claim:
    """The bus and the record in `folder`, from its making until `close`."""

    def __init__(self, robot: Robot, folder: Path) -> None:
        """Raises BusError where the bus cannot be opened, TakenError where another driver of this computer has it."""
        self.folder = folder
        with ExitStack() as held:
            held.enter_context(take("driver", bus_name(robot.bus.arguments())))
            held.enter_context(hold_record(folder / f"driver{SUFFIX}"))
            self.bus = BusPort(robot.bus_arguments(), robot.timeouts.drive_heartbeat_s)
            held.callback(self.bus.close)
            self._held = held.pop_all()
        self._listener = BusListener(self.bus, robot.timeouts.drive_heartbeat_s)
        self._listener.start()

    def listen(self) -> None:
        """Until the timeout of a heartbeat has passed since the bus was opened. Before the first frame is sent, and
        before anybody else uses the bus. Raises TakenError: another driver is on the bus; BusError: one cannot tell.
        """
        try:
            self._listener.result()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Closing the bus twice is closing it once: the control thread does it as well."""
        self._listener.end()
        self._held.close()


class BusListener(threading.Thread):
    """Reads the bus until it may be sent to; what it reads is for nobody else."""

    def __init__(self, bus: BusPort, listen_s: float) -> None:
        super().__init__(name="listener", daemon=True)
        self._bus, self._listen_s = bus, listen_s
        self._ends = threading.Event()
        self._driver_frame: Frame | None = None
        self._failure: BaseException | None = RuntimeError("nobody has listened to the bus")

    def run(self) -> None:
        """The thread's body."""
        try:
            self._failure = self._listen(time.monotonic())
        except Exception as error:  # noqa: BLE001 - raised where the result is asked for
            self._failure = error

    def _listen(self, began_s: float) -> BusError | None:
        attention, frame = Attention(began_s, self._listen_s), None
        while time.monotonic() - began_s < LONGEST_S:
            frame = self._bus.receive(TURN_S if frame is None else 0.0)
            if self._ends.is_set():
                return BusError("nobody listens to the bus any more")
            if frame is not None and is_of_a_driver(frame):
                self._driver_frame = frame
                return None
            if frame is None and attention.suffices(time.monotonic()):
                return None
        return BusError(UNREADABLE)

    def result(self) -> None:
        """Waits for the end of the listening. Raises TakenError, or what kept it from listening well."""
        self.join()
        if self._failure is not None:
            raise self._failure
        if self._driver_frame is not None:
            raise TakenError(f"{ANOTHER_DRIVER} ({self._driver_frame})")

    def end(self) -> None:
        """It need not listen any more."""
        self._ends.set()
        self.join()


class Attention:
    """Whether a bus was listened to for long enough: since `began_s` for `listen_s`, and for the last period of a
    heartbeat without a gap. While ROS is imported, the thread that listens may come late. Pure."""

    def __init__(self, began_s: float, listen_s: float) -> None:
        """Times in s, monotonic."""
        self._until_s = began_s + listen_s
        self._period_s = listen_s / HEARTBEATS_PER_TIMEOUT
        self._emptied_at = self._without_gap_since = began_s

    def suffices(self, now_s: float) -> bool:
        """The bus was read empty at `now_s`."""
        if now_s - self._emptied_at > LATE_S:
            self._without_gap_since = now_s
        self._emptied_at = now_s
        return now_s >= self._until_s and now_s - self._without_gap_since >= self._period_s
