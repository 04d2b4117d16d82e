"""What the services and root run belongs to root, up to the top folder: what `canbase setup install` refuses."""

from __future__ import annotations

import errno
import os
import stat
import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from canbase_deploy import ownership
from canbase_deploy.host import folders, refuse_others, sourced
from canbase_deploy.ownership import ROOT, Fault, fault, faults, refusal
from canbase_deploy.plan import InstallError

ME = os.getuid()
NO_ID = 2**32 - 1
FOLDER, FILE, LINK = stat.S_IFDIR | 0o755, stat.S_IFREG | 0o644, stat.S_IFLNK | 0o777


def found(mode: int, uid: int = ROOT, gid: int = ROOT) -> os.stat_result:
    return os.stat_result((mode, 1, 1, 1, uid, gid, 0, 0, 0, 0))


@pytest.mark.parametrize(
    ("entry", "above", "why"),
    [
        (found(FOLDER), False, ""),
        (found(FILE), False, ""),
        (found(LINK), False, ""),  # the mode of a link says nothing; its target is looked at
        (found(FOLDER, uid=54321), True, "belongs to the user 54321"),
        (found(FILE, uid=54321), False, "belongs to the user 54321"),
        (found(LINK, uid=54321), False, "belongs to the user 54321"),
        (found(FILE | 0o002), False, "is writable by everybody"),
        (found(FOLDER | 0o002), True, "is writable by everybody"),
        (found(FOLDER | 0o020, gid=50), False, "is writable by the group 50"),
        (found(FOLDER | 0o020, gid=ROOT), False, ""),
        (found(FOLDER | stat.S_ISVTX | 0o002), True, ""),  # /tmp: what is root's in it stays
        (found(FOLDER | stat.S_ISVTX | 0o002), False, "is writable by everybody"),  # but others may add files
        (found(stat.S_IFCHR | 0o666), False, ""),  # a link to /dev/null
    ],
)
def test_owner_and_mode_decide(entry: os.stat_result, above: bool, why: str) -> None:
    assert fault(entry, above=above) == why


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """An installation that belongs to whoever runs the test, as one of root's does to root."""
    top = tmp_path / "opt" / "canbase"
    package = top / "lib" / "canbase_watchdog"
    package.mkdir(parents=True)
    for name in ("__init__.py", "policy.py"):
        (package / name).write_text("")
    for path in (top.parent, top, *top.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)
    return top


def paths(found: list[Fault]) -> list[str]:
    return [one.path for one in found]


def mine(*tops: Path | str, most: int = ownership.MOST_ENTRIES) -> list[Fault]:
    """Faults where whoever runs the test counts as root does."""
    return faults(map(str, tops), frozenset((ROOT, ME)), most)


def test_a_tree_of_root_has_no_fault(tree: Path) -> None:
    assert mine(tree) == []


def test_one_file_that_others_may_write_is_found_wherever_it_is(tree: Path) -> None:
    (tree / "lib/canbase_watchdog/policy.py").chmod(0o646)

    (one,) = mine(tree)

    assert (one.path, one.why) == (str(tree / "lib/canbase_watchdog/policy.py"), "is writable by everybody")


WRITABLE_FOR_ONE = struct.pack("<I" + 5 * "HHI", 2, 1, 7, NO_ID, 2, 7, 65534, 4, 5, NO_ID, 16, 7, NO_ID, 32, 5, NO_ID)
"""acl(5) as the kernel stores it: owner rwx, user 65534 rwx, group r-x, mask rwx, others r-x."""


@pytest.mark.parametrize("kind", ["access", "default"])
def test_an_access_control_list_that_no_mode_shows_is_found(tree: Path, kind: str) -> None:
    package = tree / "lib/canbase_watchdog"
    try:
        os.setxattr(package, f"system.posix_acl_{kind}", WRITABLE_FOR_ONE)
    except OSError as error:
        pytest.skip(f"this file system has no ACLs: {error}")
    package.chmod(0o755)  # the mask: nothing of it is to be seen in a mode

    (one,) = mine(tree)

    assert (one.path, one.why) == (str(package), "has an access control list")
    assert one.cure() == f"sudo setfacl -R -b {package}"
    os.removexattr(package, f"system.posix_acl_{kind}")
    assert mine(tree) == []


def test_an_access_control_list_that_cannot_be_read_is_a_fault_and_none_where_there_can_be_none(
    tree: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(number: int) -> Callable[..., list[str]]:
        def listxattr(path: str, *, follow_symlinks: bool) -> list[str]:
            raise OSError(number, os.strerror(number), path)

        return listxattr

    monkeypatch.setattr(os, "listxattr", refused(errno.ENOTSUP))
    assert mine(tree) == []
    monkeypatch.setattr(os, "listxattr", refused(errno.EACCES))
    assert mine(tree)[0].why == "cannot be looked at: Permission denied"


@pytest.mark.parametrize("name", ["system.nfs4_acl", "system.nfs4_acl_xdr", "system.posix_acl_default"])
def test_an_access_control_list_of_nfs_is_one(tree: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """A mode shows nothing of it, and no command removes one of NFSv4: setfacl(1) changes those of POSIX alone."""
    monkeypatch.setattr(os, "listxattr", lambda *_, **__: ["user.mime_type", name])
    assert mine(tree)[0].why == "has an access control list"
    assert mine(tree)[0].cure().startswith("sudo setfacl" if "posix" in name else "install on a disk of this computer")
    monkeypatch.setattr(os, "listxattr", lambda *_, **__: ["user.mime_type"])
    assert mine(tree) == []


def test_a_tree_of_a_user_is_told_once_with_its_cure(tree: Path) -> None:
    """As `chown $USER` leaves it: from the first folder on that is not root's."""
    told = faults([str(tree)], frozenset((54321,)))

    assert told[0].path == "/"  # here nothing is that owner's; no -R for the system's own folders
    assert told[0].cure() == "sudo chown root:root / && sudo chmod go-w /"
    cure = Fault("/opt/canbase", "belongs to the user me").cure()
    assert cure == "sudo chown -R root:root /opt/canbase && sudo chmod -R go-w /opt/canbase"


@pytest.mark.parametrize("path", ["/home/me", "/home/me/canbase", "/root"])
def test_nobody_gives_a_home_to_root(path: str) -> None:
    assert Fault(path, "belongs to the user me").cure().startswith("install into /opt/canbase: ")


def test_what_one_cure_cures_is_told_once(tree: Path) -> None:
    tree.chmod(0o777)
    for path in tree.rglob("*"):
        path.chmod(0o777)

    assert paths(mine(tree)) == [str(tree)]


def test_a_folder_above_it_counts_too(tree: Path) -> None:
    tree.parent.chmod(0o777)

    assert paths(mine(tree)) == [str(tree.parent)]


def test_links_are_followed_out_of_the_tree_and_on_the_way_to_it(tree: Path, tmp_path: Path) -> None:
    """colcon --symlink-install, an editable installation, /usr/bin/python3."""
    sources = tmp_path / "home" / "ws"
    (sources / "deep").mkdir(parents=True)
    (sources / "deep" / "policy.py").write_text("")
    (sources / "deep" / "policy.py").chmod(0o666)
    (tree / "src").symlink_to("../../home/ws")
    (tmp_path / "shortcut").symlink_to("opt/canbase")
    (tmp_path / "loop").symlink_to("loop")

    assert paths(mine(tmp_path / "shortcut" / "lib" / ".." / "src")) == [str(sources / "deep" / "policy.py")]
    assert paths(mine(tree)) == [str(sources / "deep" / "policy.py")]
    assert mine(tmp_path / "loop", tmp_path / "nowhere") == []


def test_a_tree_without_end_is_refused_after_a_counted_number_of_files(tree: Path) -> None:
    for number in range(100):
        (tree / f"file{number}").write_text("")
    looked = []
    real = ownership.fault
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ownership, "fault", lambda *a, **k: looked.append(1) or real(*a, **k))  # type: ignore[func-returns-value]
        (one,) = mine(tree, most=50)

    assert "more than 50 files" in one.why
    assert len(looked) < 50 + 110  # no folder is begun beyond the limit


def test_each_folder_is_looked_into_once(tree: Path) -> None:
    """Python's path names folders below each other."""
    assert mine(tree, tree / "lib", tree / "lib/canbase_watchdog", most=40) == []


def test_the_user_is_told_each_with_its_cure() -> None:
    text = refusal([Fault("/opt/canbase", "belongs to the user me"), Fault("/srv", "is writable by everybody")])

    assert "/opt/canbase belongs to the user me: sudo chown -R root:root /opt/canbase" in text
    assert "/srv is writable by everybody: sudo chown root:root /srv && sudo chmod go-w /srv" in text
    assert refusal([]) == ""


def test_the_installer_refuses_it(tree: Path) -> None:
    (tree / "lib/canbase_watchdog/policy.py").chmod(0o666)

    with pytest.raises(InstallError, match=r"others than root could change what the services run:\n"):
        refuse_others([str(tree)])


def test_empty_and_relative_entries_of_a_sourced_environment_go_to_no_service(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They mean the current folder."""
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    seen = {"PYTHONPATH": ":/opt/ws:.", "LD_LIBRARY_PATH": ":", "ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": "/opt/a:/b"}

    kept = sourced(seen)

    assert kept == {"PYTHONPATH": "/opt/ws", "ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": "/opt/a:/b"}
    assert folders(kept) == ["/opt/a", "/b", "/opt/ws"]


@pytest.mark.needs_root("give a file to another user")
def test_a_python_of_a_user_is_not_run_before_it_is_refused(tmp_path: Path) -> None:
    from typer.testing import CliRunner

    from canbase_cli.main import app
    from canbase_config.load import sample

    bin_folder = tmp_path / "bin"
    bin_folder.mkdir()
    python = bin_folder / "python"
    python.write_text(f"#!/bin/sh\ntouch {tmp_path}/ran\n")
    python.chmod(0o755)
    os.chown(python, 54321, 54321)

    options = ["--config", str(sample("example_can0")), "--python", str(python), "--dry-run"]
    done = CliRunner().invoke(app, ["setup", "install", *options])

    assert done.exit_code == 2
    assert f"{python} belongs to the user 54321: sudo chown -R root:root {python}" in done.output
    assert "would write   /etc/canbase/example.yaml" in done.output
    assert not (tmp_path / "ran").exists()
