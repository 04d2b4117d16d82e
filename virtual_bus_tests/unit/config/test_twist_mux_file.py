"""Parameter files of twist_mux, read as they are; what is wrong in them names file, line and key."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_config.effective import effective
from canbase_config.errors import ConfigError
from canbase_config.load import load_robot
from canbase_config.mux import NEUTRAL_AFTER_S, Mux, MuxLock, MuxSource
from canbase_velocity.twist import ZERO, Twist
from support.mux_world import rested
from support.robot_files import LAST_LINE, write

END = LAST_LINE + 1

TOPICS = """\
# as it comes with twist_mux, but for the tablet
twist_mux:
  ros__parameters:
    use_stamped: false
    topics:
      navigation:
        topic   : nav_vel
        timeout : 0.5
        priority: 10
      joystick:
        topic   : joy_vel
        timeout : 0.5
        priority: 100
"""
LOCKS = """\
twist_mux:
  ros__parameters:
    locks:
      pause:
        topic   : pause_navigation
        timeout : 0.0
        priority: 100
      e_stop:
        topic   : platform/emergency_stop
        timeout : 0.6
        priority: 255
"""
DOTTED = """\
teleop:
  ros__parameters: {scale: 0.4}
a200_0000:
  twist_mux:
    ros__parameters:
      use_sim_time: False
      topics.joy.topic: joy_teleop/cmd_vel
      topics.joy.timeout: 0.5
      topics.joy.priority: 10
      topics.external.topic: cmd_vel_external
      topics.external.timeout: 1
      topics.external.priority: 0
      locks.e_stop.topic: /platform/emergency_stop
      locks.e_stop.timeout: 0.0
      locks.e_stop.priority: 255
"""
ORIGINAL = """\
twist_mux:
  ros__parameters:
    topics:
      navigation: {topic: nav_vel, timeout: 0.5, priority: 10}
      joystick: {topic: joy_vel, timeout: 0.5, priority: 100}
      keyboard: {topic: key_vel, timeout: 0.5, priority: 90}
      tablet: {topic: tab_vel, timeout: 0.5, priority: 100}
"""
"""The topics of twist_mux 4.3.0's own sample: two with priority 100."""


def mux_of(folder: Path, *files: str, also: str = "") -> Mux:
    """The mux of a robot.yaml that names these files; `also`: further keys below mux."""
    names = []
    for number, text in enumerate(files):
        (folder / f"mux{number}.yaml").write_text(text, encoding="utf-8")
        names.append(f"mux{number}.yaml")
    robot = write(folder, {END: f"mux:\n  twist_mux: [{', '.join(names)}]\n{also}"})
    return load_robot(robot).robot.mux


def refusal(folder: Path, *files: str, also: str = "") -> str:
    with pytest.raises(ConfigError) as caught:
        mux_of(folder, *files, also=also)
    return str(caught.value).replace(f"{folder}/", "")


def test_the_two_files_of_twist_mux_become_sources_and_locks(tmp_path: Path) -> None:
    mux = mux_of(tmp_path, TOPICS, LOCKS)
    assert mux.sources == {
        "navigation": MuxSource(
            topic="nav_vel", priority=10, timeout_s=0.5, stamped=False, neutral_after_s=NEUTRAL_AFTER_S
        ),
        "joystick": MuxSource(topic="joy_vel", priority=100, timeout_s=0.5, stamped=False),
    }
    assert mux.locks == {
        "pause": MuxLock(topic="pause_navigation", priority=100, required=False),
        "e_stop": MuxLock(topic="platform/emergency_stop", priority=255, required=True, timeout_s=0.6),
    }


def test_dotted_keys_a_namespace_and_the_parameters_of_other_nodes(tmp_path: Path) -> None:
    mux = mux_of(tmp_path, DOTTED)
    assert mux.sources == {
        "joy": MuxSource(topic="joy_teleop/cmd_vel", priority=10, timeout_s=0.5),
        "external": MuxSource(topic="cmd_vel_external", priority=0, timeout_s=1.0),
    }
    assert mux.locks == {"e_stop": MuxLock(topic="/platform/emergency_stop", priority=255, required=False)}


def test_a_later_file_has_the_last_word_on_single_values_as_ros_has_it(tmp_path: Path) -> None:
    override = "/**:\n  ros__parameters:\n    topics: {joystick: {priority: 7}}\n    use_stamped: true\n"
    mux = mux_of(tmp_path, TOPICS, override)
    assert (mux.sources["joystick"].priority, mux.sources["joystick"].topic) == (7, "joy_vel")
    assert mux.sources["navigation"].stamped is True


STAMPED_ALONE = "NODE:\n  ros__parameters: {use_stamped: VALUE}\n"


@pytest.mark.parametrize(
    ("files", "stamped"),
    [
        ((f"{STAMPED_ALONE.replace('NODE', '/**').replace('VALUE', 'false')}{ORIGINAL}",), False),
        ((ORIGINAL, STAMPED_ALONE.replace("NODE", "twist_mux").replace("VALUE", "false")), False),
        ((ORIGINAL, STAMPED_ALONE.replace("NODE", "/*").replace("VALUE", "false")), False),
        ((TOPICS, STAMPED_ALONE.replace("NODE", "/twist_mux").replace("VALUE", "true")), True),
        (("/**: {ros__parameters: {use_stamped: true}}\n" + TOPICS,), False),
        (("teleop: {ros__parameters: {use_stamped: false}}\n" + ORIGINAL,), True),
        (("/**:\n" + ORIGINAL.partition("\n")[2], STAMPED_ALONE.replace("NODE", "twist_mux").replace("VALUE", "false")),
         False),
    ],
)  # fmt: skip
def test_use_stamped_is_read_from_each_node_name_that_means_this_node(
    tmp_path: Path, files: tuple[str, ...], stamped: bool
) -> None:
    sources = mux_of(tmp_path, *files, also="  equal_priorities: by_name\n").sources
    assert {source.stamped for source in sources.values()} == {stamped}


@pytest.mark.parametrize("node", ["'**+('", "/***", "/**/joy", "teleop"])
def test_a_file_of_no_such_node_is_refused(tmp_path: Path, node: str) -> None:
    alone = STAMPED_ALONE.replace("NODE", node).replace("VALUE", "true")
    assert "mux1.yaml: has no topics and no locks" in refusal(tmp_path, TOPICS, alone)


def test_a_key_that_is_not_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "mux.yaml").write_text(TOPICS + "        stamped: true\n        short_desc: pad\n", encoding="utf-8")
    loaded = load_robot(write(tmp_path, {END: "mux: {twist_mux: [mux.yaml]}"}))
    told = [str(each).replace(f"{tmp_path}/", "") for each in loaded.warnings if "is not read" in str(each)]
    assert told == [
        "mux.yaml:14: topics.joystick.stamped: is not read, as in twist_mux; use_stamped beside topics holds for all "
        "of them",
        "mux.yaml:15: topics.joystick.short_desc: is not read, as in twist_mux",
    ]


def test_a_topic_that_is_an_output_here_is_renamed_by_a_key(tmp_path: Path) -> None:
    text = TOPICS.replace("joy_vel", "/cmd_vel")
    assert "mux.twist_mux_rename renames" in refusal(tmp_path, text)
    mux = mux_of(tmp_path, text, also="  twist_mux_rename: {cmd_vel: cmd_vel_external}\n")
    assert [source.topic for source in mux.sources.values()] == ["nav_vel", "cmd_vel_external"]
    (tmp_path / "effective.yaml").write_text(effective(load_robot(tmp_path / "robot.yaml")), encoding="utf-8")
    assert load_robot(tmp_path / "effective.yaml").robot.mux == mux
    unknown = refusal(tmp_path, text, also="  twist_mux_rename: {cmd_vel: external, key_vel: keys}\n")
    assert "robot.yaml:38: mux.twist_mux_rename: no topic of these files is key_vel" in unknown
    assert "mux.twist_mux_rename: got 3" in refusal(tmp_path, TOPICS, also="  twist_mux_rename: 3\n")


@pytest.mark.parametrize("head", ["", "twist_mux:\n  ros__parameters:\n"])
def test_a_list_of_ros_1_is_named(tmp_path: Path, head: str) -> None:
    indent = "    " if head else ""
    text = f"{head}{indent}topics:\n{indent}- {{name: joy, topic: joy_vel, timeout: 0.5, priority: 100}}\n"
    assert "topics is a list, as in files of ROS 1" in refusal(tmp_path, text)


def test_sources_of_robot_yaml_come_to_those_of_the_files(tmp_path: Path) -> None:
    own = "  sources:\n    action: {topic: cmd_vel_action, priority: 40, timeout_s: 0.3}\n"
    assert list(mux_of(tmp_path, TOPICS, also=own).sources) == ["action", "navigation", "joystick"]


def test_the_effective_configuration_spells_them_out_and_loads_without_the_files(tmp_path: Path) -> None:
    mux = mux_of(tmp_path, TOPICS, LOCKS)
    (tmp_path / "effective.yaml").write_text(effective(load_robot(tmp_path / "robot.yaml")), encoding="utf-8")
    (tmp_path / "mux0.yaml").unlink()
    assert load_robot(tmp_path / "effective.yaml").robot.mux == mux


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("priority: 100", "priority: 10", "mux0.yaml:13: topics.joystick.priority: sources navigation and joystick have"
         " the same priority; each needs its own, or set equal_priorities: by_name"),
        ("priority: 100", "priority: 256", "mux0.yaml:13: topics.joystick.priority: got 256, expected a whole number"
         " >= 0 and <= 255 (the highest fresh source is active; each value once, see"),
        ("priority: 100", "priorty: 100", "mux0.yaml:11: topics.joystick.priority: missing, expected a whole number"),
        ("timeout : 0.5\n        priority: 10\n", "timeout : 0.0\n        priority: 10\n", "mux0.yaml:8:"
         " topics.navigation.timeout: got 0: the last command of this topic would be valid for ever\n    give it a"
         " timeout, or set mux.twist_mux_timeout_s: 0.5 in robot.yaml for all topics with timeout 0"),
        ("timeout : 0.5\n        priority: 100", "timeout : fast\n        priority: 100", 'mux0.yaml:12:'
         ' topics.joystick.timeout: got "fast", expected a number'),
        ("joy_vel", "cmd_vel", "mux0.yaml:11: topics.joystick.topic: cmd_vel is an output of this robot"),
        ("joy_vel", "/cmd_vel_mux", "mux0.yaml:11: topics.joystick.topic: /cmd_vel_mux is an output of this robot"),
        ("use_stamped: false", "use_stamped: 1", "mux0.yaml:4: use_stamped: got 1, expected true or false"),
        ("topics:", "topic:", "mux0.yaml: has no topics and no locks of twist_mux"),
        ("ros__parameters:", "parameters:", "mux0.yaml: has no topics and no locks of twist_mux"),
        ("    topics:\n", "    topics: 3\n    other:\n", "mux0.yaml:5: topics: topics must hold entries with topic,"),
        ("      joystick:\n", "      joy-stick:\n", 'mux0.yaml:11: topics.joy-stick: got the name "joy-stick"'),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_the_files_own_line_and_key(tmp_path: Path, old: str, new: str, text: str) -> None:
    assert old in TOPICS
    assert text in refusal(tmp_path, TOPICS.replace(old, new))


def test_equal_priorities_are_accepted_by_a_key_and_the_first_by_name_is_active(tmp_path: Path) -> None:
    assert "sources joystick and tablet have the same priority" in refusal(tmp_path, ORIGINAL)
    reordered = ORIGINAL.replace("joystick", "zjoystick")
    for text, first, second in ((ORIGINAL, "joystick", "tablet"), (reordered, "tablet", "zjoystick")):
        mux = rested(mux_of(tmp_path, text, also="  equal_priorities: by_name\n").sources)
        mux.accept_command(second, Twist(0.2, 0.0), 1.0)
        assert mux.decide(1.0).active == second
        mux.accept_command(first, Twist(0.1, 0.0), 1.0)
        assert (mux.decide(1.0).active, mux.decide(1.0).twist.linear_mps) == (first, 0.1)
        mux.accept_command(second, Twist(0.2, 0.0), 1.6)  # the first one is silent for more than its 0.5 s
        assert mux.decide(1.6).active == second


def test_a_topic_without_timeout_gets_that_of_a_key_and_moves_nothing_after_it(tmp_path: Path) -> None:
    endless = ORIGINAL.replace("tab_vel, timeout: 0.5, priority: 100", "tab_vel, timeout: 0.0, priority: 95")
    assert "mux0.yaml:7: topics.tablet.timeout: got 0" in refusal(tmp_path, endless)
    sources = mux_of(tmp_path, endless, also="  twist_mux_timeout_s: 0.4\n").sources
    assert {name: source.timeout_s for name, source in sources.items()} == {
        "navigation": 0.5, "joystick": 0.5, "keyboard": 0.5, "tablet": 0.4,
    }  # fmt: skip
    mux = rested(sources)
    mux.accept_command("tablet", Twist(0.2, 0.0), 1.0)  # once, as a page that has only buttons does
    assert mux.decide(1.4).twist.linear_mps == 0.2
    assert (mux.decide(1.41).active, mux.decide(1.41).twist) == (None, ZERO)
    mux.accept_command("navigation", Twist(0.1, 0.0), 1.5)
    assert mux.decide(1.5).active == "navigation"  # a topic that is silent blocks nobody


@pytest.mark.parametrize("timeout_s", ["0", "0.04", "2.1", ".inf", "true"])
def test_no_topic_gets_a_timeout_that_is_none(tmp_path: Path, timeout_s: str) -> None:
    endless = ORIGINAL.replace("tab_vel, timeout: 0.5, priority: 100", "tab_vel, timeout: 0, priority: 95")
    assert "mux.twist_mux_timeout_s: got" in refusal(tmp_path, endless, also=f"  twist_mux_timeout_s: {timeout_s}\n")


def test_the_effective_configuration_of_such_a_file_loads_without_it(tmp_path: Path) -> None:
    endless = ORIGINAL.replace("tab_vel, timeout: 0.5", "tab_vel, timeout: 0.0")
    mux = mux_of(tmp_path, endless, also="  twist_mux_timeout_s: 0.4\n  equal_priorities: by_name\n")
    (tmp_path / "effective.yaml").write_text(effective(load_robot(tmp_path / "robot.yaml")), encoding="utf-8")
    (tmp_path / "mux0.yaml").unlink()
    assert load_robot(tmp_path / "effective.yaml").robot.mux == mux


def test_a_topic_that_is_written_with_and_without_a_slash_is_one_topic(tmp_path: Path) -> None:
    text = refusal(tmp_path, TOPICS.replace("joy_vel", "/nav_vel"))
    assert "mux0.yaml:11: topics.joystick.topic: sources navigation and joystick have the same topic" in text
    text = refusal(tmp_path, TOPICS, LOCKS.replace("pause_navigation", "/nav_vel"))
    assert "mux1.yaml:5: locks.pause.topic: /nav_vel is the topic of a source too" in text


def test_a_lock_that_can_hold_nobody_back_is_refused(tmp_path: Path) -> None:
    text = refusal(tmp_path, TOPICS, LOCKS.replace("priority: 100", "priority: 10"))
    assert "mux1.yaml:7: locks.pause.priority: 10 blocks no source: the lowest source has 10" in text


def test_a_lock_on_the_topic_of_a_source_is_refused(tmp_path: Path) -> None:
    text = refusal(tmp_path, TOPICS, LOCKS.replace("pause_navigation", "nav_vel"))
    assert "mux1.yaml:5: locks.pause.topic: nav_vel is the topic of a source too" in text


def test_a_lock_without_timeout_is_refused(tmp_path: Path) -> None:
    assert "mux1.yaml:9: locks.e_stop.timeout: got nothing" in refusal(
        tmp_path, TOPICS, LOCKS.replace("timeout : 0.6", "")
    )


@pytest.mark.parametrize("node", ["other_mux", "/**/other", "/*/*", "twist*"])
def test_topics_or_locks_of_a_node_that_is_not_this_one_are_refused(tmp_path: Path, node: str) -> None:
    """A lock that nobody reads stops nothing."""
    text = refusal(tmp_path, TOPICS, LOCKS.replace("twist_mux:", f"{node}:"))
    assert f"of {node if node[0] == '/' else '/' + node}, which is not the node /twist_mux: keep those of one" in text


def test_a_name_in_both_files_is_refused(tmp_path: Path) -> None:
    own = "  sources:\n    joystick: {topic: cmd_vel_joy, priority: 90, timeout_s: 0.3}\n"
    text = refusal(tmp_path, TOPICS, also=own)
    assert "mux0.yaml:11: topics.joystick.topic: mux.sources.joystick is given in robot.yaml too" in text


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    robot = write(tmp_path, {END: "mux: {twist_mux: [twist_mux_topics.yaml]}"})
    with pytest.raises(ConfigError, match=r"twist_mux_topics\.yaml: no such file"):
        load_robot(robot)


def test_what_is_no_list_of_files_is_told_by_the_model(tmp_path: Path) -> None:
    robot = write(tmp_path, {END: "mux: {twist_mux: topics.yaml}"})
    with pytest.raises(ConfigError, match=r"robot\.yaml:36: mux\.twist_mux: got \"topics\.yaml\", expected a list"):
        load_robot(robot)
