"""Runs the boot sequence of one node against the bus: frames and the time go in, frames and the result come out."""

from __future__ import annotations

import math
from dataclasses import replace

from canbase_config.drive import Drive
from canbase_config.profile import Sdo
from canbase_config.robot import Robot
from canbase_driver.boot.sequence import BootReport, boot
from canbase_driver.boot.steps import (
    NO_BOOT_TIMES,
    BootError,
    BootTimes,
    Pause,
    Quiet,
    SendNmt,
    Step,
    WaitBootUp,
)
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import NmtCommand, NmtState, nmt, parse_heartbeat
from canbase_driver.cia301.sdo_client import (
    LONGEST_TIMEOUT_S,
    Read,
    SdoClient,
    SdoError,
    Write,
)

DUPLICATES = 3
"""After this many requests that were sent once and answered twice, one may be an answer to another client."""
RESETS = (NmtCommand.RESET_COMMUNICATION, NmtCommand.RESET_NODE)
SLOW_S = 0.05
"""A request without an answer for this long: the drive is slow or gone, and nobody else waits for it [s]."""


class NodeBoot:
    """One boot of one node; for another try make a new one. `drives` are the axes of the node, one or two.

    Give it every frame by `on_frame`, then, and at least every 10 ms, call `tick` and send what it returns. It has
    ended when `report` or `error` is set. One boot takes 45 to 115 SDO transfers an axis: calling `tick` right after
    `on_frame` makes them follow each other without waiting.
    """

    def __init__(
        self,
        node_id: int,
        drives: tuple[Drive, ...],
        robot: Robot,
        learned: BootTimes = NO_BOOT_TIMES,
        *,
        identify: bool = True,
    ) -> None:
        """`learned`, `identify`: see `boot`."""
        self.node_id = node_id
        self.boot_up_at = -math.inf
        """When the boot-up message came that answered the NMT reset [s]; minus infinity: none did."""
        self.reset_at = -math.inf
        """When the NMT reset was sent [s]; minus infinity: none was, or something has answered since."""
        self.report: BootReport | None = None
        self.error: BootError | None = None
        self._name = f"node {node_id} ({', '.join(drive.joint for drive in drives)})"
        self._sequence = boot(node_id, drives, robot, learned, identify=identify)
        self._client = sdo_client(node_id, drives[0].kind.sdo, robot.timeouts.sdo_s)
        self._gap_s = drives[0].kind.sdo.gap_s
        self._held: Read | Write | None = None
        """The next transfer, when it has to keep its distance from the one before."""
        self._step: Step | None = None
        self._wake_at = 0.0
        self._was_reset = False
        self.transfers = 0
        """How many SDO transfers it has begun since it was heard: looking for an absent drive counts for nothing."""
        self._begun_at = 0.0
        self.is_present = False
        """Whether it has answered any request."""
        self._outbox: list[Frame] = []

    @property
    def done(self) -> bool:
        """Whether it has ended, well or not."""
        return self.report is not None or self.error is not None

    @property
    def configuring(self) -> bool:
        """Whether the drive has answered, and its SDOs fill the bus."""
        return not self.done and self.is_present

    def is_transferring(self, now_s: float) -> bool:
        """Whether its next step is an SDO transfer, and the drive answers, or the request still waits to be sent."""
        if not self.configuring or not isinstance(self._step, Read | Write):
            return False
        return bool(self._outbox) or now_s - self._begun_at < SLOW_S

    @property
    def waiting_for(self) -> str:
        """What the node is to do next, for people; empty when the boot has ended."""
        return "" if self.done else f"waiting for {self._name}: {_awaited(self._step)}"

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take a frame from the bus, at `now_s` [s, monotonic]; those of other nodes do nothing."""
        if self.done or self._step is None:
            return
        if parse_heartbeat(frame) == (self.node_id, NmtState.INITIALISING):
            self._on_boot_up(now_s)
        elif self._client.busy:
            self._outbox += self._client.on_frame(frame, now_s)
            self._take_answer(now_s)

    def tick(self, now_s: float) -> list[Frame]:
        """Let time pass until `now_s` [s, monotonic]. The frames to send, in order. The first call begins the boot."""
        if self._step is None:
            if not self.done:
                self._advance(None, now_s)
        elif self._client.busy:
            self._outbox += self._client.tick(now_s)
            self._take_answer(now_s)
        elif now_s >= self._wake_at:
            self._wake(now_s)
        frames, self._outbox = self._outbox, []
        return frames

    def _wake(self, now_s: float) -> None:
        held, self._held = self._held, None
        if held is None:
            self._advance(False, now_s)
        else:
            self._outbox.append(self._client.start(held, now_s))

    def _on_boot_up(self, now_s: float) -> None:
        if isinstance(self._step, WaitBootUp):
            self.boot_up_at, self.reset_at = now_s, -math.inf
            self._advance(True, now_s)
        elif isinstance(self._step, Quiet):
            self._wake_at = now_s + self._step.duration_s
        elif self._was_reset:
            problem = f"it started anew while it was being configured ({_awaited(self._step)} was due)"
            hint = "The boot begins again and waits for a second boot-up message (start.settle_s of its drive profile)"
            if self.reset_at > -math.inf:
                problem = f"its boot-up message came {now_s - self.reset_at:.1f} s after the NMT reset"
                hint = "The boot begins again and waits as long (start.boot_up_s of its drive profile)"
            self._end(error=BootError(self.node_id, problem, f"{hint}; if this goes on, check its supply voltage"))
        elif self._client.busy:
            self._outbox.append(self._client.again(now_s))

    def _take_answer(self, now_s: float) -> None:
        if self._client.duplicates >= DUPLICATES:
            problem = (
                "each request is answered twice: two devices on the bus have this node id, or a gateway repeats it"
            )
            hint = (
                "Give each drive a node id of its own (canbase bus scan names them, canbase bus adopt "
                "sets them). If one drive "
                "alone has it, take out the gateway, the bridge or the second interface that sends frames again"
            )
            self._end(error=BootError(self.node_id, problem, hint))
        if self._client.busy or self.done:
            return
        try:
            answer = self._client.answer()
        except SdoError as error:
            self._advance(error, now_s)
        else:
            self.is_present, self.reset_at = True, -math.inf
            self._advance(answer, now_s)

    def _advance(self, answer: bytes | bool | SdoError | None, now_s: float) -> None:
        self._was_reset = self._was_reset or isinstance(self._step, WaitBootUp)
        try:
            step = self._sequence.throw(answer) if isinstance(answer, SdoError) else self._sequence.send(answer)
        except StopIteration as end:
            self._end(report=end.value)
        except BootError as error:
            self._end(error=error)
        else:
            self._begin(step, now_s)

    def _begin(self, step: Step, now_s: float) -> None:
        self._step = step
        if isinstance(step, Read | Write):
            self.transfers += self.is_present
            self._begun_at = now_s
        if isinstance(step, Read | Write) and self._gap_s > 0.0:
            self._held, self._wake_at = step, now_s + self._gap_s
        elif isinstance(step, Read | Write):
            self._outbox.append(self._client.start(step, now_s))
        elif isinstance(step, SendNmt):
            self.reset_at = now_s if step.command in RESETS else self.reset_at
            self._outbox.append(nmt(step.command, self.node_id))
            self._advance(None, now_s)
        else:
            self._wake_at = now_s + (step.timeout_s if isinstance(step, WaitBootUp) else step.duration_s)

    def _end(self, report: BootReport | None = None, error: BootError | None = None) -> None:
        late = self.slow_answers
        self.report = replace(report, notes=(*report.notes, late)) if report is not None and late else report
        self.error = BootError(self.node_id, error.problem, f"{error.hint}; {late}") if error and late else error
        self._step = None

    def may_confirm(self, at: bytes) -> bool:
        """Whether an answer that confirms a write to this address may be one to a request of this boot.

        None may when it has ended well: then it has all its answers, however long it waits to be started.
        """
        return self.report is None and self._client.may_confirm(at)

    def has_requested(self, at: bytes) -> bool:
        """Whether it has dealt with the object that has this address."""
        return self._client.has_requested(at)

    @property
    def slow_answers(self) -> str:
        """How late it answers, and the key for it; empty: in time."""
        late_s = self._client.late_s
        if not late_s:
            return ""
        timeout_s = min(math.ceil(20.0 * late_s) / 10.0, LONGEST_TIMEOUT_S)
        return f"it answers SDO requests after {late_s:.2f} s: set `sdo.timeout_s: {timeout_s:g}` in its drive profile"


def sdo_client(node_id: int, sdo: Sdo, timeout_s: float) -> SdoClient:
    """A client with the settings of the profile; `timeout_s` [s] where the profile has none."""
    return SdoClient(node_id, sdo.timeout_s or timeout_s, sdo.attempts)


def _awaited(step: Step | None) -> str:
    if isinstance(step, Read | Write):
        return f"the answer to {step}"
    if isinstance(step, WaitBootUp):
        return "its boot-up message"
    if isinstance(step, Quiet):
        return "no further boot-up message"
    return step.until if isinstance(step, Pause) else "the first step"
