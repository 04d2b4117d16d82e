"""The parameters of a simulated drive: saved to a DCF, compared, restored, in virtual time."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import TypeVar

import pytest
from canopen import SdoAbortedError, import_od

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.parameters.boot_values import boot_values
from canbase_commissioning.parameters.comparison import compare
from canbase_commissioning.parameters.dcf_reader import read_parameters
from canbase_commissioning.parameters.dcf_writer import Heading, dcf_text
from canbase_commissioning.parameters.guard import NO_STATUSWORD, why_not_now
from canbase_commissioning.parameters.reading import Progress, objects_to_read, read_all
from canbase_commissioning.parameters.restore_plan import Plan, plan, why_another_product
from canbase_commissioning.parameters.restoring import STAYS_OFF, Restored, restore
from canbase_commissioning.parameters.saved import DriveIdentity, Parameters
from canbase_commissioning.parameters.storing import Order, order
from canbase_commissioning.sdo_session import SdoSession
from canbase_commissioning.session import NodeTask
from canbase_config.eds_file import Eds, read_eds
from canbase_config.eds_file import read_text as read_eds_text
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.boot.steps import Steps
from canbase_driver.cia301.sdo_block import BlockSdoClient
from canbase_driver.cia301.sdo_client import SdoTimeout
from canbase_sim.cia301.dictionary import EDS_FILE, key
from support.session_world import SessionWorld

T = TypeVar("T")
OURS = Path(str(files("canbase_config").joinpath(EDS_FILE)))
HEADING = Heading("drive.dcf", "11-25-2026", "03:58AM", 500_000)
STATUS = (Address(0x6041), Address(0x6841))


@pytest.fixture(scope="module")
def eds() -> Eds:
    return read_eds(OURS)


def ask(world: SessionWorld, steps: Steps[T], node: int = 1) -> NodeTask[T]:
    inquiry = SdoSession({node: steps}, Listener(world.now_s), lambda node_id: BlockSdoClient(node_id, 0.1, 2))
    world.run(inquiry, limit_s=600.0)
    return inquiry.tasks[node]


def read(world: SessionWorld, eds: Eds, node: int = 1) -> Parameters:
    entries = objects_to_read(eds)
    task = ask(world, read_all(node, eds, entries, Progress(len(entries))), node)
    assert task.error is None
    assert task.result is not None
    return task.result


def saved(folder: Path, parameters: Parameters, eds: Eds) -> tuple[Parameters, Eds]:
    text, encoding = read_eds_text(eds.path)
    file = folder / "drive.dcf"
    file.write_bytes(dcf_text(text, eds, parameters, HEADING).encode(encoding))
    return read_parameters(file)


def value(world: SessionWorld, index: int, sub: int = 0, node: int = 1) -> int:
    return world.bench.nodes[node].dictionary.values[key(index, sub)]


def put(world: SessionWorld, index: int, number: int, sub: int = 0, node: int = 1) -> None:
    """By somebody else, before the story begins."""
    world.bench.nodes[node].dictionary.values[key(index, sub)] = number


def carry_out(world: SessionWorld, what: Plan, node: int = 1) -> Restored:
    task = ask(world, restore(what, STATUS, Restored(len(what.orders))), node)
    assert task.result is not None
    return task.result


# Saving


def test_every_object_of_the_eds_is_in_the_file_or_refused_with_its_reason(tmp_path: Path, eds: Eds) -> None:
    world = SessionWorld()
    found = read(world, eds)
    assert found.values.keys() | found.refused.keys() == {Address(*at) for at in eds.objects}
    assert found.refused[Address(0x6841)] == "0602 0000h the object does not exist"  # it has one axis
    again, file = saved(tmp_path, found, eds)
    assert (again.node_id, again.values, again.refused) == (1, found.values, found.refused)
    assert (
        again.identity
        == found.identity
        == DriveIdentity(0, 0xCB402, 0x10000, 1, "canbase simulated drive", "1.0", "1.0")
    )
    assert file.objects.keys() == eds.objects.keys()


def test_other_programs_read_the_file(tmp_path: Path, eds: Eds) -> None:
    world = SessionWorld()
    put(world, 0x6007, -1)
    saved(tmp_path, read(world, eds), eds)
    od = import_od(str(tmp_path / "drive.dcf"))
    assert (od.node_id, od.bitrate) == (1, 500_000)
    found = {at: od.get_variable(*at) for at in ((0x6007, 0), (0x1800, 1), (0x6505, 0))}
    assert [getattr(each, "value", None) for each in found.values()] == [
        -1, 0x40000181, "https://example.org/canbase/drives/simulated",
    ]  # fmt: skip


def test_what_no_text_holds_is_kept_byte_by_byte(tmp_path: Path, eds: Eds) -> None:
    odd = {Address(0x6505): b"two\nlines;\0\0", Address(0x1017): b"\x01\x02\x03\x04", Address(0x1008): b" \xe4\x80"}
    again, _ = saved(tmp_path, Parameters(3, odd), eds)
    assert again.values == odd


def test_long_objects_come_by_block_transfer() -> None:
    world = SessionWorld()
    clients: list[BlockSdoClient] = []

    def client(node_id: int) -> BlockSdoClient:
        clients.append(BlockSdoClient(node_id, 0.1, 2))
        return clients[-1]

    eds = read_eds(OURS)
    entries = [entry for entry in objects_to_read(eds) if entry.index == 0x6505]
    inquiry = SdoSession({1: read_all(1, eds, entries, Progress(1))}, Listener(world.now_s), client)
    world.run(inquiry)
    assert clients[0].block_transfers == 1


def test_a_drive_that_stops_answering_ends_the_reading(eds: Eds) -> None:
    world = SessionWorld()
    world.bench.nodes[1].line.cut = True
    entries = objects_to_read(eds)
    task = ask(world, read_all(1, eds, entries, Progress(len(entries))))
    assert isinstance(task.error, SdoTimeout)


# Comparing


def test_two_drives_of_one_kind_differ_by_what_was_set_and_not_by_their_node_ids(eds: Eds) -> None:
    world = SessionWorld()
    put(world, 0x6083, 777, node=2)
    found = compare(read(world, eds, 1), read(world, eds, 2), eds)
    assert [str(each) for each in found.differences] == ["6083h:0 Axis 0 profile acceleration: 0x000003E8 → 0x00000309"]
    assert (found.product, found.firmware) == ("", "")
    assert found.compared > 100


def test_measurements_and_states_are_compared_on_request_alone(eds: Eds) -> None:
    world = SessionWorld()
    first = read(world, eds)
    second = Parameters(1, {**first.values, Address(0x6064): b"\1\2\3\4"}, identity=first.identity)
    assert compare(first, second, eds).alike
    assert [each.at for each in compare(first, second, eds, everything=True).differences] == [Address(0x6064)]


def test_an_eds_is_compared_by_its_defaults(eds: Eds) -> None:
    world = SessionWorld()
    defaults, _ = read_parameters(OURS)
    assert defaults.node_id == 0
    assert [each for each in compare(defaults, read(world, eds), eds).differences if each.second is not None] == []


def test_what_the_boot_of_the_robot_would_set(tmp_path: Path, eds: Eds) -> None:
    """The boot on paper and the boot of the drive end with the same values."""
    world = SessionWorld()
    drives = tuple(drive for drive in world.robot.drives if drive.node_id == 1)
    on_paper = boot_values(read(world, eds), eds, drives, world.robot)
    assert on_paper.problem == ""
    shown = {each.at: each for each in on_paper.written}
    assert (shown[Address(0x6060)].first, shown[Address(0x6060)].second) == ("0", "3")
    assert Address(0x6040) not in shown
    boot = NodeBoot(1, drives, world.robot)
    world.run(boot)
    assert boot.error is None
    differences = compare(on_paper.after, read(world, eds), eds).differences
    assert [str(each) for each in differences] == []


def test_a_boot_that_would_fail_says_why(eds: Eds) -> None:
    world = SessionWorld()
    found = read(world, eds)
    less = {at: data for at, data in found.values.items() if at.index not in (0x1403, 0x1400, 0x1401, 0x1402)}
    drives = tuple(drive for drive in world.robot.drives if drive.node_id == 1)
    assert "it has no RPDO1" in boot_values(Parameters(1, less), eds, drives, world.robot).problem


# Restoring


def test_only_what_differs_is_written_and_everything_is_read_back(tmp_path: Path, eds: Eds) -> None:
    world = SessionWorld()
    put(world, 0x6083, 777)
    world.bench.nodes[1].dictionary.texts[key(0x6505)] = b"where its manual is"
    kept, file = saved(tmp_path, read(world, eds), eds)
    put(world, 0x6083, 5)
    put(world, 0x1017, 100)
    world.bench.nodes[1].dictionary.texts.clear()
    what = plan(kept, read(world, eds), file)
    assert [change.at for change in what.changes] == [Address(0x6083), Address(0x6505), Address(0x1017)]
    done = carry_out(world, what)
    assert (len(done.written), done.failed, done.stopped) == (3, [], "")
    assert (value(world, 0x6083), value(world, 0x1017)) == (777, 0)
    assert plan(kept, read(world, eds), file).orders == ()


def test_a_pdo_is_off_while_it_is_mapped_and_on_again_as_it_was(tmp_path: Path, eds: Eds) -> None:
    world = SessionWorld()
    kept, file = saved(tmp_path, read(world, eds), eds)
    for index, sub, number in ((0x1A00, 0, 2), (0x1A00, 2, 0x606C0020), (0x1A00, 1, 0x60410010), (0x1800, 2, 1)):
        put(world, index, number, sub)
    what = plan(kept, read(world, eds), file)
    done = carry_out(world, what)
    assert (done.failed, done.stopped) == ([], "")
    orders = [(str(each.at), each.data.hex()) for each in what.orders]
    assert orders[0] == ("1800h:1", "810100c0")
    assert orders[1] == ("1A00h:0", "00")
    assert orders[-1] == ("1800h:1", "81010040")
    assert value(world, 0x1A00) == 1
    assert value(world, 0x1800, 2) == 255
    assert [(change.at, why) for change, why in what.left] == [(Address(0x1A00, 2), "beyond the 1 mapped objects")]


def test_a_pdo_of_which_a_part_is_refused_stays_off(tmp_path: Path, eds: Eds) -> None:
    world = SessionWorld()
    found = read(world, eds)
    wrong = {**found.values, Address(0x1A00, 1): (0x10080020).to_bytes(4, "little")}  # a text cannot be mapped
    what = plan(Parameters(1, wrong, identity=found.identity), found, eds)
    done = carry_out(world, what)
    assert [str(change.at) for change, _ in done.failed] == ["1A00h:1"]
    assert value(world, 0x1800, 1) >> 31 == 1
    assert STAYS_OFF not in [why for _, why in done.failed]  # its COB-ID was no change


def test_commands_and_states_are_never_written(eds: Eds) -> None:
    world = SessionWorld()
    found = read(world, eds)
    moving = {Address(0x60FF): b"\x10\0\0\0", Address(0x6040): b"\x0f\0", Address(0x6041): b"\0\0"}
    moving |= {Address(0x6060): b"\x03", Address(0x1010, 1): b"save", Address(0x1005): b"\x80\0\0\x40"}
    what = plan(Parameters(1, {**found.values, **moving}), found, eds)
    assert what.orders == ()
    assert {str(change.at): why for change, why in what.left} == {
        "1005h:0": "the drive would send SYNC itself, beside canbase's driver",
        "1010h:1": "stores parameters: canbase bus params store",
        "6040h:0": "the controlword",
        "6060h:0": "the mode, which the boot sets",
        "60FFh:0": "a target",
    }


def test_a_setting_that_another_one_keeps_out_is_tried_again(eds: Eds) -> None:
    world = SessionWorld()
    dictionary = world.bench.nodes[1].dictionary
    found = read(world, eds)
    put(world, 0x6083, 5)
    put(world, 0x6084, 5)

    def check(sub: int, number: int) -> None:
        if value(world, 0x6084) == 5:
            raise SdoAbortedError(0x0609_0031)

    dictionary.guard(0x6083, check)
    done = carry_out(world, plan(found, read(world, eds), eds))
    assert done.failed == []
    assert [str(change.at) for change in done.written] == ["6084h:0", "6083h:0"]


def test_nothing_is_written_while_a_motor_has_power_or_a_wheel_turns(eds: Eds) -> None:
    world = SessionWorld()
    found = read(world, eds)
    put(world, 0x6085, 5)
    what = plan(found, read(world, eds), eds)
    for word in (6, 7, 15):
        dictionary = world.bench.nodes[1].dictionary
        dictionary.set_data(0x6060, 0, b"\x03")
        dictionary.set_data(0x6040, 0, bytes((word, 0)))
        world.wait(0.05)
    done = carry_out(world, what)
    assert done.stopped == "6041h:0 shows operation enabled: a motor has power"
    assert (done.written, value(world, 0x6085)) == ([], 5)
    dictionary.set_data(0x60FF, 0, (3000).to_bytes(4, "little"))
    world.wait(1.0)
    dictionary.set_data(0x6040, 0, b"\0\0")  # power off: it coasts
    done = carry_out(world, what)
    assert "a wheel turns" in done.stopped
    assert value(world, 0x6085) == 5


def test_a_node_whose_power_is_unknown_is_left_alone_unless_a_person_knows(eds: Eds) -> None:
    world = SessionWorld()
    nowhere = (Address(0x5041),)
    assert ask(world, why_not_now(nowhere, without_statusword=False)).result == NO_STATUSWORD
    assert ask(world, why_not_now(nowhere, without_statusword=True)).result == ""


def test_parameters_of_another_product_are_not_for_this_drive(eds: Eds) -> None:
    world = SessionWorld()
    found = read(world, eds)
    other = Parameters(1, found.values, identity=DriveIdentity(0xFB, 0x65520000), source="epos.dcf")
    assert "FB:65520000" in why_another_product(other, found)
    assert "does not show of which product" in why_another_product(Parameters(1, {}), found)
    assert why_another_product(found, found) == ""


def test_parameters_move_to_another_node_id_with_their_cob_ids(eds: Eds) -> None:
    world = SessionWorld()
    moved = read(world, eds).for_node(2, eds)
    assert int.from_bytes(moved.values[Address(0x1400, 1)], "little") == 0x202
    assert int.from_bytes(moved.values[Address(0x1014)], "little") == 0x82


# Storing


def test_store_and_defaults_give_their_signatures_and_a_drive_without_them_is_named(eds: Eds) -> None:
    world = SessionWorld()
    put(world, 0x6083, 777)
    stored = ask(world, order(Order.STORE, "all", STATUS, without_statusword=False)).result
    assert stored is not None
    assert stored.refused == ""
    world.bench.nodes[1].reset_node(world.now_s)
    world.wait(0.5)
    assert value(world, 0x6083) == 777
    done = ask(world, order(Order.DEFAULTS, "all", STATUS, without_statusword=False)).result
    assert done is not None
    assert done.refused == ""
    refused = ask(world, order(Order.STORE, "application", STATUS, without_statusword=False)).result
    assert refused is not None
    assert "1010h:3: 0609 0011h" in refused.refused
