"""Folders that another user could change are refused, and files are replaced in one way."""

from __future__ import annotations

import ast
import contextlib
import errno
import os
import socket
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import pytest

from canbase_base import own_folder
from canbase_base.latch_file import LatchFile, LatchKeeper, create_first
from canbase_base.latch_record import Defect, Record
from canbase_deploy.actions import Link, Remove, WriteFile
from canbase_deploy.execute import ExecuteError, Executor, first_records
from canbase_watchdog.lease_socket import LeaseSocket, LeaseSocketError

STRANGER = 12345


def test_folders_are_made_with_the_mode_and_a_name_that_is_missing_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b"
    with pytest.raises(FileNotFoundError):
        own_folder.open_own_folder(path)
    os.close(own_folder.open_own_folder(path, 0o700))
    assert path.stat().st_mode & 0o777 == path.parent.stat().st_mode & 0o777 == 0o700
    (tmp_path / "file").touch()
    before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(NotADirectoryError) as raised:
        own_folder.open_own_folder(tmp_path / "file" / "b", 0o700)
    assert raised.value.filename == str(tmp_path / "file")
    os.close(own_folder.open_own_folder(path))
    assert len(os.listdir("/proc/self/fd")) == before
    os.close(own_folder.open_own_folder(Path("/")))


@pytest.mark.parametrize(
    ("uid_map", "outside"),
    [
        ("         0          0 4294967295\n", set()),  # no namespace
        ("         0       1000          1\n", {65534}),  # unshare --map-root-user
        ("         0       1000          1\n         1     100000      65533\n", {65534}),
        ("         0       1000          1\n         1     100000      65534\n", set()),
        ("     65534       1000          1\n", set()),
        ("     65535       1000          1\n", {65534}),
    ],
)
def test_users_outside_of_a_user_namespace_have_one_number(uid_map: str, outside: set[int]) -> None:
    assert own_folder.users_outside(uid_map, "65534\n") == outside


@pytest.mark.parametrize(("uid_map", "fine"), [("0 1000 1", True), ("0 0 4294967295", False), ("", True), ("x", False)])
def test_folders_of_users_outside_are_those_of_the_system(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, uid_map: str, *, fine: bool
) -> None:
    (tmp_path / "uid_map").write_text(uid_map)
    (tmp_path / "overflowuid").write_text("65534")
    monkeypatch.setattr(own_folder, "UID_MAP", tmp_path / "uid_map")
    monkeypatch.setattr(own_folder, "OVERFLOW_UID", tmp_path / "overflowuid")
    found = os.stat_result((0o40755, 0, 0, 2, 65534, 65534, 0, 0, 0, 0))
    with contextlib.nullcontext() if fine else pytest.raises(own_folder.FolderError, match="belongs to user 65534"):
        own_folder._judge(found, Path("/"), last=False)


@pytest.mark.parametrize("deep", [0, 1, 2])
@pytest.mark.parametrize(("mode", "fine"), [(0o755, True), (0o757, False), (0o1777, True)])
def test_a_folder_that_everybody_may_write(tmp_path: Path, deep: int, mode: int, *, fine: bool) -> None:
    """At each depth above, and itself. In one with the sticky bit others cannot move what is not theirs."""
    path = tmp_path / "a" / "b" / "c"
    path.mkdir(parents=True)
    [path, *path.parents][deep].chmod(mode)
    if fine:
        os.close(own_folder.open_own_folder(path))
        return
    with pytest.raises(own_folder.FolderError, match=f"chmod go-w {[path, *path.parents][deep]}"):
        own_folder.open_own_folder(path)


@pytest.mark.needs_root("give a folder to another group")
@pytest.mark.parametrize(
    ("group", "above", "fine"), [(0, True, True), (STRANGER, True, False), (0, False, False)], ids=str
)
def test_a_folder_that_a_group_may_write(tmp_path: Path, group: int, *, above: bool, fine: bool) -> None:
    """Of the folders above only with the group of root, or the own group of the owner (umask 002)."""
    path = tmp_path / "a" / "b"
    path.mkdir(parents=True)
    changed = path.parent if above else path
    os.chown(changed, -1, group)
    changed.chmod(0o775)
    with contextlib.nullcontext() if fine else pytest.raises(own_folder.FolderError, match="others may write"):
        os.close(own_folder.open_own_folder(path))


@pytest.mark.needs_root("give a folder to another user")
@pytest.mark.parametrize("deep", [0, 1, 2])
def test_a_folder_of_another_user(tmp_path: Path, deep: int) -> None:
    path = tmp_path / "a" / "b" / "c"
    path.mkdir(parents=True)
    os.chown([path, *path.parents][deep], STRANGER, -1)
    with pytest.raises(own_folder.FolderError, match=f"belongs to user {STRANGER}"):
        own_folder.open_own_folder(path / "new" if deep == 0 else path, 0o700)
    assert not (path / "new").exists()


def test_own_links_are_followed(tmp_path: Path) -> None:
    """As /var/run is one: absolute, relative, with dots; a ring ends."""
    (tmp_path / "there" / "in").mkdir(parents=True)
    (tmp_path / "one").symlink_to(tmp_path / "there")
    (tmp_path / "there" / "two").symlink_to("../there/./in")
    found = own_folder.open_own_folder(tmp_path / "one" / "two")
    assert os.path.samestat(os.fstat(found), (tmp_path / "there" / "in").stat())
    os.close(found)
    (tmp_path / "ring").symlink_to("ring")
    with pytest.raises(OSError, match="too many links") as raised:
        own_folder.open_own_folder(tmp_path / "ring")
    assert raised.value.errno == errno.ELOOP


@pytest.mark.needs_root("give a link to another user")
def test_a_link_of_another_user(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "there")
    os.lchown(tmp_path / "link", STRANGER, -1)
    with pytest.raises(own_folder.FolderError, match=f"{tmp_path}/link is a link of user {STRANGER}. Remove it"):
        own_folder.open_own_folder(tmp_path / "link" / "new", 0o700)
    assert not list((tmp_path / "there").iterdir())


@pytest.fixture
def taken(tmp_path: Path) -> Path:
    """A folder of another user above that of this one; the user can replace the lower one at any moment."""
    folder = tmp_path / "users" / "run"
    folder.mkdir(parents=True)
    os.chown(folder.parent, STRANGER, -1)
    return folder


@pytest.mark.needs_root("give a folder to another user")
def test_nothing_is_done_as_root_in_the_folder_of_another_user(taken: Path, tmp_path: Path) -> None:
    """The lease socket, both writers of records, the first records and what `canbase setup install` writes."""
    with pytest.raises(LeaseSocketError, match=f"belongs to user {STRANGER}"):
        LeaseSocket(str(taken / "lease"), os.getuid())
    file = LatchFile(taken / "carl", "driver", "carl")
    assert file.open().defect is Defect.ACCESS
    with pytest.raises(OSError, match=f"belongs to user {STRANGER}"):
        file.write(Record())
    keeper = LatchKeeper(LatchFile(taken, "watchdog", "carl"))
    assert f"belongs to user {STRANGER}" in keeper.found.detail
    keeper.start()
    keeper.want(Record())
    assert not keeper.finish(5.0)
    with pytest.raises(OSError, match=f"belongs to user {STRANGER}"):
        create_first(taken / "state" / "carl", "carl")
    with pytest.raises(OSError, match=f"belongs to user {STRANGER}"):
        first_records(taken / "state" / "carl", "carl", "root")
    assert not list(taken.iterdir())


@pytest.mark.needs_root("install")
def test_an_installation_does_not_write_below_the_folder_of_another_user(taken: Path) -> None:
    """The plan's folders belong to root on every system; where one does not, the first file is refused."""
    (taken / "there").write_text("kept")
    said: list[str] = []
    executor = Executor(Path("/"), said.append)
    place = PurePosixPath(str(taken))
    for action in (WriteFile(place / "new", "x"), Link(place / "link", "x"), Remove(place / "there")):
        with pytest.raises(ExecuteError, match=f"belongs to user {STRANGER}"):
            executor.carry_out([action])
    assert [path.name for path in taken.iterdir()] == ["there"]


def test_the_socket_has_its_mode_from_its_first_moment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Under any umask; it is reached by its path."""
    before = os.umask(0)
    try:
        bind = socket.socket.bind
        seen: list[int] = []

        class Watched(socket.socket):
            def bind(self, address: object) -> None:
                bind(self, address)  # type: ignore[arg-type]
                seen.append((tmp_path / "lease").stat().st_mode & 0o777)

        monkeypatch.setattr(socket, "socket", Watched)
        with LeaseSocket(str(tmp_path / "lease"), os.getuid()) as leases:
            sender = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            sender.sendto(b"x", str(tmp_path / "lease"))
            assert [data for data, *_ in leases.receive()] == [b"x"]
            sender.close()
    finally:
        os.umask(before)
    assert seen == [0o600]


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize("step", ["block", "fsync", "rename"])
def test_a_file_that_cannot_be_replaced_is_as_it_was_and_nothing_is_left_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, *, there: bool
) -> None:
    path = tmp_path / "file"
    if there:
        path.write_text("old")
    descriptors = len(os.listdir("/proc/self/fd"))

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "no space left")

    if step != "block":
        monkeypatch.setattr(os, step, full)
    with pytest.raises(OSError, match="no space left"), own_folder.replaced(path) as file:  # noqa: PT012 - a block
        file.write(b"new")
        if step == "block":
            full()
    assert {each.name: each.read_text() for each in tmp_path.iterdir()} == ({"file": "old"} if there else {})
    assert len(os.listdir("/proc/self/fd")) == descriptors


@pytest.mark.parametrize(("error", "fine"), [(None, True), (errno.EINVAL, True), (errno.EIO, False)])
def test_a_new_file_is_on_disk_before_it_has_its_name_and_its_folder_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: int | None, *, fine: bool
) -> None:
    path, rename, steps = tmp_path / "file", os.rename, list[str]()

    def fsync(descriptor: int) -> None:
        is_folder = os.path.samestat(os.fstat(descriptor), tmp_path.stat())
        steps.append("folder" if is_folder else os.pread(descriptor, 9, 0).decode())
        if is_folder and error:
            raise OSError(error, "cannot")

    def renamed(*names: str, src_dir_fd: int, dst_dir_fd: int) -> None:
        steps.append("rename")
        rename(*names, src_dir_fd=src_dir_fd, dst_dir_fd=dst_dir_fd)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(os, "rename", renamed)
    with (
        contextlib.nullcontext() if fine else pytest.raises(OSError, match="cannot"),
        own_folder.replaced(path) as file,
    ):
        file.write(b"whole")
    assert steps == ["whole", "rename", "folder"]


@pytest.mark.parametrize(
    ("before", "private", "after"), [(0o640, False, 0o640), (0o666, True, 0o600), (None, False, 0o644)]
)
def test_who_may_read_a_file_stays_and_a_link_is_not_followed(
    tmp_path: Path, before: int | None, after: int, *, private: bool
) -> None:
    path, aim = tmp_path / "file", tmp_path / "aim"
    if before is not None:
        aim.write_text("kept")
        aim.chmod(before)
    path.symlink_to(aim)
    mask = os.umask(0o022)
    try:
        with own_folder.replaced(path, private=private) as file:
            file.write(b"new")
            seen = os.fstat(file.fileno()).st_mode & 0o777
    finally:
        os.umask(mask)
    assert seen == path.lstat().st_mode & 0o777 == after
    assert not path.is_symlink()
    assert aim.exists() == (before is not None)


@pytest.mark.parametrize("private", [False, True])
@pytest.mark.parametrize("aim", ["/dev/null", "fifo", "."])
def test_what_is_no_file_is_not_replaced(tmp_path: Path, aim: str, *, private: bool) -> None:
    """As /dev/stdout, which is a link to a terminal."""
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "link").symlink_to(aim)
    for path in (tmp_path / "link", tmp_path / aim):
        with pytest.raises(OSError, match="is no regular file"), own_folder.replaced(path, private=private):
            raise AssertionError
    assert sorted(each.name for each in tmp_path.iterdir()) == ["fifo", "link"]


@pytest.mark.needs_root("give a file to another user")
def test_a_file_of_another_user_stays_with_that_user(tmp_path: Path) -> None:
    """As robot.yaml of an integrator that `sudo canbase setup commission` changes."""
    path = tmp_path / "file"
    path.touch(0o640)
    os.chown(path, STRANGER, STRANGER + 1)
    with own_folder.replaced(path):
        pass
    assert (path.stat().st_uid, path.stat().st_gid, path.stat().st_mode & 0o777) == (STRANGER, STRANGER + 1, 0o640)


def test_who_may_not_give_files_away_replaces_them_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the driver's service replaces the stop file that root has written in the services' folder."""

    def refused(*_words: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    path = tmp_path / "stop.json"
    path.touch()
    monkeypatch.setattr(os, "fchown", refused)
    for before, after in ((0o640, 0o640), (0o666, 0o644)):  # who could write it is another one than the owner now
        path.chmod(before)
        with own_folder.replaced(path) as file:
            file.write(b"new")
        assert (path.read_bytes(), path.stat().st_mode & 0o777) == (b"new", after)
    assert [each.name for each in tmp_path.iterdir()] == ["stop.json"]


OTHERWISE = {
    "canbase_driver/runtime/black_box_writer.py": "a probe, which is removed",
    "canbase_cli/explain.py": "a page for a person, who may name /dev/stdout",
    "canbase_evidence/gather.py": "a new folder gets its name whole",
    "canbase_evidence/new_folder.py": "files of that folder",
    "canbase_qualification/carry_out.py": "in a temporary folder",
    "canbase_recording/stop_file.py": "in a temporary folder",
    "canbase_base/latch_file.py": "a new folder gets its name whole",
}
"""Modules that write, or give a name, without `replaced`."""


def _otherwise(source: str) -> Iterator[int]:
    """Lines with a rename, or with a file that is opened to be overwritten."""
    for call in ast.walk(ast.parse(source)):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute):
            name = call.func.attr
            of_os = isinstance(call.func.value, ast.Name) and call.func.value.id == "os"
            path_replace = name == "replace" and (of_os or (len(call.args) == 1 and not call.keywords))
            overwrites = name == "open" and any(
                isinstance(each, ast.Constant) and each.value in ("w", "wb", "w+", "wt") for each in ast.walk(call)
            )
            if name in ("rename", "renames", "write_text", "write_bytes") or path_replace or overwrites:
                yield call.lineno


def test_files_are_replaced_in_one_way() -> None:
    root = Path(__file__).parents[3]
    packages = [each.parent for each in root.glob("*/canbase_*/__init__.py") if each.parts[-3] != "virtual_bus_tests"]
    assert len(packages) > 10
    found = {
        str(file.relative_to(package.parent)): lines
        for package in packages
        for file in package.rglob("*.py")
        if file.name != "own_folder.py" and (lines := list(_otherwise(file.read_text(encoding="utf-8"))))
    }
    assert set(found) == set(OTHERWISE), found
