"""The `canbase` command: thin, each file a subcommand that calls the other packages.

It imports nothing from the folder in which the user is: a file `difflib.py` there would run in place of Python's own,
as root under sudo. Processes that it starts: `own_modules.py`.
"""

# Nothing but what Python has loaded before it looks into any folder may be imported here; __future__ is a file too.
import os
import sys


def forget_current_folder(path: list[str], argv: list[str], environment: "os._Environ[str] | dict[str, str]") -> None:
    """Takes the current folder out of `path` (sys.path), and out of PYTHONPATH for the processes started from here.

    It is there by `python -m canbase_cli` (`argv` is ["-m", …] while Python looks for the module), and by an empty or
    relative entry of PYTHONPATH.
    """
    if argv[:1] == ["-m"] and not getattr(sys.flags, "safe_path", False):
        del path[:1]
    entries = environment.get("PYTHONPATH", "").split(os.pathsep)
    absolute = [entry for entry in entries if os.path.isabs(entry)]
    if entries not in (absolute, [""]):
        relative = {os.path.abspath(entry) for entry in entries} - set(absolute)
        path[:] = [entry for entry in path if os.path.abspath(entry) not in relative]
        environment["PYTHONPATH"] = os.pathsep.join(absolute)


forget_current_folder(sys.path, sys.argv, os.environ)
