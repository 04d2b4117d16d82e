"""Which folders a reboot may empty, by tables of mounts as real computers have them."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import pytest

from canbase_base.lasting import UNKNOWN, forgets
from canbase_base.latch_file import LatchFile
from canbase_base.latch_folder import forgetful
from canbase_base.latch_record import Defect, Record
from canbase_config.load import load_robot, sample
from support.watchdog_story import config

DISK = """\
22 28 0:20 / /sys rw,nosuid - sysfs sysfs rw
26 28 0:5 / /dev rw,nosuid - devtmpfs udev rw,size=4000k
28 1 254:1 / / rw,relatime shared:1 - ext4 /dev/vda1 rw,errors=remount-ro
35 28 0:28 / /tmp rw,nosuid shared:13 - tmpfs tmpfs rw
"""
"""Debian on a disk."""
READ_ONLY_ROOT = """\
25 1 0:22 / / rw,relatime - overlay overlayroot rw,lowerdir=/media/root-ro,upperdir=/media/root-rw/overlay
26 25 179:2 / /media/root-ro ro,relatime - ext4 /dev/mmcblk0p2 ro
27 25 0:21 / /media/root-rw rw,relatime - tmpfs tmpfs-root rw
28 25 179:3 / /var/lib/canbase rw,relatime - ext4 /dev/mmcblk0p3 rw
"""
"""A single-board computer with overlayroot, and a partition for what shall last."""
CONTAINER = """\
1027 900 0:98 / / rw,relatime master:400 - overlay overlay rw,lowerdir=/l/A,upperdir=/var/lib/docker/overlay2/x/diff
1040 1027 8:2 /var/lib/docker/volumes/robot/_data /root/.local/state rw,relatime master:1 - ext4 /dev/sda2 rw
"""
SUBVOLUME = "30 1 0:27 /@ / rw,relatime shared:1 - btrfs /dev/nvme0n1p2 rw,space_cache=v2,subvol=/@\n"
INITRAMFS = "1 1 0:2 / / rw - rootfs rootfs rw\n"
COVERED = DISK + "90 28 0:60 / /var/lib rw - tmpfs tmpfs rw\n91 90 8:9 / /var/lib rw - xfs /dev/sdb1 rw\n"
ODD = DISK + "92 28 0:61 / /var/lib/my\\040r\u00f6bot rw - tmpfs tmpfs rw\n"


@pytest.mark.parametrize(
    ("mounts", "folder", "kind"),
    [
        (DISK, "/var/lib/canbase/carl", ""),
        (DISK, "/tmp/canbase", "tmpfs"),
        (DISK, "/tmpfolder", ""),
        (DISK, "/tmp", "tmpfs"),
        (READ_ONLY_ROOT, "/var/lib/canbase/carl", ""),
        (READ_ONLY_ROOT, "/var/lib/canbase", ""),
        (READ_ONLY_ROOT, "/var/lib/canbase2", "overlay"),
        (CONTAINER, "/root/.local/state/canbase/carl", ""),
        (CONTAINER, "/var/lib/canbase", "overlay"),
        (SUBVOLUME, "/var/lib/canbase", ""),
        (INITRAMFS, "/var/lib/canbase", "rootfs"),
        (COVERED, "/var/lib/canbase", ""),
        (ODD, "/var/lib/my r\u00f6bot/canbase", "tmpfs"),
        ("", "/var/lib/canbase", UNKNOWN),
    ],
)
def test_what_is_in_memory_or_a_layer_over_an_image_is_forgotten(mounts: str, folder: str, kind: str) -> None:
    assert forgets(folder, mounts) == kind


@pytest.mark.parametrize(
    ("kind", "device", "lasts"),
    [
        *((kind, "/dev/sda1", True) for kind in ("ext4", "xfs", "btrfs", "f2fs", "vfat")),
        ("nfs4", "server:/robots", True),
        ("virtiofs", "shared", True),
        *((kind, kind, False) for kind in ("tmpfs", "ramfs", "overlay", "squashfs", "fuse.fuse-overlayfs", "devtmpfs")),
        ("a_new_one", "/dev/sda1", False),
        ("ext4", "/dev/ram0", False),
        ("ext4", "/dev/zram12", False),
        ("ext4", "/dev/mapper/ramses", True),
    ],
)
def test_what_is_not_known_to_last_counts_as_forgotten(
    kind: str, device: str, lasts: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mounts = f"28 1 254:1 / / rw,relatime shared:1 - {kind} {device} rw\n"
    mounted(monkeypatch, mounts)
    assert (forgets("/var/lib/canbase", mounts) == "") is lasts
    assert forgetful(tmp_path / "watchdog.latch") == forgets("/var/lib/canbase", mounts)


def mounted(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    read = Path.read_text
    monkeypatch.setattr(
        Path, "read_text", lambda self, *a: text if str(self) == "/proc/self/mountinfo" else read(self, *a)
    )


@pytest.mark.parametrize("latched", [False, True])
def test_a_record_that_a_reboot_takes_back_counts_as_latched_and_names_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, latched: bool
) -> None:
    """t  0  the image's record says CLEAR ── start: latched ── reset ── start again in the same boot: latched"""
    mounted(monkeypatch, INITRAMFS if latched else SUBVOLUME)
    first = LatchFile(tmp_path, "driver", "carl")
    assert first.open().defect is Defect.MISSING
    first.write(Record())
    for _ in range(2):
        found = LatchFile(tmp_path, "driver", "carl", must_last=True).open()
        assert found.latched is latched
        assert (str(tmp_path) in found.sentence and "rootfs" in found.sentence) is latched
    assert not LatchFile(tmp_path, "driver", "carl").open().latched  # of simulated drives


def test_what_an_operator_switched_off_stays_off_there_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mounted(monkeypatch, INITRAMFS)
    LatchFile(tmp_path, "driver", "carl").write(Record(code=1))
    found = LatchFile(tmp_path, "driver", "carl", must_last=True).open()
    assert (found.defect, found.record.code) == (Defect.NONE, 1)


@pytest.mark.parametrize(
    ("file", "made"),
    [
        ("driver/canbase_driver/runtime/main.py", "LatchFile"),
        ("velocity_mux/canbase_velocity/main.py", "LatchFile"),
        ("watchdog/canbase_watchdog/life.py", "LatchFile"),
    ],
)
def test_in_each_process_of_a_robot_with_a_wire_the_record_must_last(file: str, made: str) -> None:
    tree = ast.parse((Path(__file__).parents[3] / file).read_text("utf-8"))
    (call,) = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and ast.unparse(n.func) == made]
    (given,) = [ast.unparse(word.value) for word in call.keywords if word.arg == "must_last"]
    assert given in ("not robot.bus.is_virtual", "not config.is_virtual")


@pytest.mark.parametrize(("interface", "virtual"), [("udp_multicast", True), ("virtual", True), ("socketcan", False)])
def test_the_watchdog_knows_which_buses_have_no_wire_as_robot_yaml_does(interface: str, virtual: bool) -> None:
    bus = load_robot(sample("bench")).robot.bus.model_copy(update={"interface": interface, "channel": "239.1.2.3"})
    assert bus.is_virtual is virtual
    assert replace(config(), bus_arguments=bus.arguments()).is_virtual is virtual
