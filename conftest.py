"""Options of pytest that point the tests of the driver at real drives. In the root, so that they are always known."""

from __future__ import annotations

import pytest

from support import real_bus

pytest_plugins = ["pytester"]


def pytest_addoption(parser: pytest.Parser) -> None:
    """`pytest --can-interface socketcan --can-channel can0 --personality epos4 --robot=robot.yaml`"""
    real_bus.add_options(parser)


def pytest_report_header(config: pytest.Config) -> list[str]:
    """A warning before real wheels turn."""
    return real_bus.warning(config)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Real drives are given the harmless tests alone."""
    real_bus.leave_out(config, items)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Time to think."""
    real_bus.pause(session.config)
