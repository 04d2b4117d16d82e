"""`python -m compiled`: copies the packages to build/compiled and compiles there what `modules.HOT` names, by mypyc."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import setuptools  # type: ignore[import-untyped]
from mypyc.build import mypycify

from compiled import finder
from compiled.copies import copies
from compiled.modules import BUILD, SOURCES, hot_modules

MYPY = (
    "--config-file=",
    "--explicit-package-bases",
    "--ignore-missing-imports",
    "--python-version",
    f"3.{sys.version_info.minor}",
)
FLAGS = ("-fPIC", "-fno-semantic-interposition", "-fwrapv", "-g0", "-w", "-UNDEBUG")
"""Of the C compiler. Nothing like -ffast-math: floats have to come out bit for bit."""


def path_of(module: str) -> Path:
    """Of the copy, from the folder of the build."""
    return Path(*module.split(".")).with_suffix(".py")


def copy() -> None:
    """All packages. What has not changed keeps its time; a package that is no more would hide the one of its name."""
    for left in BUILD.glob("*/*.py"):
        if left.parent.name not in SOURCES:
            shutil.rmtree(left.parent, ignore_errors=True)
    for path, data in copies():
        if not path.exists() or path.read_bytes() != data:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)


def translate(groups: Mapping[str, Sequence[str]], level: str) -> list[setuptools.Extension]:
    """C sources of a library for each group of modules, and of a small one for each module, which leads there."""
    os.environ["MYPYPATH"] = "."
    paths = {group: [str(path_of(module)) for module in modules] for group, modules in groups.items()}
    everything = [path for each in paths.values() for path in each]
    separate: list[tuple[list[str], str | None]] = [(each, group) for group, each in paths.items()]
    made = mypycify([*MYPY, *everything], opt_level=level, debug_level="0", multi_file=True, separate=separate)
    assert isinstance(made, list)
    return made


def build(extensions: list[setuptools.Extension], level: str, jobs: int) -> None:
    """Compile what has changed, `jobs` at a time, and link."""
    with ThreadPoolExecutor(jobs) as pool:
        jobs_of = [partial(_compile, source, one.include_dirs, level) for one in extensions for source in one.sources]
        list(pool.map(lambda job: job(), jobs_of))
        list(pool.map(partial(_link, level), extensions))


def _compile(source: str, include: list[str], level: str) -> None:
    made, headers = Path(f"{source}.O{level}.o"), Path("build").glob("*.h")
    if not made.exists() or made.stat().st_mtime <= max(path.stat().st_mtime for path in (Path(source), *headers)):
        folders = [f"-I{folder}" for folder in (*include, sysconfig.get_path("include"))]
        subprocess.run(["gcc", *FLAGS, f"-O{level}", *folders, "-c", source, "-o", f"{source}.part"], check=True)
        Path(f"{source}.part").rename(made)


def _link(level: str, extension: setuptools.Extension) -> None:
    library = extension.name.replace(".", "/") + sysconfig.get_config_var("EXT_SUFFIX")
    objects = [f"{source}.O{level}.o" for source in extension.sources]
    subprocess.run(["gcc", "-shared", "-Wl,-Bsymbolic", *objects, "-o", library], check=True)


def main() -> None:
    """Number of C compilers and level of optimization from the command line."""
    parser = argparse.ArgumentParser(prog="compiled", description=__doc__)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="C compilers at a time")
    parser.add_argument("--level", default="2", help="of optimization: 0 compiles fastest")
    given = parser.parse_args()
    copy()
    os.chdir(BUILD)
    for library in Path().rglob("*.so"):
        library.unlink()
    build(translate({"canbase": hot_modules()}, given.level), given.level, given.jobs)
    shutil.copy(finder.__file__, "sitecustomize.py")


if __name__ == "__main__":
    main()
