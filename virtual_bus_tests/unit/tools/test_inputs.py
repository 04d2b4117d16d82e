"""inputs.yaml against the code: what a decision reads from outside has a row with age, sender and meaning."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from ruamel.yaml import YAML

import canbase_hazards
from canbase_campaign.received_faults import TOPICS
from canbase_campaign.world import World
from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.schema import Schema
from canbase_watchdog import frames
from canbase_watchdog.observer import Observer

ROOT = Path(__file__).parents[3]
PROCESSES = ("driver", "velocity_mux", "watchdog", "action_server", "runtime")
TOPIC_AT = {"create_subscription": 1, "_listen": 1, "listen_closely": 2}
"""Where a call has its topic."""
READS = {"recv", "recvfrom", "recvmsg", "recv_into", "read_text", "read_bytes", "take_message", "readlink",
         "getsockopt", "count_services", "count_publishers", "get_publishers_info_by_topic"}  # fmt: skip
OS_READS = ("os.read", "os.pread", "os.readv")
DISPATCHES = {"routes", "self._routes", "table"}
"""What a deciding process keeps its handlers of frames in, by identifier."""
TABLE = YAML(typ="safe").load(Path(canbase_hazards.__file__).parent / "inputs.yaml")


def calls(tree: ast.AST) -> Iterator[tuple[str, ast.Call]]:
    """Every call by its name. A function with a parameter `topic` subscribes for others: their calls count."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef) and "topic" in (argument.arg for argument in node.args.args):
            continue
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            yield name, node
        yield from calls(node)


def identifiers(tree: ast.AST) -> Iterator[str]:
    """Of the frames that the code takes: keys of a table of handlers, and what a `cob_id` is compared with."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Subscript):
            if ast.unparse(node.targets[0].value) in DISPATCHES:
                yield ast.unparse(node.targets[0].slice)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.value, ast.Dict):
            if ast.unparse(node.target) in DISPATCHES:
                yield from (ast.unparse(key) for key in node.value.keys if key is not None)
        elif isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Eq | ast.In):
            if ast.unparse(node.left) != "cob_id":
                continue
            values = node.comparators[0]
            yield from map(ast.unparse, values.elts if isinstance(values, ast.Tuple) else [values])


def in_code(source: str, path: str) -> tuple[set[str], set[str], set[str], set[str]]:
    """The subscriptions, the services, the file if it reads a socket, a file or the ROS graph, and the frames."""
    topics, services, reads = set(), set(), set[str]()
    tree = ast.parse(source)
    functions = {ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    if functions & set(OS_READS) or READS & {function.rpartition(".")[2] for function in functions}:
        reads = {path} - {"runtime/canbase_runtime/message_reader.py"}
    frames = {f"{path} {text}" for text in identifiers(tree)} if path.startswith(("driver", "watchdog")) else set()
    for name, call in calls(tree):
        if name in TOPIC_AT and len(call.args) > TOPIC_AT[name]:
            topics.add(f"{path} {ast.unparse(call.args[TOPIC_AT[name]])}")
        elif name == "create_service":
            services.add(f"{path} {ast.unparse(call.args[1])}")
    return topics, services, reads, frames


def everywhere() -> tuple[set[str], set[str], set[str], set[str]]:
    files = [file for folder in PROCESSES for file in sorted((ROOT / folder).rglob("*.py"))]
    assert len(files) > 150
    parts = [in_code(file.read_text("utf-8"), str(file.relative_to(ROOT))) for file in files]
    return tuple(set().union(*kind) for kind in zip(*parts, strict=True))  # type: ignore[return-value]


@pytest.mark.parametrize("place", range(4))
def test_the_code_reads_exactly_what_the_table_has(place: int) -> None:
    key = ("topics", "services", "sockets_and_files", "frames")[place]
    rows = [row["where"] for row in TABLE[key]]
    assert len(rows) == len(set(rows))
    assert set(rows) == everywhere()[place]


def test_a_new_subscription_without_a_row_is_found() -> None:
    source = "class A:\n    def __init__(self, node):\n        node.create_subscription(Bool, 'new', self.on_new, 1)\n"
    assert in_code(source, "driver/a.py")[0] == {"driver/a.py 'new'"}


@pytest.mark.parametrize(
    "line",
    ["self._routes[NEW] = self.on_new", "table[NEW] = (on_new, None)", "table: dict[int, Handler] = {NEW: on_new}",
     "found = cob_id == NEW", "found = cob_id in (NEW,)"],
)  # fmt: skip
def test_a_new_frame_without_a_row_is_found(line: str) -> None:
    assert in_code(line, "watchdog/a.py")[3] == {"watchdog/a.py NEW"}


@pytest.mark.parametrize("line", ["path.read_text()", "os.read(1, 2)", "link.recvmsg(1)", "node.count_publishers('a')"])
def test_a_new_file_socket_or_look_into_the_graph_without_a_row_is_found(line: str) -> None:
    assert in_code(line, "watchdog/a.py")[2] == {"watchdog/a.py"}


def test_the_rows_of_the_watchdog_are_all_frames_that_it_takes() -> None:
    """Not by its code but by its table at run time: for each identifier there is a row."""
    config = watchdog_config(load_robot(sample("bench")).robot)
    routes = set(Observer(config, 0.0)._routes)
    per_drive = {base + drive.node_id for drive in config.drives for base in
                 (frames.HEARTBEAT, frames.SDO_ANSWER, frames.SDO_REQUEST, frames.QUICK_STOP_RPDO,
                  frames.STATUS_TPDO[0], frames.VELOCITY_TPDO[0], frames.SETPOINT_RPDO[0])}  # fmt: skip
    shared = {frames.NMT, frames.SYNC, frames.DRIVER_HEARTBEAT, frames.WATCHDOG_HEARTBEAT, frames.LSS_REQUEST}
    assert routes == per_drive | shared
    assert len(shared) + 7 == sum("observer.py" in row["where"] for row in TABLE["frames"])


def test_each_key_that_is_named_as_an_age_exists() -> None:
    keys = {f"{path}.{key}" for path, keys in Schema(Robot).sections for key in keys}
    text = " ".join(str(row["age"]) for rows in TABLE.values() for row in rows)
    named = set(re.findall(r"\b(?:timeouts|rates|safety\.estop|action|watchdog)\.[a-z_]+_(?:s|hz)\b", text))
    assert len(named) >= 8
    assert named <= keys


@pytest.mark.parametrize("key", TABLE)
def test_each_row_has_an_age_and_a_meaning_when_it_is_missing(key: str) -> None:
    wanted = {"where", "age", "missing"} | {"topics": {"topic", "type", "sender"}, "services": set()}.get(
        key, {"what", "sender"}
    )
    for row in TABLE[key]:
        assert set(row) == wanted, row["where"]
        assert all(str(row[name]).strip() for name in wanted - {"topic"}), row["where"]


def test_the_campaign_has_every_topic_that_a_decision_reads() -> None:
    """But `cmd_vel_web`, which a person holds as the joystick's: nobody of the campaign publishes on it."""
    named = {topic for row in TABLE["topics"] for topic in row["topic"].split()}
    assert named == {*TOPICS, "cmd_vel_web"} == World().topics.subscribed - {"publishers"}


def test_what_is_received_is_read_through_its_age_alone() -> None:
    """`Received._value` is private; ruff's SLF001 is on for all that runs on a robot, without exceptions for it."""
    pattern = re.compile(r"\._value\b")
    inside = {
        str(file.relative_to(ROOT))
        for folder in PROCESSES
        for file in (ROOT / folder).rglob("*.py")
        if "Received" in (text := file.read_text("utf-8")) and pattern.search(text)
    }
    assert inside == {"runtime/canbase_runtime/received.py"}


def test_what_has_an_age_limit_has_the_type_that_needs_one() -> None:
    """Without: what decides nothing, what stays until the next message, requests (receive_time.py)."""
    aged = [row for row in TABLE["topics"] if not row["age"].startswith(("none", "not while"))]
    assert {row["type"] for row in aged} == {"Received"}
    assert len(aged) >= 11
