"""`python -m canbase_sim ROBOT.yaml`: the same as `canbase serve sim`, without the rest of canbase installed."""

from __future__ import annotations

import argparse
import sys

from canbase_config.errors import ConfigError
from canbase_config.load import load_robot
from canbase_sim.main import run


def main() -> int:
    """Exit code of the simulation; 2 when the robot file is wrong."""
    parser = argparse.ArgumentParser(prog="python -m canbase_sim", description="Simulated drives of a robot.yaml")
    parser.add_argument("robot", help="path of robot.yaml")
    parser.add_argument("--control", help="path of the control socket (default: sim.sock beside lease.socket)")
    parser.add_argument("--factory-fresh", action="store_true", help="every drive has node id 1 and 125 kbit/s")
    arguments = parser.parse_args()
    try:
        robot = load_robot(arguments.robot).robot
    except ConfigError as error:
        parser.exit(2, f"{error}\n")
    return run(robot, arguments.control, factory_fresh=arguments.factory_fresh)


if __name__ == "__main__":
    sys.exit(main())
