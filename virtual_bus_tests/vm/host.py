"""Boots the virtual robot and has it go through its scenarios: python virtual_bus_tests/vm/host.py [SCENARIO …].

A Linux guest in QEMU without KVM, root or network. Its time is counted in instructions (-icount), and idle time is
skipped: what is measured inside does not depend on how busy this computer is. build.sh makes what it boots.
"""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = ROOT / "build" / "vm"
LIMIT_S = 1500.0
"""On this computer. A guest that has not ended by then is killed."""
APPEND = (
    "console=ttyS0 mitigations=off no_timer_check nokaslr random.trust_cpu=on audit=0 apparmor=0 selinux=0 "
    "systemd.show_status=0 clocksource=hpet"
)
RATES = "rates: {control_hz: 50.0, odometry_hz: 25.0, command_hz: 25.0}\naction: {control_hz: 20.0}\n"
"""The guest's processor is slow: about a billion instructions a second."""


def robot_yaml(channel: str, lease: str) -> str:
    """The example robot on an interface of the guest, without scanner and button, which it does not have."""
    text = (ROOT / "can_config/canbase_config/robots/example_can0.yaml").read_text(encoding="utf-8")
    text = text.replace("required: true", "required: false").replace("name: example", "name: robot")
    text = text.replace("channel: can0", f"channel: {channel}").replace("/run/canbase/lease.sock", lease)
    return text + RATES


def overlay(folder: Path) -> None:
    """What the guest has besides its system: the robot as `canbase install` makes it, and the test's own units."""
    config = folder / "robot.yaml"
    config.write_text(robot_yaml("can0", "/run/canbase/robot/lease.sock"), encoding="utf-8")
    tree = folder / "overlay"
    install = ["install", "--config", str(config), "--prefix", str(tree), "--python", "/opt/canbase/bin/python"]
    command = [str(ROOT / ".venv/bin/python"), "-m", "canbase_cli", *install]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    etc, lib = tree / "etc", tree / "usr/lib/canbase-vm"
    (etc / "canbase/drives.yaml").write_text(robot_yaml("can1", "/run/lease.sock"), encoding="utf-8")
    (etc / "canbase/can/can1.env").write_text("BITRATE=500000\nRESTART_MS=100\nTXQUEUELEN=100\n", encoding="utf-8")
    wants = etc / "systemd/system/multi-user.target.wants"
    for name in ("job.service", "canbase-sim.service"):
        shutil.copy(HERE / "guest" / name, etc / "systemd/system")
        (wants / name).symlink_to(f"../{name}")
    (etc / "systemd/journald.conf.d").mkdir()
    (etc / "systemd/journald.conf.d/vm.conf").write_text("[Journal]\nStorage=volatile\nRateLimitIntervalSec=0\n")
    (etc / "sysctl.d").mkdir()
    (etc / "sysctl.d/vm.conf").write_text("kernel.sched_rt_runtime_us = -1\n")
    shutil.copytree(HERE / "guest", lib / "vm/guest", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(HERE / "guest/job", lib)


def ramdisk(folder: Path) -> Path:
    """The initial ramdisk with the overlay behind it: the kernel unpacks both."""
    made = folder / "initrd.gz"
    listed = subprocess.run(["find", "overlay"], cwd=folder, check=True, capture_output=True).stdout
    command = ["cpio", "-o", "-H", "newc", "--quiet", "--owner=0:0"]
    archive = subprocess.run(command, cwd=folder, input=listed, check=True, capture_output=True).stdout
    made.write_bytes((BUILD / "initrd.gz").read_bytes() + archive)
    return made


def memory(name: str, image: Path) -> list[str]:
    """An image as NVDIMM: reads copy memory, so that no wait for a disk makes guest time jump; writes stay private."""
    backend = f"memory-backend-file,id=m{name},share=off,mem-path={image},size={image.stat().st_size}"
    return ["-object", backend, "-device", f"nvdimm,id=nv{name},memdev=m{name}"]


def qemu(folder: Path, job: Path) -> list[str]:
    """The command line of the guest."""
    return [
        "qemu-system-x86_64",
        *("-machine", "pc,nvdimm=on", "-cpu", "Nehalem", "-m", "1024,slots=4,maxmem=8G", "-smp", "1"),
        *("-accel", "tcg,thread=single", "-icount", "shift=0,sleep=off", "-rtc", "base=utc,clock=vm"),
        *("-nodefaults", "-display", "none", "-nic", "none"),
        *("-kernel", str(BUILD / "vmlinux"), "-initrd", str(ramdisk(folder)), "-append", APPEND),
        *("-serial", f"file:{job}/console.log", "-serial", f"file:{job}/out.txt"),
        *("-qmp", f"unix:{folder}/qmp,server=on,wait=off"),
        *memory("0", BUILD / "root.ext4"),
        *memory("1", BUILD / "venv.ext4"),
        *("-virtfs", f"local,path={job},mount_tag=job,security_model=none,id=job"),
        *("-object", "can-bus,id=bus", "-device", "kvaser_pci,canbus=bus,id=adapter0,addr=0x10"),
        *("-device", "kvaser_pci,canbus=bus,id=adapter1,addr=0x11"),
        *("-device", "i6300esb,id=wd", "-action", "watchdog=reset"),
    ]


ORDERS: Mapping[str, dict[str, Any]] = {
    "device_del": {"execute": "device_del", "arguments": {"id": "adapter0"}},
    "device_add": {
        "execute": "device_add",
        "arguments": {"driver": "kvaser_pci", "canbus": "bus", "id": "adapter0", "addr": "0x10"},
    },
}


class Monitor:
    """QEMU's control socket: takes the adapter out and puts it in again when the guest asks for it."""

    def __init__(self, path: Path, told: Path) -> None:
        self._told, self._done = told, 0
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(str(path))
        self._send({"execute": "qmp_capabilities"})

    def look(self) -> None:
        """Do what the guest's output asks for since the last look."""
        lines = [line for line in self._told.read_text(errors="replace").splitlines() if line.startswith("@host ")]
        for line in lines[self._done :]:
            self._send(ORDERS[line.split()[1]])
        self._done = len(lines)

    def _send(self, order: dict[str, Any]) -> None:
        self._socket.sendall(json.dumps(order).encode() + b"\n")


def boot(wanted: Sequence[str], job: Path) -> int:
    """Run the guest; results are in `job`. Exit code of its scenarios, 124: too slow, 125: it died."""
    shutil.rmtree(job, ignore_errors=True)
    job.mkdir(parents=True)
    (job / "wanted.json").write_text(json.dumps(list(wanted)))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        overlay(folder)
        guest = subprocess.Popen(qemu(folder, job), stdin=subprocess.DEVNULL)
        try:
            return _attend(guest, folder, job)
        finally:
            guest.kill()
            guest.wait()


def _attend(guest: subprocess.Popen[bytes], folder: Path, job: Path) -> int:
    monitor: Monitor | None = None
    until = time.monotonic() + LIMIT_S
    while guest.poll() is None:
        if time.monotonic() > until:
            return 124
        if monitor is None and (folder / "qmp").exists() and (job / "out.txt").exists():
            monitor = Monitor(folder / "qmp", job / "out.txt")
        if monitor is not None:
            monitor.look()
        time.sleep(0.05)
    code = job / "code"
    return int(code.read_text()) if code.exists() else 125


if __name__ == "__main__":
    sys.exit(boot(sys.argv[1:], BUILD / "job"))
