"""Whether a folder is as it was after a reboot, by the kernel's table of mounts. Pure.

A record of stops in memory, or in a layer over an image, is the image's again after each boot: CLEAR, whatever latched.
"""

from __future__ import annotations

import re

UNKNOWN = "an unknown file system"
FORGET = (UNKNOWN, "aufs", "cramfs", "erofs", "overlay", "ramfs", "rootfs", "squashfs", "tmpfs")
"""File systems in memory, images that nothing is written to, and layers over them, which may be in memory."""


def forgets(folder: str, mountinfo: str) -> str:
    """The file system of an absolute `folder` without links where a reboot may take back what is written, else empty.

    `mountinfo`: the text of /proc/self/mountinfo (proc_pid_mountinfo(5)): 36 35 98:0 / /point rw shared:1 - ext4
    /dev/sda1 rw. UNKNOWN where it does not tell.
    """
    longest, kind = -1, UNKNOWN
    for words in (line.split() for line in mountinfo.splitlines()):
        point = re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), words[4]).rstrip("/")
        if len(point) >= longest and f"{folder}/".startswith(f"{point}/"):
            longest, kind = len(point), words[words.index("-") + 1]  # of two at one place the later covers the other
    return kind if kind in FORGET else ""
