"""Whether a folder is as it was after a reboot, by the kernel's table of mounts. Pure.

A record of stops in memory, or in a layer over an image, is the image's again after each boot: CLEAR, whatever latched.
What is not known to be a disk, or a folder of another computer, counts as forgotten.
"""

from __future__ import annotations

import re

UNKNOWN = "an unknown file system"
LASTS = (
    "9p", "btrfs", "cifs", "ext2", "ext3", "ext4", "f2fs", "jffs2", "nfs", "nfs4", "ubifs", "vfat", "virtiofs", "xfs",
    "zfs",
)  # fmt: skip
"""Types of file systems on disks, flash memory and other computers."""
MEMORY = re.compile(r"/dev/z?ram\d+")
"""Block devices in memory."""


def forgets(folder: str, mountinfo: str) -> str:
    """The file system of an absolute `folder` without links where a reboot may take back what is written, else empty.

    `mountinfo`: the text of /proc/self/mountinfo (proc_pid_mountinfo(5)): 36 35 98:0 / /point rw shared:1 - ext4
    /dev/sda1 rw. UNKNOWN where it does not tell.
    """
    longest, kind, device = -1, UNKNOWN, ""
    for words in (line.split() for line in mountinfo.splitlines()):
        point = re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), words[4]).rstrip("/")
        if len(point) >= longest and f"{folder}/".startswith(f"{point}/"):  # of two at one place the later covers
            longest, (kind, device) = len(point), words[words.index("-") + 1 :][:2]
    if MEMORY.fullmatch(device):
        return f"{kind} in memory ({device})"
    return "" if kind in LASTS else kind
