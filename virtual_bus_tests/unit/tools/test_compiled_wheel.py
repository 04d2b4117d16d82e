"""What the compiled wheel compiles: modules that exist, each once, and nothing of others in the watchdog's library."""

from __future__ import annotations

from importlib.machinery import EXTENSION_SUFFIXES
from types import SimpleNamespace

import pytest

from canbase_runtime import version
from compiled.__main__ import path_of
from compiled.modules import ROOT, SOURCES
from compiled.wheel import CHAIN, WATCHDOG, groups


def test_each_module_is_there_and_in_one_library() -> None:
    modules = [module for each in groups().values() for module in each]
    assert len(set(modules)) == len(modules) > 80
    for module in modules:
        assert (ROOT / SOURCES[module.partition(".")[0]] / path_of(module)).is_file(), module


def test_the_watchdog_shares_no_library_with_anybody() -> None:
    assert {module.partition(".")[0] for module in groups()[WATCHDOG]} == {"canbase_watchdog"}
    assert "canbase_watchdog" not in {module.partition(".")[0] for module in groups()[CHAIN]}


def test_no_compiled_module_of_the_chain_is_known_to_the_watchdog() -> None:
    """It imports `canbase_config.watchdog` alone, which stays Python; so its process loads its own library alone."""
    assert not [module for module in groups()[CHAIN] if module.startswith("canbase_config")]


@pytest.mark.parametrize(
    ("file", "compiled"),
    [("policy.py", False), (f"policy{EXTENSION_SUFFIXES[0]}", True), (None, False)],
)
def test_the_version_says_when_the_policy_runs_compiled(
    monkeypatch: pytest.MonkeyPatch, file: str | None, compiled: bool
) -> None:
    monkeypatch.setattr(version, "find_spec", lambda name: SimpleNamespace(origin=file))
    assert version.is_compiled() is compiled


def test_an_installation_without_a_watchdog_is_not_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(version, "find_spec", lambda name: None)
    assert version.is_compiled() is False
