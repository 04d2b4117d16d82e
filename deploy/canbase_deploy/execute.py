"""Carries out a plan on this machine or below a prefix, and reports what it did. All side effects are here."""

from __future__ import annotations

import errno
import grp
import os
import pwd
import select
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path, PurePosixPath

from canbase_base.latch_file import create_first
from canbase_base.own_folder import open_own_folder, replaced
from canbase_deploy.actions import Action, Existing, FirstRecords, Link, Remove, Run, WriteFile
from canbase_deploy.owner import ETC, old

COMMAND_S = 60.0
WOULD = {"wrote": "write", "replaced": "replace", "linked": "link", "removed": "remove", "ran": "run", "made": "make"}
"""A dry run reports what it would do."""


class ExecuteError(RuntimeError):
    """A step failed; those before it are done. After the cause is gone the same command may be given again."""


class Executor:
    """Carries out actions one by one."""

    def __init__(self, prefix: Path, say: Callable[[str], None], *, dry_run: bool = False) -> None:
        """`prefix` other than /: files go below it and no command is run. `dry_run`: only says what it would do."""
        self._prefix, self._say, self._dry_run = prefix, say, dry_run
        self.changed: set[PurePosixPath] = set()
        """Files that were written with other contents than they had, or for the first time."""

    def carry_out(self, actions: Sequence[Action]) -> None:
        """All of them, in order. Raises ExecuteError."""
        for action in actions:
            try:
                self._one(action)
            except (OSError, subprocess.SubprocessError) as error:
                advice = " Run it with sudo." if isinstance(error, PermissionError) else ""
                raise ExecuteError(f"{_name(action)}: {error}.{advice}") from error

    def _one(self, action: Action) -> None:
        match action:
            case WriteFile():
                self._write(action)
            case Link():
                self._link(action)
            case Remove():
                self._remove(action)
            case Run():
                self._run(action)
            case FirstRecords():
                self._first_records(action)

    def _write(self, action: WriteFile) -> None:
        path = self._below(action.path)
        there = path.read_text(encoding="utf-8") if path.is_file() else None
        if there == action.text:
            self._tell("as it was", action.path)
        elif there is not None and action.existing is Existing.KEEP:
            self._tell("kept", action.path)
            return
        elif there is not None and action.existing is Existing.BACK_UP:
            self._tell("replaced", action.path, f"the old one is {action.path.name}.old")
            self._put(self._below(old(action.path)), there, action)
        else:
            self._tell("wrote", action.path)
        if there != action.text:
            self.changed.add(action.path)
        self._put(path, action.text, action)

    def _put(self, path: Path, text: str, action: WriteFile) -> None:
        """Whole or not at all, and never readable for more than it is meant to be."""
        if self._dry_run:
            return
        self._make_folder(path.parent)
        with replaced(path, private=True) as file:
            file.write(text.encode())
            if action.group and self._prefix == Path("/"):
                os.fchown(file.fileno(), 0, grp.getgrnam(action.group).gr_gid)
            os.fchmod(file.fileno(), action.mode)

    def _make_folder(self, folder: Path) -> None:
        """Nobody but root may change it or a folder above it: root works by path below. Raises FolderError."""
        if self._prefix == Path("/"):
            os.close(open_own_folder(folder, 0o755))
        else:
            folder.mkdir(parents=True, exist_ok=True)

    def _link(self, action: Link) -> None:
        path = self._below(action.path)
        if path.is_symlink() and os.readlink(path) == action.target:
            self._tell("as it was", action.path)
            return
        self._tell("linked", action.path)
        if not self._dry_run:
            self._make_folder(path.parent)
            path.unlink(missing_ok=True)
            path.symlink_to(action.target)

    def _remove(self, action: Remove) -> None:
        path = self._below(action.path)
        if not (path.is_symlink() or path.exists()):
            return
        self._tell("removed", action.path)
        if self._dry_run:
            return
        self._make_folder(path.parent)
        path.unlink()
        made = path.parent.suffix in (".d", ".wants") or ETC in action.path.parent.parents
        if made and not any(path.parent.iterdir()):
            path.parent.rmdir()

    def _run(self, action: Run) -> None:
        if self._prefix != Path("/"):
            return
        self._tell("ran", " ".join(action.argv))
        if self._dry_run:
            return
        try:
            subprocess.run(action.argv, check=True, timeout=COMMAND_S, stdin=subprocess.DEVNULL)
        except (OSError, subprocess.SubprocessError) as error:
            if not action.may_fail:
                raise
            self._say(f"failed    {error}; the rest is done all the same")

    def _first_records(self, action: FirstRecords) -> None:
        if self._prefix != Path("/"):
            return
        folder = Path(action.folder)
        if folder.exists() if self._dry_run else not first_records(folder, action.robot, action.user):
            self._tell("kept", action.folder)
        else:
            self._tell("made", action.folder, "no stop is latched")

    def _below(self, path: PurePosixPath) -> Path:
        return self._prefix / path.relative_to("/")

    def _tell(self, what: str, subject: object, more: str = "") -> None:
        if self._dry_run:
            what = f"would {WOULD[what]:7}" if what in WOULD else f"{what:13}"
        self._say(f"{what:9} {subject}" + (f" ({more})" if more else ""))


def first_records(folder: Path, robot: str, user: str) -> bool:
    """Clear records of stops in a new folder of this user; False: the folder is there, and nothing was touched.

    The user may change what lies in the folder above it at any moment, so nothing there is done as root: this user
    makes the records. Raises OSError; KeyError without such a user.
    """
    account = pwd.getpwnam(user)
    _make_for(account, folder.parent)
    return as_user(account, lambda: create_first(folder, robot))


def _make_for(account: pwd.struct_passwd, folder: Path) -> None:
    """A folder of that user in a folder of root, where it is not there."""
    above = open_own_folder(folder.parent, 0o755)
    try:
        os.mkdir(folder.name, 0o700, dir_fd=above)
        os.chown(folder.name, account.pw_uid, account.pw_gid, dir_fd=above, follow_symlinks=False)
    except FileExistsError:
        return
    finally:
        os.close(above)


def as_user(account: pwd.struct_passwd, do: Callable[[], bool]) -> bool:
    """What `do` returns in a process that is this user for good. Raises OSError with the number of the one there."""
    reads, writes = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            _become(account)
            answer = b"yes" if do() else b"no"
        except OSError as error:
            answer = f"{error.errno or errno.EIO}:{error.strerror or error}: {error.filename}".encode()
        except BaseException as error:  # noqa: BLE001 - this process must end here, whatever happens
            answer = f"{errno.EIO}:{type(error).__name__}: {error}".encode()
        os.write(writes, answer[: select.PIPE_BUF])
        os._exit(0)
    os.close(writes)
    with open(reads, "rb") as pipe:
        answer = pipe.read()
    os.waitpid(child, 0)
    if answer in (b"yes", b"no"):
        return answer == b"yes"
    number, _, text = answer.decode(errors="replace").partition(":")
    raise OSError(int(number or errno.EIO), text or "the process of that user has died")


def _become(account: pwd.struct_passwd) -> None:
    """Root gives up all that it has; a user who installs for himself stays who he is."""
    if os.geteuid() != account.pw_uid:
        os.setgroups([])
        os.setgid(account.pw_gid)
        os.setuid(account.pw_uid)


def _name(action: Action) -> str:
    if isinstance(action, Run):
        return " ".join(action.argv)
    return str(action.folder if isinstance(action, FirstRecords) else action.path)
