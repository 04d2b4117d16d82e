"""The independent watchdog process: standard library, python-can and one plain dataclass. No ROS, no driver."""
