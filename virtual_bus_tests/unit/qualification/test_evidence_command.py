"""`canbase prove evidence`: the folder that it writes, and what it finds when somebody has changed that folder."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.commissioned import STEPS, mark
from canbase_config.fingerprint import configuration_sha256
from canbase_config.load import load_robot
from canbase_driver.runtime.black_box_about import about
from canbase_evidence import hash_list
from canbase_evidence.hash_list import Difference, HashListError
from canbase_evidence.software import Software
from canbase_evidence.standing import Finding, Part, Standing
from canbase_hazards import catalogue
from canbase_qualification.software import software
from support.robot_files import write

FRAMES = Path(__file__).parent.parent / "recording" / "data" / "cable_of_left_wheel_cut.asc"
REPORT_OF = "commissioning-{}-20261124-101500.md"
ODD = "<script>alert(1)</script>"
CATALOGUE = catalogue.load()
NOON = "1795521600"
"""2026-11-24 12:00:00 UTC."""
SOFTWARE = Software(
    {"canbase": "0.1.0"},
    '{"components": []}',
    Finding(Part.SOFTWARE, Standing.PRESENT, "0 installed packages."),
)


@pytest.fixture(autouse=True)
def _known_time_and_software() -> Iterator[None]:
    """What is installed takes seconds to list: bus/test_evidence_page.py does that."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", NOON)
        patch.setattr("canbase_evidence.software.software", lambda: SOFTWARE)
        patch.setattr("canbase_hazards.catalogue.load", lambda: CATALOGUE)
        yield


def run(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["prove", "evidence", *map(str, words)], catch_exceptions=False)
    return done.exit_code, done.stdout, done.stderr


@pytest.fixture
def robot_yaml(tmp_path: Path) -> Path:
    """A real robot with identities, not commissioned yet."""
    identity = "    identity: {vendor_id: 0xFB, product_code: 0x60500000, revision: 0x16, serial: 0x2A}"
    wire = {2: "  interface: socketcan", 3: "  channel: can0"}
    return write(tmp_path, {**wire, 8: f"    side: left\n{identity}", 13: f"    side: right\n{identity}"})


def commissioned(robot_yaml: Path) -> Path:
    robot = load_robot(robot_yaml).robot
    lines = "".join(f"  {step}: {mark(robot, step)}\n" for step in STEPS)
    robot_yaml.write_text(f"{robot_yaml.read_text()}commissioned:\n{lines}")
    (robot_yaml.parent / REPORT_OF.format(robot.name)).write_text("# Commissioning\n")
    return robot_yaml


def recording(folder: Path, config: Path, name: str = "stop_a", **changes: Any) -> Path:
    folder.mkdir(exist_ok=True)
    head = {"format": 1, "stopped_by": "watchdog", "cause": "watchdog tripped", "detail": ODD, "at_s": 5.0}
    told = {**head, "began_s": 1.0, "wall_offset_s": 1795500000.0, **about(load_robot(config).robot), **changes}
    (folder / f"{name}.json").write_text(json.dumps(told))
    return Path(shutil.copy(FRAMES, folder / f"{name}.asc"))


def qualification(folder: Path, robot_yaml: Path, **changes: Any) -> Path:
    folder.mkdir()
    robot = load_robot(robot_yaml).robot
    report: dict[str, Any] = {"verdict": "No violation.", "violations": 0, "grade": "passed"}
    report["configuration_sha256"] = configuration_sha256(robot)
    computed = software()
    report["versions"] = {"canbase": f"{computed.canbase}, sources {computed.sources}"}
    for name, text in {"report.json": json.dumps(report | changes), "report.html": "<p>", "report.md": "#"}.items():
        (folder / name).write_text(text)
    (folder / "results.jsonl").write_text("{}\n")
    return folder


def junit_of_everything(file: Path, patch: pytest.MonkeyPatch, *, failing: str = "") -> Path:
    """All tests that hazards.yaml names; the code that they tested is the installed one."""
    patch.setattr("canbase_evidence.gather.code_sha256", lambda: "c0de")
    names = sorted({name for row in CATALOGUE.rows for name in row.tests})
    cases = "".join(_testcase(name, failed=name == failing) for name in names)
    file.write_text(f"<testsuites><testsuite>{cases}</testsuite></testsuites>")
    return file


def _testcase(name: str, *, failed: bool) -> str:
    matrix = "test_the_robot_stops_in_time_and_stays_at_rest"
    path, _, function = name.partition("::")
    module, test = f"virtual_bus_tests.{path.removesuffix('.py').replace('/', '.')}", function or "test_it"
    if name.startswith("matrix: "):
        module, test = "virtual_bus_tests.ros.test_exit_matrix", f"{matrix}[{name.removeprefix('matrix: ')}]"
    if name.startswith("virtual robot: "):
        module, test = "vm", name.removeprefix("virtual robot: ")
    *classes, test = test.split("::")
    counts = "".join(f'<property name="canbase_tests_of_{what}" value="1"/>' for what in ("file", "function"))
    told = f'<properties><property name="canbase_code" value="c0de"/>{counts}</properties>'
    classname = ".".join([module, *classes])
    return f'<testcase classname="{classname}" name="{test}">{told}{"<failure/>" if failed else ""}</testcase>'


def found_in(folder: Path) -> dict[str, Any]:
    told: dict[str, Any] = json.loads((folder / "evidence.json").read_text(encoding="utf-8"))
    return told


def everything(tmp_path: Path, robot_yaml: Path, patch: pytest.MonkeyPatch, **more: Any) -> tuple[int, str, Path]:
    commissioned(robot_yaml)
    out = tmp_path / "evidence"
    recording(tmp_path / "stops", robot_yaml)
    code, text, _ = run(
        robot_yaml, "--out", out, "--qualification", qualification(tmp_path / "qualification", robot_yaml),
        "--recordings", tmp_path / "stops", "--tests", junit_of_everything(tmp_path / "tests.xml", patch, **more),
    )  # fmt: skip
    return code, text, out


def test_when_everything_is_there_the_exit_code_is_0(
    tmp_path: Path, robot_yaml: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code, text, out = everything(tmp_path, robot_yaml, monkeypatch)
    assert (code, found_in(out)["open"]) == (0, [])
    assert "It is no certificate." in text
    assert found_in(out)["complete"] is True
    assert {each["result"] for each in found_in(out)["hazards"]} == {"passed"}
    names = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    assert names == {
        "index.html", "evidence.json", "SHA256SUMS", "bom.cdx.json", "configuration/robot.yaml",
        "configuration/effective.yaml", "tests/hazards.yaml", "tests/tests.xml", "recordings/stop_a.asc",
        "recordings/stop_a.json", "qualification/report.json", "qualification/report.html", "qualification/report.md",
        "qualification/results.jsonl", f"commissioning/{REPORT_OF.format(load_robot(robot_yaml).robot.name)}",
    }  # fmt: skip


def test_one_failed_test_is_the_first_sentence_of_what_is_missing(
    tmp_path: Path, robot_yaml: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "unit/driver/test_velocity_command.py"
    code, _, out = everything(tmp_path, robot_yaml, monkeypatch, failing=name)
    assert code == 3
    (found,) = found_in(out)["open"]
    assert (found["part"], found["standing"]) == ("Hazards and tests", "failed")
    rows = [each for each in found_in(out)["hazards"] if each["result"] == "failed"]
    assert {test["name"] for row in rows for test in row["tests"] if test["result"] == "failed"} == {name}


def test_with_a_robot_yaml_alone_every_gap_is_named_and_every_test_is_not_run(tmp_path: Path, robot_yaml: Path) -> None:
    code, text, _ = run(robot_yaml, "--out", tmp_path / "evidence")
    told = found_in(tmp_path / "evidence")
    assert (code, told["complete"]) == (3, False)
    assert {each["result"] for each in told["hazards"]} == {"not run"}
    missing = [each["part"] for each in told["open"] if each["standing"] == "missing"]
    assert missing == [
        "Hazards and tests", "Qualification in simulation", "Commissioning", "Commissioning", "Recorded stops",
    ]  # fmt: skip
    assert text.startswith(f"missing: Hazards and tests: Of {len(told['hazards'])} hazards")


def test_the_same_input_gives_the_same_bytes_except_the_stated_time(
    tmp_path: Path, robot_yaml: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording(tmp_path / "stops", robot_yaml)
    words = (robot_yaml, "--recordings", tmp_path / "stops", "--out")
    run(*words, tmp_path / "one")
    run(*words, tmp_path / "two")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", str(int(NOON) + 3600))
    run(*words, tmp_path / "later")
    one, two, later = (hash_list.hashes(tmp_path / name) for name in ("one", "two", "later"))
    assert one == two
    assert {name for name in one if one[name] != later[name]} == {"index.html", "evidence.json", "SHA256SUMS"}
    texts = [(tmp_path / name / "index.html").read_text() for name in ("one", "later")]
    assert texts[0].replace("2026-11-24T12:00:00Z", "2026-11-24T13:00:00Z") == texts[1]


def test_what_belongs_to_another_configuration_is_marked_and_never_counted(tmp_path: Path, robot_yaml: Path) -> None:
    recording(tmp_path / "stops", robot_yaml)
    made = qualification(tmp_path / "qualification", robot_yaml)
    robot_yaml.write_text(robot_yaml.read_text().replace("linear_mps: 0.8", "linear_mps: 0.7"))
    out = tmp_path / "evidence"
    assert run(robot_yaml, "--qualification", made, "--recordings", tmp_path / "stops", "--out", out)[0] == 3
    told = {
        each["part"]: each["sentence"] for each in found_in(out)["open"] if each["standing"] == "does not belong here"
    }
    assert "another configuration" in told["Qualification in simulation"]
    assert told["Recorded stops"] == "1 recordings do not count: 1 of another configuration."


def test_a_recording_that_cannot_be_used_is_kept_and_named(tmp_path: Path, robot_yaml: Path) -> None:
    stops = tmp_path / "stops"
    recording(stops, robot_yaml, "a").with_suffix(".json").unlink()
    recording(stops, robot_yaml, "b").with_suffix(".json").write_text("{")
    recording(stops, robot_yaml, "c", robot_yaml={"name": 1})
    run(robot_yaml, "--recordings", stops, "--out", tmp_path / "evidence")
    told = found_in(tmp_path / "evidence")
    assert {(each["file"], each["standing"]) for each in told["recordings"]} == {
        (f"recordings/{name}.asc", "incomplete") for name in "abc"
    }


def test_recordings_of_the_same_name_are_kept_apart_each_with_its_json_file(tmp_path: Path, robot_yaml: Path) -> None:
    for folder, cause in (("first", "lease lost"), ("second", "drive silent")):
        recording(tmp_path / folder, robot_yaml, cause=cause)
    words = ("--recordings", tmp_path / "first", "--recordings", tmp_path / "second" / "stop_a.asc")
    run(robot_yaml, *words, "--out", tmp_path / "evidence")
    told = found_in(tmp_path / "evidence")["recordings"]
    assert {each["file"]: each["cause"] for each in told} == {
        "recordings/stop_a.asc": "lease lost",
        "recordings/stop_a-2.asc": "drive silent",
    }


def test_what_watchdog_and_filter_recorded_of_a_stop_is_kept_for_a_replay(tmp_path: Path, robot_yaml: Path) -> None:
    recording(tmp_path / "stops", robot_yaml)
    (tmp_path / "stops" / "watchdog_canbase_1.jsonl").write_text("{}\n")
    (tmp_path / "stops" / "other.txt").write_text("no recording")
    run(robot_yaml, "--recordings", tmp_path / "stops", "--out", tmp_path / "evidence")
    kept = {path.name for path in (tmp_path / "evidence" / "recordings").iterdir()}
    assert kept == {"stop_a.asc", "stop_a.json", "watchdog_canbase_1.jsonl"}


class Reader(HTMLParser):
    """Collects the text in order, and the tags."""

    def __init__(self) -> None:
        super().__init__()
        self.words: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def test_the_page_says_first_what_it_is_not_then_what_is_missing(tmp_path: Path, robot_yaml: Path) -> None:
    recording(tmp_path / "stops", robot_yaml)
    run(robot_yaml, "--recordings", tmp_path / "stops", "--out", tmp_path / "evidence")
    text = (tmp_path / "evidence" / "index.html").read_text(encoding="utf-8")
    reader = Reader()
    reader.feed(text)
    whole = "\n".join(reader.words)
    order = [whole.index(words) for words in ("This is no certificate", "No qualification was given", "What is here")]
    assert order == sorted(order)
    assert ODD in whole, "the text of a recording is text"
    assert "script" not in reader.tags
    assert "default-src 'none'" in text
    for row in CATALOGUE.rows:
        assert row.failure in whole


# ---- changes afterwards


@pytest.fixture
def folder(tmp_path: Path, robot_yaml: Path) -> Path:
    run(robot_yaml, "--out", tmp_path / "evidence")
    return tmp_path / "evidence"


def test_an_untouched_folder(folder: Path) -> None:
    code, text, _ = run("--check", folder)
    assert code == 0
    assert "unchanged since its list of hashes was written" in text
    assert (
        subprocess.run(["sha256sum", "-c", "--strict", "SHA256SUMS"], cwd=folder, capture_output=True).returncode == 0
    )


def test_files_that_were_changed_added_or_removed_are_named(folder: Path) -> None:
    robot = folder / "configuration" / "robot.yaml"
    robot.write_text(robot.read_text() + "# \n")
    (folder / "evidence.json").unlink()
    (folder / "recordings").mkdir()
    (folder / "recordings" / "stop.asc").write_text("new")
    code, text, told = run("--check", folder)
    assert code == 1
    assert text.splitlines() == [
        "changed: 'configuration/robot.yaml'",
        "removed: 'evidence.json'",
        "added: 'recordings/stop.asc'",
    ]
    assert "3 differences" in told


def test_a_link_or_a_pipe_in_place_of_a_file_is_a_change_and_is_not_followed(folder: Path, tmp_path: Path) -> None:
    page, data = folder / "index.html", folder / "evidence.json"
    page.rename(tmp_path / "elsewhere.html")
    page.symlink_to(tmp_path / "elsewhere.html")
    data.unlink()
    os.mkfifo(data)
    (folder / "more").symlink_to(tmp_path)
    assert hash_list.check(folder) == (
        Difference("evidence.json", "changed"), Difference("index.html", "changed"), Difference("more", "added"),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "it is empty"),
        ("abc  file\n", "line 1: 'abc  file', expected a SHA-256"),
        (f"{'a' * 64}  ../../etc/passwd\n", "lies outside"),
        (f"{'a' * 64}  /etc/passwd\n", "lies outside"),
        (f"{'a' * 64}  a\n{'b' * 64}  a\n", "line 2: 'a' is listed twice"),
    ],
)
def test_a_list_that_cannot_be_used(folder: Path, text: str, why: str) -> None:
    with pytest.raises(HashListError, match=why):
        hash_list.read(text)
    (folder / "SHA256SUMS").write_text(text)
    code, _, told = run("--check", folder)
    assert (code, why in told) == (1, True)


def test_a_folder_without_a_list(tmp_path: Path) -> None:
    code, _, told = run("--check", tmp_path)
    assert (code, "SHA256SUMS" in told) == (1, True)


# ---- wrong input


def test_nothing_is_overwritten(folder: Path, robot_yaml: Path) -> None:
    before = hash_list.hashes(folder)
    code, _, told = run(robot_yaml, "--out", folder)
    assert (code, "never overwritten" in told) == (2, True)
    assert hash_list.hashes(folder) == before


@pytest.mark.parametrize(
    ("option", "content", "said"),
    [
        ("--tests", "<html/>", "its root is <html>"),
        ("--scan", "{}", "not what canbase bus scan --json prints"),
        ("--scan", "[", "no JSON"),
        ("--recordings", None, "missing"),
        ("--qualification", None, "there is no such folder"),
    ],
)
def test_what_was_named_and_cannot_be_taken_ends_it_without_a_folder(
    tmp_path: Path, robot_yaml: Path, option: str, content: str | None, said: str
) -> None:
    file = tmp_path / "missing"
    if content is not None:
        file.write_text(content)
    code, _, told = run(robot_yaml, option, file, "--out", tmp_path / "out" / "evidence")
    assert (code, said in told) == (2, True), told
    assert not (tmp_path / "out" / "evidence").exists()
    assert list((tmp_path / "out").iterdir()) == [], "nor a part of it"


def test_a_link_among_recordings_is_refused(tmp_path: Path, robot_yaml: Path) -> None:
    """Services of another user write there, and root may gather."""
    recording(tmp_path / "stops", robot_yaml)
    (tmp_path / "stops" / "stop_b.asc").symlink_to("/etc/shadow")
    code, _, told = run(robot_yaml, "--recordings", tmp_path / "stops", "--out", tmp_path / "evidence")
    assert (code, "links are not followed" in told) == (2, True)


def test_a_robot_and_a_folder_are_no_question() -> None:
    assert run("robot.yaml", "--check", "folder")[0] == 2


def test_a_disk_that_takes_nothing_leaves_nothing(tmp_path: Path, robot_yaml: Path) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("canbase_evidence.gather.page", full)
        code, _, told = run(robot_yaml, "--out", tmp_path / "out" / "evidence")
    assert (code, "No space left on device" in told) == (1, True)
    assert list((tmp_path / "out").iterdir()) == []
