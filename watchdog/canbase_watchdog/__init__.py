"""The independent watchdog process: standard library, python-can and one plain dataclass. Never ROS, never the driver."""
