"""Boots the virtual robot and has it go through its scenarios: python virtual_bus_tests/vm/host.py [SCENARIO …].

A Linux guest in QEMU without KVM, root or network. Its time is counted in instructions (-icount), and idle time is
skipped: what is measured inside does not depend on how busy this computer is. build.sh makes what it boots. Without
scenarios all of them run, in two guests side by side where there are two processors.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from canbase_evidence.installed_code import COMPILED, code_sha256  # noqa: E402
from vm import independent_stacks  # noqa: E402 - needs the path
from vm.guest.main import ALL, PLAN, names, shared_out  # noqa: E402
from vm.junit import junit  # noqa: E402
from vm.overlay import overlay, ramdisk  # noqa: E402
from vm.patience import Patience  # noqa: E402
import vm.patience; vm.patience.SILENT_LIMIT_S = 3000.0
from vm.qmp import Monitor  # noqa: E402
from vm.table import PAGE, last_words, report, results, write  # noqa: E402

BUILD = HERE.parents[1] / "build" / "vm"
GUESTS = int(os.environ.get("VM_GUESTS", str(os.cpu_count() or 1)))
"""How many may run side by side."""
BOOTS = 3
"""Of one guest at most: two scenarios end in a reset."""
APPEND = (
    "console=ttyS0 mitigations=off no_timer_check nokaslr random.trust_cpu=on audit=0 apparmor=0 selinux=0 "
    "systemd.show_status=1 systemd.journald.forward_to_console=1 systemd.journald.max_level_console=6 clocksource=hpet"
)


def memory(name: str, image: Path) -> list[str]:
    """An image as NVDIMM: reads copy memory, so that no wait for a disk makes guest time jump; writes stay private."""
    backend = f"memory-backend-file,id=m{name},share=off,mem-path={image},size={image.stat().st_size}"
    return ["-object", backend, "-device", f"nvdimm,id=nv{name},memdev=m{name}"]


def serial(name: str, path: Path) -> list[str]:
    """A serial port whose output goes behind what is in the file."""
    return ["-chardev", f"file,id={name},path={path},append=on", "-serial", f"chardev:{name}"]


def qemu(initrd: Path, monitor: Path, job: Path) -> list[str]:
    """The command line of the guest."""
    return [
        "qemu-system-x86_64",
        *("-machine", "pc,nvdimm=on", "-cpu", "Nehalem", "-m", "1024,slots=4,maxmem=8G", "-smp", "1"),
        *("-accel", "tcg,thread=single", "-icount", "shift=0,sleep=off", "-rtc", "base=utc,clock=vm"),
        *("-nodefaults", "-display", "none", "-nic", "none"),
        *("-kernel", str(BUILD / "vmlinux"), "-initrd", str(initrd), "-append", APPEND),
        *serial("console", job / "console.log"),
        *serial("told", job / "out.txt"),
        *("-qmp", f"unix:{monitor},server=on,wait=off"),
        *memory("0", BUILD / "root.ext4"),
        *memory("1", BUILD / "venv.ext4"),
        *("-virtfs", f"local,path={job},mount_tag=job,security_model=none,id=job"),
        *("-object", "can-bus,id=bus", "-device", "kvaser_pci,canbus=bus,id=adapter0,addr=0x10"),
        *("-device", "kvaser_pci,canbus=bus,id=adapter1,addr=0x11"),
        *("-device", "i6300esb,id=wd", "-action", "watchdog=reset", "-action", "reboot=shutdown"),
    ]


class Guest:
    """One computer. Its results are in `job`.

    When it is reset, QEMU ends and begins anew: over a reset the emulated SJA1000 keeps the position where it writes
    what it receives, and forgets the one to read from; it would hear nonsense from then on.
    """

    def __init__(self, initrd: Path, monitor: Path, job: Path) -> None:
        self.job, self.ended = job, ""
        self._monitor_path, self._told = monitor, job / "out.txt"
        self._command = qemu(initrd, monitor, job)
        self._boots_left = BOOTS
        self._patience = Patience(time.monotonic())
        self._boot()

    def _boot(self) -> None:
        self._boots_left -= 1
        self._monitor_path.unlink(missing_ok=True)
        self._monitor: Monitor | None = None
        self._process = subprocess.Popen(self._command, stdin=subprocess.DEVNULL)

    def attend(self) -> bool:
        """Do what it asks for. False: it has ended, or its time is over: then `ended` says why."""
        if self._process.poll() is not None:
            if self._boots_left == 0 or not (self.job / PLAN.name).exists() or (self.job / "code").exists():
                return False
            self._boot()
        if self._monitor is None and self._monitor_path.exists() and self._told.exists():
            self._monitor = Monitor(self._monitor_path, self._told)
        if self._monitor is not None:
            self._monitor.look()
        self.ended = self._patience.over(self._told.stat().st_size if self._told.exists() else 0, time.monotonic())
        if self.ended:
            self.end()
        return not self.ended

    def end(self) -> None:
        """Whatever it is doing."""
        self._process.kill()
        self._process.wait()


def boot(jobs: Mapping[Path, Sequence[str]]) -> dict[Path, str]:
    """A guest for each job with its scenarios, side by side, until the last one has ended. Why one had to be ended."""
    guests: list[Guest] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        overlay(folder)
        initrd = ramdisk(folder, BUILD / "initrd.gz")
        try:
            for job, wanted in jobs.items():
                shutil.rmtree(job, ignore_errors=True)
                job.mkdir(parents=True)
                (job / "wanted.json").write_text(json.dumps(wanted))
                guests.append(Guest(initrd, folder / f"{job.name}.qmp", job))
            while any([guest.attend() for guest in guests]):  # noqa: C419 - each of them
                time.sleep(0.05)
        finally:
            for guest in guests:
                guest.end()
    return {guest.job: guest.ended for guest in guests}


def main(wanted: Sequence[str]) -> int:
    """Exit code 0: every scenario that can run here came out as promised. Their rows in docs/stop_times.md are written
    anew."""
    chosen = names(wanted)
    skipped = independent_stacks.skipped(chosen, independent_stacks.folder())
    parts = shared_out([name for name in chosen if name not in skipped], GUESTS)
    jobs = {BUILD / f"job-{number}": part for number, part in enumerate(parts, 1)}
    begun = time.monotonic()
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # by way of `finally`: guests end too
    ended = boot(jobs)
    found = [result for job in jobs for result in results(job, jobs[job], ended[job])]
    for job in [job for job in jobs if not (job / "code").exists()]:
        print(last_words(job), file=sys.stderr)
    code = code_sha256() + (COMPILED if os.environ.get("COMPILED") else "")
    (BUILD / "evidence_tests.xml").write_text(junit(found, code, skipped), encoding="utf-8")
    write(PAGE, found, list(ALL), time.strftime("%Y-%m-%d", time.gmtime()))
    return report(found, time.monotonic() - begun, skipped)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
