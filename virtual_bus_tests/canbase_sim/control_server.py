"""The simulator's end of the control socket: polled by the loop, never blocks it. The protocol is in `control.py`."""

from __future__ import annotations

import json
import os
import selectors
import socket
from dataclasses import asdict
from pathlib import Path
from typing import Any

from canbase_sim import faults
from canbase_sim.control import ControlError
from canbase_sim.world.bench import Bench
from canbase_sim.world.trace import Trace

LONGEST_REQUEST = 4096
"""A client that sends more bytes without a newline is dropped."""


class _Client:
    """One connection with what it has sent so far, and what it has still to get."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.received = bytearray()
        self.to_send = bytearray()


class ControlServer:
    """Serves `bench` and `trace` at `path`. Raises ControlError when another simulator serves there."""

    def __init__(self, path: Path, bench: Bench, trace: Trace) -> None:
        self._path, self._bench, self._trace = path, bench, trace
        self._selector = selectors.DefaultSelector()
        self._listener = _listen(path)
        self._selector.register(self._listener, selectors.EVENT_READ)

    def close(self) -> None:
        """Hang up on everybody and remove the socket."""
        for waiting in list(self._selector.get_map().values()):
            if isinstance(waiting.fileobj, socket.socket):
                waiting.fileobj.close()
        self._selector.close()
        self._path.unlink(missing_ok=True)

    def poll(self, now_s: float) -> None:
        """Answer the requests that have come."""
        for ready, events in self._selector.select(0):
            if ready.data is None:
                self._accept()
            elif not self._serve(ready.data, events, now_s):
                self._selector.unregister(ready.fileobj)
                ready.data.connection.close()

    def _accept(self) -> None:
        connection, _ = self._listener.accept()
        connection.setblocking(False)
        self._selector.register(connection, selectors.EVENT_READ, _Client(connection))

    def _serve(self, client: _Client, events: int, now_s: float) -> bool:
        """False when the client has gone or sends nonsense without end."""
        try:
            if events & selectors.EVENT_READ and not self._read(client, now_s):
                return False
            if client.to_send:
                del client.to_send[: client.connection.send(client.to_send)]
        except BlockingIOError:
            pass  # the client reads slowly: the rest goes when it can
        except OSError:
            return False
        wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if client.to_send else 0)
        self._selector.modify(client.connection, wanted, client)
        return True

    def _read(self, client: _Client, now_s: float) -> bool:
        data = client.connection.recv(LONGEST_REQUEST)
        client.received += data
        while b"\n" in client.received:
            line, _, rest = client.received.partition(b"\n")
            client.received = rest
            client.to_send += json.dumps(self._answer(bytes(line), now_s)).encode() + b"\n"
        return bool(data) and len(client.received) <= LONGEST_REQUEST

    def _answer(self, line: bytes, now_s: float) -> dict[str, Any]:
        try:
            request = json.loads(line)
        except ValueError as error:
            return {"error": f"one JSON object a line was expected: {error}"}
        match request:
            case {"get": "truth"}:
                return {"truth": asdict(self._bench.truth(now_s))}
            case {"get": "trace", "since": int() | float() as since}:
                return {"trace": self._trace.since(since)}
            case {"fault": {"node": int() as node, "kind": str() as kind, **arguments}}:
                return self._break(node, kind, now_s, {str(k): v for k, v in arguments.items()})
        return {"error": 'expected {"get": "truth"}, {"get": "trace", "since": t} or {"fault": {"node": n, "kind": k}}'}

    def _break(self, node: int, kind: str, now_s: float, arguments: dict[str, Any]) -> dict[str, Any]:
        try:
            faults.apply(self._bench.nodes, node, kind, now_s, arguments)
        except faults.FaultError as error:
            return {"error": str(error)}
        return {"done": kind}


def _listen(path: Path) -> socket.socket:
    """A listening socket at `path`; one that a dead simulator left behind is replaced."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    owner = path.parent.stat().st_uid
    if owner not in (0, os.geteuid()):
        raise ControlError(f"the folder {path.parent} belongs to user {owner}, this is user {os.geteuid()}")
    if path.is_socket():
        _remove_if_dead(path)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        listener.bind(str(path))
    except OSError as error:
        listener.close()
        raise ControlError(f"cannot serve at {path}: {error.strerror}") from error
    path.chmod(0o600)
    listener.listen()
    listener.setblocking(False)
    return listener


def _remove_if_dead(path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
            return
    raise ControlError(f"another simulator serves at {path}; stop it, or give this robot another lease.socket")
