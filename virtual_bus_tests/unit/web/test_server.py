"""The process of `canbase web`: what ends it."""

from __future__ import annotations

import asyncio
import re
import subprocess
import sys
from pathlib import Path

import uvicorn
from ruamel.yaml import YAML

from canbase_config.load import sample
from canbase_config.mux import DEFAULT_SOURCES, Mux, MuxSource
from canbase_web.drive_page import MISSING
from canbase_web.server import _end_with, _is_ours, _Server

ROOT = Path(__file__).parents[3]


def test_a_loop_that_fails_ends_the_process_with_its_error_and_one_that_is_canceled_does_not() -> None:
    async def fails() -> None:
        raise RuntimeError("the publisher is gone")

    async def story() -> tuple[tuple[bool, str], tuple[bool, str]]:
        found = []
        for cancels in (True, False):
            server = _Server(uvicorn.Config("unused"))
            loop = asyncio.create_task(fails())
            if cancels:
                loop.cancel()
            await asyncio.wait([loop])
            _end_with(server, loop)
            found.append((server.should_exit, server.failure))
        return found[0], found[1]

    assert asyncio.run(story()) == ((False, ""), (True, "RuntimeError('the publisher is gone')"))


def test_the_page_publishes_velocities_of_the_base_and_no_wheel_speeds() -> None:
    assert _is_ours(MuxSource(topic="cmd_vel_web", priority=1, timeout_s=0.3))
    assert not _is_ours(MuxSource(topic="cmd_vel_web", type="joint_command", priority=1, timeout_s=0.3))
    assert not _is_ours(None)


def test_the_sample_the_docs_and_the_page_have_the_same_sources_the_defaults_and_the_page() -> None:
    """Given sources replace the defaults: without the others no goal would be accepted, and Nav2 not followed."""
    shown = re.search(r"```yaml\n(mux:.*?)```", (ROOT / "docs" / "web.md").read_text(encoding="utf-8"), re.DOTALL)
    assert shown
    for text in (sample("bench").read_text("utf-8"), shown[1], MISSING[MISSING.index("mux:") :]):
        sources = dict(Mux.model_validate(YAML(typ="safe").load(text)["mux"]).sources)
        assert _is_ours(sources.pop("web"))
        assert sources == DEFAULT_SOURCES


def test_nothing_of_the_current_folder_is_read_or_written_through_a_link_there(tmp_path: Path) -> None:
    """NiceGUI would, as it is imported: a stranger's folder would give its bytes to a file of root."""
    (tmp_path / ".nicegui").mkdir()
    planted = tmp_path / ".nicegui" / "storage-general.json"
    planted.write_text('{"planted": true}', encoding="utf-8")
    planted.with_name(f"{planted.name}.tmp").symlink_to(tmp_path / "victim")
    said = subprocess.run(
        [sys.executable, "-c", "import canbase_web.server, nicegui; print(nicegui.app.storage.general)"],
        cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    assert said.stdout == "{}\n"
    assert not planted.is_symlink()
    assert not (tmp_path / "victim").exists()
