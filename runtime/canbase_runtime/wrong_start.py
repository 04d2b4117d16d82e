"""The error of a node whose ROS arguments (parameters, namespace, remaps) make it one that must not move a robot."""


class WrongStartError(RuntimeError):
    """Its text is for the user. The command ends with the exit code of a wrong command line."""
