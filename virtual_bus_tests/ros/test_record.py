"""`canbase record start --mcap` beside publishers, and its file as Foxglove's library reads it."""

from __future__ import annotations

import random
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import TwistStamped
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, String

from ros.conftest import Spawn
from support.ros_harness import Process, TestNode
from support.running_robot import CANBASE

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def messages(path: Path) -> Iterator[tuple[str, str, Any]]:
    """Topic, type and message, in the order of the file; only a complete file can be read so."""
    with path.open("rb") as stream:
        for schema, channel, _message, decoded in make_reader(
            stream, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            assert schema is not None
            yield channel.topic, schema.name, decoded


def recording(node: TestNode, spawn: Spawn, path: Path, *options: str) -> Process:
    """A recorder that has subscribed to `speed`, which is published all the time."""
    node.repeat(TwistStamped, "speed", 50.0).message = speed(0.25)
    process = spawn([*CANBASE, "record", "--mcap", str(path), *options])
    node.wait_for(lambda: node.node.count_subscribers("speed") > 0, 20.0, "the recorder")
    return process


def speed(mps: float) -> TwistStamped:
    message = TwistStamped()
    message.twist.linear.x = mps
    return message


def test_every_topic_with_its_type_until_ctrl_c_and_what_appears_later_from_then_on(
    test_node: TestNode, spawn: Spawn, tmp_path: Path
) -> None:
    """A latched button ── recorder ── 1 s ── a new topic ── 3 s ── SIGINT."""
    path = tmp_path / "run.mcap"
    button = test_node.node.create_publisher(Bool, "button", LATCHED)
    button.publish(Bool(data=True))
    process = recording(test_node, spawn, path)
    test_node.spin_for(1.0)
    words = test_node.node.create_publisher(String, "words", LATCHED)
    words.publish(String(data="späť"))
    hidden = test_node.node.create_publisher(String, "_hidden", LATCHED)
    hidden.publish(String(data="no"))
    test_node.wait_for(lambda: test_node.node.count_subscribers("words") > 0, 20.0, "the new topic's recorder")
    test_node.spin_for(0.5)
    process.interrupt()
    assert process.wait(20.0) == 0
    found = list(messages(path))
    by_topic = {topic: (kind, message) for topic, kind, message in found}
    assert by_topic["/button"][1].data is True
    assert by_topic["/words"][1].data == "späť"
    assert by_topic["/speed"][0] == "geometry_msgs/msg/TwistStamped"
    assert by_topic["/speed"][1].twist.linear.x == 0.25
    assert sum(topic == "/speed" for topic, _, _ in found) > 50
    assert not any("_hidden" in topic for topic in by_topic)
    assert f"{path}: {len(found)} messages of " in process.log()


def test_named_topics_alone_also_a_hidden_one_for_a_while(test_node: TestNode, spawn: Spawn, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    hidden = test_node.node.create_publisher(String, "_hidden", LATCHED)
    hidden.publish(String(data="yes"))
    process = recording(test_node, spawn, path, "--topic", "speed", "--topic", "/_hidden", "--seconds", "4")
    assert process.wait(30.0) == 0
    assert {topic for topic, _, _ in messages(path)} == {"/speed", "/_hidden"}


def test_a_file_that_exists_is_not_touched_and_without_a_message_there_is_no_file(
    test_node: TestNode, spawn: Spawn, tmp_path: Path
) -> None:
    kept = tmp_path / "kept.mcap"
    kept.write_bytes(b"mine")
    refused = spawn([*CANBASE, "record", "--mcap", str(kept)])
    assert refused.wait(30.0) == 2
    assert "File exists" in refused.log()
    assert kept.read_bytes() == b"mine"
    nowhere = spawn([*CANBASE, "record", "--mcap", str(tmp_path / "no" / "folder.mcap")])
    assert nowhere.wait(30.0) == 2
    assert "No such file or directory" in nowhere.log()
    empty = spawn([*CANBASE, "record", "--mcap", str(tmp_path / "none.mcap"), "--topic", "nothing", "--seconds", "1"])
    assert empty.wait(30.0) == 1
    assert "no message came" in empty.log()
    assert not (tmp_path / "none.mcap").exists()


def test_without_foxgloves_library_it_names_the_package_and_the_command(spawn: Spawn, tmp_path: Path) -> None:
    code = "import sys; sys.modules['mcap'] = None; from canbase_cli.entry import main; main()"
    process = spawn([sys.executable, "-c", code, "record", "--mcap", str(tmp_path / "run.mcap")])
    assert process.wait(30.0) == 2
    assert "pip install 'mcap>=1.2,<2'" in process.log()
    assert not (tmp_path / "run.mcap").exists()


def test_a_file_that_cannot_grow_ends_it_with_the_reason(test_node: TestNode, spawn: Spawn, tmp_path: Path) -> None:
    noise = test_node.repeat(String, "noise", 50.0)
    noise.message = String(data=random.Random(1).randbytes(60_000).hex())
    path = tmp_path / "run.mcap"
    process = spawn(["prlimit", "--fsize=1000000", *CANBASE, "record", "--mcap", str(path)])
    test_node.wait_for(lambda: process.exit_code is not None, 60.0, "its end")
    assert process.exit_code == 1
    assert f"{path} is not complete, after " in process.log()
    assert "File too large" in process.log()
    assert "Traceback" not in process.log()
