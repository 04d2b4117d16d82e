"""One mutant against its tests, in a forked process: the mutated text is imported in place of the file, which stays as
it is. So an interrupted run leaves nothing behind, and several can run at once.
"""

from __future__ import annotations

import gc
import importlib.abc
import importlib.machinery
import os
import resource
import sys
from collections.abc import Sequence
from types import CodeType, ModuleType

import pytest

from mutation.mutants import Mutant
from mutation.targets import LONG, ROOT, Target, files

CPU_S = 90
"""A mutant that makes an endless loop is killed by this: three times what the longest tests of a module take."""
WALL_S = 600
"""A single test may take this long on a busy machine [s]."""
MEMORY_BYTES = 3 * 2**30
UNUSED = [f"-pno:{plugin}" for plugin in ("cacheprovider", "faulthandler", "threadexception", "unraisableexception")]
"""Parts of pytest that take time and would kill no mutant."""
PRELOADED = ("hypothesis", "can", "canbase_config.load", "canbase_config.derive", "canbase_sim.world.bench")
"""Imported once, before the forks; nothing that is mutated may be among it."""
HOOK = "hazards.proof_rules"
"""Of conftest.py: it judges proofs, kills no mutant, and imports half of the project each time."""


class _Loader(importlib.abc.InspectLoader):
    def __init__(self, text: str, path: str) -> None:
        self._text, self._path = text, path

    def get_source(self, fullname: str) -> str:
        return self._text

    def get_code(self, fullname: str) -> CodeType:
        return self.source_to_code(self._text, self._path)


class _Finder(importlib.abc.MetaPathFinder):
    def __init__(self, target: Target, text: str) -> None:
        self._target, self._text = target, text

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != self._target.module:
            return None
        place = str(ROOT / self._target.path)
        return importlib.machinery.ModuleSpec(fullname, _Loader(self._text, place), origin=place)


def preload() -> None:
    """What every trial needs. Compiled tests are kept on disk: compiling them again takes longer than running them."""
    sys.dont_write_bytecode = False
    for name in PRELOADED:
        importlib.import_module(name)
    sys.modules[HOOK] = ModuleType(HOOK)
    vars(sys.modules[HOOK]).update(pytest_itemcollected=None, pytest_runtest_makereport=None)
    gc.collect()
    gc.freeze()


def survives(target: Target, mutant: Mutant) -> bool:
    """True when no test notices."""
    return all(_passes(target, mutant.source, names) for names in (target.first, target.then))


def passes_unchanged(target: Target) -> bool:
    """The tests pass, run in the same way, when nothing is changed: else every mutant would look killed."""
    return all(_passes(target, target.source, names) for names in (target.first, target.then))


def _passes(target: Target, text: str, names: tuple[str, ...]) -> bool:
    if not names:
        return True  # pytest without names would run every test
    if target.module in sys.modules:
        raise RuntimeError(f"{target.module} is imported already: its mutants would not be")
    pid = os.fork()
    if pid == 0:
        _run(target, text, names)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0


def _run(target: Target, text: str, names: tuple[str, ...]) -> None:
    """The child's whole life; it never returns."""
    status = 1
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        sys.meta_path.insert(0, _Finder(target, text))
        os.chdir(ROOT)
        _steady_hypothesis()
        options = [*UNUSED, "-x", "-q", "-o", f"timeout={WALL_S}", "-k", f"not ({LONG})"]
        status = int(pytest.main([*options, *files(names)]))
    finally:
        os._exit(status)


def _steady_hypothesis() -> None:
    """The same examples each time, and nothing kept on disk."""
    from hypothesis import HealthCheck, settings

    unhurried = list(HealthCheck)
    settings.register_profile(
        "mutation", derandomize=True, database=None, deadline=None, suppress_health_check=unhurried
    )
    settings.load_profile("mutation")
