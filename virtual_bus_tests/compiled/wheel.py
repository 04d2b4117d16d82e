"""`python -m compiled.wheel`: a wheel whose deciding modules are compiled by mypyc, into dist/.

It is the wheel of the sources, with a library beside each module that `modules.HOT` names. The watchdog has a library
of its own: nothing of the driver is loaded into its process. Python does without the libraries: delete them, and the
same modules run interpreted.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

from compiled.__main__ import build, path_of, translate
from compiled.modules import HOT, ROOT
from compiled.native_form import native_form

FOLDER = ROOT / "build" / "compiled-wheel"
WATCHDOG, CHAIN = "canbase_watchdog", "canbase_chain"
PACKAGES = {
    WATCHDOG: ("canbase_watchdog",),
    CHAIN: ("canbase_runtime", "canbase_driver", "canbase_velocity"),
}
"""By library. canbase_config stays Python: the watchdog and the others both import it."""
BUILD_TAG = "1compiled"
"""In the name of the file (PyPA, binary distribution format): of two wheels of one version, pip takes this one."""


def groups() -> dict[str, list[str]]:
    """The modules of each library."""
    return {
        library: [f"{package}.{name}" for package in packages for name in HOT[package].split()]
        for library, packages in PACKAGES.items()
    }


def unpacked(wheel: Path) -> Path:
    """The wheel as a folder, its modules in the form that is compiled: so the lines of a traceback fit."""
    run(sys.executable, "-m", "wheel", "unpack", "--dest", str(FOLDER), str(wheel))
    (tree,) = (path for path in FOLDER.iterdir() if path.is_dir() and path.name.startswith("canbase-"))
    for module in [module for modules in groups().values() for module in modules]:
        path = tree / path_of(module)
        path.write_text(native_form(path.read_text(encoding="utf-8")), encoding="utf-8")
    return tree


def run(*command: str) -> None:
    """A command that must succeed."""
    subprocess.run(command, check=True, cwd=ROOT)


def main() -> None:
    """Where to put the wheel, from the command line."""
    parser = argparse.ArgumentParser(prog="compiled.wheel", description=__doc__)
    parser.add_argument("--dest", type=Path, default=ROOT / "dist", metavar="FOLDER", help="for the wheel")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="C compilers at a time")
    parser.add_argument("--level", default="2", help="of optimization: 0 compiles fastest")
    given = parser.parse_args()
    dest = given.dest.resolve()
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    dest.mkdir(parents=True, exist_ok=True)
    options = ("--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", str(FOLDER))
    run(sys.executable, "-m", "pip", "wheel", *options, ".")
    (wheel,) = FOLDER.glob("canbase-*.whl")
    tree = unpacked(wheel)
    os.chdir(tree)
    build(translate(groups(), given.level), given.level, given.jobs)
    shutil.rmtree("build")
    shutil.rmtree(".mypy_cache", ignore_errors=True)
    run(sys.executable, "-m", "wheel", "pack", "--dest-dir", str(dest), "--build-number", BUILD_TAG, str(tree))


if __name__ == "__main__":
    main()
