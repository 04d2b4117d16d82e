"""`canbase explain`, `canbase record export` and the page, on recordings of real processes on the bench."""

from __future__ import annotations

import json
import os
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from typer.testing import CliRunner

from canbase_cli import explain as explain_command
from canbase_cli.main import app
from canbase_config.load import load_robot, sample
from canbase_driver.runtime.black_box_about import about
from canbase_recording.entry import Note
from canbase_recording.explain_page import page
from canbase_recording.explanation import explain
from canbase_recording.recording_facts import RecordingFacts
from support.recorded_world import recorded, twin

DATA = Path(__file__).parent / "data"
CABLE, ENCODER, LOADED = (
    DATA / name for name in ("cable_of_left_wheel_cut.asc", "encoder_of_left_wheel_lost.asc", "computer_overloaded.asc")
)
BENCH = str(sample("bench"))
MOST_BYTES = 6_000_000
runner = CliRunner()


def run(*arguments: str) -> tuple[int, str, str]:
    result = runner.invoke(app, list(arguments), catch_exceptions=False)
    return result.exit_code, result.stdout, result.stderr


def test_without_a_file_it_takes_the_newest_recording_of_a_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    monkeypatch.setattr(explain_command, "SERVICES", tmp_path / "services")
    code, _, err = run("explain")
    assert (code, "have no recording of a stop; name a FILE" in err) == (2, True)
    folder = tmp_path / "canbase"
    folder.mkdir()
    for age_s, (name, file) in enumerate((("stop_new.asc", CABLE), ("stop_old.asc", ENCODER), ("record.asc", LOADED))):
        copied = shutil.copy(file, folder / name)
        os.utime(copied, (1e9 - age_s, 1e9 - age_s))
    code, out, err = run("explain", "--config", BENCH)
    assert (code, "first cause:  node silent" in out) == (0, True)
    assert "the newest recording:" in err
    assert "stop_new.asc" in err.replace("\n", "")


@pytest.mark.parametrize(
    ("file", "cause", "text"),
    [
        (CABLE, "node silent", "node 1 (left_wheel) sends nothing after 4.622 s, node 2 (right_wheel) goes on"),
        (
            ENCODER,
            "wheel shows no motion",
            "left_wheel is ordered 0.30 m/s, and its encoder shows no motion since 4.660 s",
        ),
        (LOADED, "recorder paused", "no frame was sent or received for 0.331 s: the driver stood still"),
    ],
)
def test_recordings_of_real_processes(file: Path, cause: str, text: str) -> None:
    code, out, _ = run("explain", str(file), "--config", BENCH)
    assert code == 0
    assert f"first cause:  {cause}\n" in out
    assert text in out
    code, out, _ = run("explain", str(file), "--json")
    assert code == 0
    (stop,) = json.loads(out)["stops"]
    assert stop["cause"] == cause


def test_the_robot_that_was_recorded_beside_a_black_box_is_taken_and_another_file_there_is_not(tmp_path: Path) -> None:
    recording = Path(shutil.copy(CABLE, tmp_path / "stop.asc"))
    beside = recording.with_suffix(".json")
    for content in ("", "[]", '{"robot_yaml": {}, "profiles": []}', '{"robot_yaml": {"name": 1}, "profiles": {}}'):
        beside.write_text(content)
        code, out, err = run("explain", str(recording))
        assert (code, "without robot.yaml" in out, "stop.json" in err) == (0, True, True), content
    head = {"format": 1, "stopped_by": "watchdog", "cause": "", "detail": "", "at_s": 5.0, "began_s": 0.0}
    beside.write_text(json.dumps({**head, "wall_offset_s": 0.0, **about(load_robot(sample("bench")).robot)}))
    code, out, err = run("explain", str(recording))
    assert (code, err) == (0, "")
    assert "read with stop.json" in out
    assert "right_wheel after 0.25 s and 0.056 m" in out


def test_what_canbase_explain_cannot_take(tmp_path: Path) -> None:
    foreign = tmp_path / "photo.jpg"
    foreign.write_bytes(b"\xff\xd8\xff" * 50)
    assert run("explain", str(foreign))[0] == 1
    empty = tmp_path / "empty.log"
    empty.write_text("(1.0) can0 zzz#\n")
    assert run("explain", str(empty))[0] == 1
    code, _, err = run("explain", str(tmp_path / "nothing.asc"))
    assert (code, "there is no such file" in err) == (2, True)
    assert run("explain", str(CABLE), "--config", str(foreign))[0] == 2
    assert run("explain", str(CABLE), "--eds", str(foreign))[0] == 2


class Attributes(HTMLParser):
    """All that a browser would load, and every tag."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.loads += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data", "action")]


def without_plotly(text: str) -> str:
    """The page's own parts."""
    return re.sub(r"<script>.*?</script>", "", text, count=1, flags=re.DOTALL)


def test_the_page_is_one_file_that_loads_nothing(tmp_path: Path) -> None:
    target = tmp_path / "stop.html"
    code, _, _ = run("explain", str(CABLE), "--config", BENCH, "--html", str(target))
    assert code == 0
    text = target.read_text(encoding="utf-8")
    assert len(text.encode()) < MOST_BYTES
    own = without_plotly(text)
    parser = Attributes()
    parser.feed(own)
    assert parser.loads == []
    assert "default-src 'none'" in own
    assert "node silent" in own
    for name in ("left_wheel ordered", "left_wheel measured", "right_wheel lease bounds", "cmd_vel linear"):
        assert name in own


def test_nothing_in_a_recording_becomes_markup() -> None:
    """A joint, a mux source, a detail and a file name that would like to run a script."""
    evil = '<script>alert("x")</script><img src=x onerror=alert(1)>'
    entries = recorded(twin("drive", "in fault")).box
    told = explain(Note(e.at_s, e.text.replace("joystick", evil)) if isinstance(e, Note) else e for e in entries)
    text = without_plotly(page(RecordingFacts(evil, evil, evil, evil, (evil,)), told))
    parser = Attributes()
    parser.feed(text)
    assert "img" not in parser.tags
    assert "alert(" not in "".join(
        re.findall(r"<script(?! type=.application/json)[^>]*>(.*?)</script>", text, re.DOTALL)
    )
    assert text.count("<script") == text.count("</script>")
    assert evil not in text


def test_export_gives_foxglove_s_library_ros_messages_and_explain_reads_it_again(tmp_path: Path) -> None:
    target = tmp_path / "stop.mcap"
    code, _, err = run("record", "export", str(CABLE), "--config", BENCH, "--mcap", str(target))
    assert (code, "6 topics" in err) == (0, True)
    with target.open("rb") as stream:
        found = [
            (channel.topic, schema.name if schema else "", message, decoded)
            for schema, channel, message, decoded in make_reader(
                stream, decoder_factories=[DecoderFactory()]
            ).iter_decoded_messages()
        ]
    types = {topic: kind for topic, kind, _, _ in found}
    assert types == {
        "/can_frames": "can_msgs/msg/Frame",
        "/recording_notes": "std_msgs/msg/String",
        "/joint_states": "sensor_msgs/msg/JointState",
        "/joint_states_ordered": "sensor_msgs/msg/JointState",
        "/cmd_vel": "geometry_msgs/msg/TwistStamped",
        "/rosout": "rcl_interfaces/msg/Log",
    }
    joints = [decoded for topic, _, _, decoded in found if topic == "/joint_states"]
    assert joints[100].name == ["left_wheel", "right_wheel"]
    assert max(joint.velocity[1] for joint in joints[10:]) == pytest.approx(0.30 / 0.1, rel=0.1)
    frames = [decoded for topic, _, _, decoded in found if topic == "/can_frames"]
    assert any(frame.id == 0x201 and frame.dlc == 6 and bytes(frame.data)[:2] == b"\x0f\x00" for frame in frames)
    said = [decoded.msg for topic, _, _, decoded in found if topic == "/rosout"]
    assert any(text.startswith("tripped: drive silent") for text in said)
    begins = next(message.log_time for _, _, message, _ in found) / 1e9
    assert begins == pytest.approx(1_795_554_225.9, abs=86_400)

    assert run("record", "export", str(CABLE), "--mcap", str(target))[0] == 2  # it exists
    asc, mcap = (json.loads(run("explain", str(file), "--config", BENCH, "--json")[1]) for file in (CABLE, target))
    assert asc["stops"][0]["cause"] == mcap["stops"][0]["cause"] == "node silent"
    assert mcap["stops"][0]["at_s"] - asc["stops"][0]["at_s"] == pytest.approx(0.0, abs=0.001)
    assert mcap["notes"] == asc["notes"]


def test_an_mcap_file_that_was_cut_is_read_up_to_there(tmp_path: Path) -> None:
    target, cut = tmp_path / "stop.mcap", tmp_path / "cut.mcap"
    run("record", "export", str(CABLE), "--mcap", str(target))
    shutil.copy(target, cut)
    with cut.open("r+b") as file:
        file.truncate(target.stat().st_size // 2)
    code, out, _ = run("explain", str(cut))
    assert code in (0, 1)
    assert "ends early" in out or code == 1
