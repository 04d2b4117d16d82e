"""`python -m support.receivers PORT`: which of driver, watchdog and simulator receives which frames of a simulated bus.

Prints a line of JSON when all listen; when it is answered another one: {"driver": [...], …}, identifiers in order.
"""

from __future__ import annotations

import json
import sys
import time
from functools import partial

import can

from canbase_base.local_frames import keep_to_this_computer
from canbase_config.load import load_robot, sample
from canbase_driver.runtime import bus_port as of_the_driver
from canbase_watchdog import bus_port as of_the_watchdog

INSIDE = can.Message(arbitration_id=0x181, data=b"\1", is_extended_id=False)
"""What another process of the same computer sends meanwhile."""


def main(port: int, hop_limit: int) -> None:
    """Listen."""
    given = load_robot(sample("bench")).robot.bus
    arguments = given.model_copy(update={"extra": {"port": port, "hop_limit": hop_limit}}).arguments()
    driver, watchdog = of_the_driver.BusPort(arguments), of_the_watchdog.BusPort(arguments)
    with watchdog, can.Bus(**arguments) as simulator, can.Bus(**arguments) as neighbour:
        keep_to_this_computer(arguments, simulator)
        print("{}", flush=True)
        neighbour.send(INSIDE)
        sys.stdin.readline()
        heard = {
            "driver": [frame.cob_id for frame in iter(partial(driver.receive, 0.0), None)],
            "watchdog": [cob_id for cob_id, _, _ in watchdog.receive(time.monotonic())],
            "simulator": [message.arbitration_id for message in iter(partial(simulator.recv, 0.0), None)],
            "neighbour": [message.arbitration_id for message in iter(partial(neighbour.recv, 0.0), None)],
        }
        driver.close()
    print(json.dumps(heard), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
