"""One CANopen node of the base at run time: its NMT state and heartbeat, its emergency messages, its boot, its axes.

GONE ──begin_boot──► BOOTING ──boot report──► STARTING ──operational, all axes seen───► READY
  ▲                     │ error                  │ too late, or boot-up received          │
  └─────────────────────┴────────────────────────┴── boot-up or other NMT state received ─┘

Between boot report and NMT start it waits for the other nodes' boots: PDOs go before SDOs on the bus.

Frames of a node before it is STARTING come from an earlier life, with a layout of its own: none of them counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from enum import Enum

from canbase_config.profile import Profile
from canbase_config.robot import Robot
from canbase_driver.boot.advice import ELSE_UNUSABLE, GUARDING_ALONE
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.boot.sequence import BootReport
from canbase_driver.boot.steps import BootTimes
from canbase_driver.cia301.emcy import Emcy, parse_emcy
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import ALL_NODES, NmtCommand, NmtState, nmt, parse_heartbeat
from canbase_driver.cia301.node_guarding import GuardAnswers, without_toggle
from canbase_driver.cia301.pdo import node_layout
from canbase_driver.cia402 import DriveState, PowerGoal, common_controlword, next_controlword
from canbase_driver.drives.axis import Axis
from canbase_driver.drives.drive_values import DriveValues, NamedValue
from canbase_driver.drives.foreign_writes import ForeignWrites, WritesInBoot
from canbase_driver.drives.sdo_stop import SdoStop
from canbase_driver.drives.signs_of_life import SignsOfLife
from canbase_driver.drives.telemetry import Measures, Values

START_TIMEOUT_S = 1.0
"""From NMT start to a heartbeat "operational" and a status of every axis."""
HEARTBEAT_S = 5.0
"""From NMT start to its first heartbeat, where nothing else is missing: another boot would reset it again [s]."""
HOLD_S = 0.2
"""After the last NMT "enter pre-operational" it is left alone this long [s]; the watchdog repeats it every 0.05 s."""
HELD = (
    "NMT commands keep it pre-operational: the watchdog's while it stops drives that still turn, or those of another "
    "master (canbase bus scan), which must end"
)
RETRY_S = 1.0
"""Between two boots of a node that failed."""
UNHEARD_S = 1.0
"""Of a node that has answered no request of its boot for this long, the message names what it sent, and a cure [s]."""
SEEK_S = 1.0
"""A node without messages for this long while nothing has power is booted again [s]: its boot-up may be lost."""
SECOND_BOOT_UP_S, ALIKE, SETTLE_FACTOR, SETTLE_EXTRA_S = 3.0, 0.3, 1.3, 0.2
"""A boot-up message so soon after the one that answered the NMT reset may be a second one of the same start. When it
comes again after the next boot, as late but for this share, the boots after that wait for it: that time, times the
factor, and the extra. Once alone it is a drive that lost its supply."""
NO_HEARTBEAT = f"no heartbeat (1017h; {GUARDING_ALONE})"
NO_ANSWER = (
    "no answer to a node guarding request of the watchdog: start canbase serve watchdog. If it runs, its CAN adapter "
    "or the drive has no remote frames (RTR): use another adapter, or set self_stop.node_guarding: false in its drive "
    "profile, and the drive does not stop when this computer fails"
)
RESET_FACTOR, RESET_EXTRA_S, LONGEST_RESET_S = 1.3, 0.5, 30.0
"""A boot-up message, or a first answer, so long after an NMT reset that a boot did not wait for it [s]: the next boot
waits that time, times the factor, and the extra. Later it is a drive that lost its supply."""
NO_TOGGLE = "node guarding answers whose toggle bit never changes: it goes on to send heartbeats (1017h), or hangs"
BUS_LOST = (0x8120, 0x8130, 0x8140)
"""Emergency codes for a lost bus or heartbeat (CiA 301): error passive, heartbeat or life guarding, bus-off."""


class Presence(Enum):
    """How far a node is; see the drawing at the head of this file."""

    GONE = "gone"
    BOOTING = "booting"
    STARTING = "starting"
    READY = "ready"


class CanopenNode:
    """A node and its one or two axes."""

    def __init__(self, node_id: int, robot: Robot, *, identify: bool = False) -> None:
        """`identify`: its report shall have all of 1018h, whatever robot.yaml expects."""
        self.node_id = node_id
        self._identify = identify
        self._robot = robot
        self._drives = tuple(drive for drive in robot.drives if drive.node_id == node_id)
        self.layout = node_layout(node_id, self._drives, robot)
        self.axes = tuple(Axis(drive, self.layout, robot) for drive in self._drives)
        self.presence = Presence.GONE
        self.nmt_state: NmtState | None = None
        self.heartbeat_at = -math.inf
        """When its last heartbeat came, or its last answer to a node guarding request that counts."""
        self._guarded = GuardAnswers() if self.profile.self_stop.node_guarding else None
        self.emcy: Emcy | None = None
        self.report: BootReport | None = None
        """Of the last boot, while the node is there."""
        self.boot_error = self.unshown_mode = ""
        """What its last boot that ended well noted about a mode that 6061h did not show; empty: nothing."""
        self.others_are_configured: Callable[[], bool] = lambda: True
        """Whether no other node is in the middle of its boot; set by the drive group."""
        self._measures = Measures(node_id, self._drives, robot.timeouts.sdo_s)
        self._values = DriveValues(self.layout.values, self.layout.timing.cycle_s)
        self._sdo_stop = SdoStop(node_id, self._drives)
        self._foreign = ForeignWrites()
        self._in_boot = WritesInBoot(self._foreign)
        self._signs = SignsOfLife()
        self._written = ""
        """What another client has written since the boot has dealt with it; empty: nothing of what the boot sets."""
        self._lost_heartbeat = self._owed_stop = False
        self._held_until = -math.inf
        self._ready_at = math.inf
        """When it was ready last; before that, when it was looked at first. Infinity until then."""
        self._boot: NodeBoot | None = None
        self._boot_up_at = -math.inf
        self._second_s = math.inf
        """From the boot-up message of the last boot to a second one [s]; infinity: there was none."""
        self._learned = BootTimes()
        self._reset_at = -math.inf
        """When an NMT reset was sent that nothing has answered yet [s]; minus infinity: there is none."""
        self._since_s = -math.inf
        self._why_gone = "not booted yet"

    @property
    def name(self) -> str:
        """ "node 1 (left_wheel_joint)" """
        return f"node {self.node_id} ({', '.join(drive.joint for drive in self._drives)})"

    @property
    def profile(self) -> Profile:
        """What is known of its kind."""
        return self.layout.profile

    @property
    def has_pdos(self) -> bool:
        """It was configured and started: setpoints may be sent to it, and its feedback counts."""
        return self.presence is Presence.READY or self.presence is Presence.STARTING

    @property
    def takes_pdos(self) -> bool:
        """`has_pdos`; or it had power when it was lost, and nothing has shown since that its motors have none: NMT
        does not show that, and it may obey its PDOs still. Until its boot begins, which stops it by SDO."""
        return self.has_pdos or self._owed_stop

    @property
    def _sends_pdos(self) -> bool:
        """Of one that was lost in any other NMT state than operational none can come (CiA 301): a device with the same
        node id sends them, and shows nothing of this drive's motion."""
        return self.has_pdos or (self._owed_stop and self.nmt_state in (None, NmtState.OPERATIONAL))

    def is_off(self, now_s: float) -> bool:
        """Every axis reports, in a fresh statusword, that it has no torque."""
        fresh_s = self._robot.timeouts.feedback_s
        axes = self.axes
        return all(now_s - axis.status_at <= fresh_s and axis.state and not axis.state.has_torque for axis in axes)

    @property
    def is_being_configured(self) -> bool:
        """It has answered, and its boot fills the bus with SDOs."""
        return self._boot is not None and self._boot.configuring

    @property
    def transfers(self) -> int:
        """How many SDO transfers its boot has begun."""
        return self._boot.transfers if self._boot is not None else 0

    def is_transferring(self, now_s: float) -> bool:
        """Its boot has a transfer to make, and the drive answers."""
        return self._boot is not None and self._boot.is_transferring(now_s)

    @property
    def _is_configured(self) -> bool:
        """Its boot has ended well, and it is not started yet."""
        return self._boot is not None and self._boot.report is not None

    def waiting_for(self, now_s: float) -> str:
        """What keeps it from being ready; empty when it is, or when it is gone and not being booted."""
        if self._is_configured:
            return f"{self.name}: configured, waits for the boots of the others"
        if self.presence is Presence.BOOTING and self._boot is not None:
            cure = f"; {self._signs.what_to_check(now_s)}" if self._is_absent(now_s) else ""
            return self._boot.waiting_for + cure + (f" (last try: {self.boot_error})" if self.boot_error else "")
        if self.presence is Presence.STARTING and self.boot_error:
            return f"{self.name}: {self.boot_error}"
        if self.presence is Presence.STARTING:
            return f"{self.name}: waiting for its first feedback since {now_s - self._since_s:.1f} s"
        return ""

    def missing(self, now_s: float) -> str:
        """Why it is not ready though it had timeouts.boot_s for it; empty when it is, has time left, or waits for the
        boots of the others."""
        in_time = now_s - self._ready_at <= self._robot.timeouts.boot_s
        is_there = self.has_pdos and not self.boot_error
        if self.presence is Presence.READY or in_time or self._is_configured or is_there:
            return ""
        since_s = now_s - self._ready_at
        if self._boot is not None and self._boot.is_present and not self.boot_error:
            done = f"its boot has done {self._boot.transfers} SDO transfers in {now_s - self._since_s:.0f} s"
            slow = self._boot.slow_answers
            return (
                f"{self.name} is not ready since {since_s:.0f} s: {done}, and goes on; "
                f"a drive that needs so long: timeouts.boot_s of robot.yaml{'; ' * bool(slow)}{slow}"
            )
        why = self.boot_error or self._why_gone
        if now_s < self._held_until:
            why = HELD
        elif self._is_absent(now_s) or not self.boot_error:
            why = f"{why.removesuffix('.')}; {self._signs.what_to_check(now_s)}"
        return f"{self.name} is missing since {since_s:.0f} s: {why}"

    def _is_absent(self, now_s: float) -> bool:
        """Its boot has waited for a first answer for UNHEARD_S."""
        return self._boot is not None and not self._boot.is_present and now_s - self._since_s > UNHEARD_S

    def without_self_stop(self) -> str:
        """A sentence when its boot could not set what makes it stop by itself."""
        if self.report is None or self.report.stops_by_itself:
            return ""
        why = "; ".join(self.report.notes) or "nothing was set that does it"
        return f"{self.name}: it would not stop by itself when this computer fails, whatever was proven: {why}"

    def absent(self) -> str:
        """Why it is gone; empty when it is not."""
        return f"{self.name} {self._why_gone}" if self.presence is Presence.GONE else ""

    def silent(self, now_s: float, sync_since: float) -> str:
        """A sentence when its feedback or its heartbeat is too old; only a node that is ready can be too late.

        It answers SYNCs: after a pause of ours it has timeouts.feedback_s from `sync_since` on [s], when the present
        run of SYNCs began. However often we pause, it is late when timeouts.drive_heartbeat_s are over as well.
        """
        if self.presence is not Presence.READY:
            return ""
        timeouts = self._robot.timeouts
        feedback_s = timeouts.feedback_s
        for axis in self.axes:
            if axis.age_s(now_s) <= feedback_s:
                continue
            unasked_s = min(max(0.0, sync_since - axis.fed_at), timeouts.drive_heartbeat_s)
            if axis.age_s(now_s) - unasked_s > feedback_s:
                value = "status (6041h, 6064h)" if axis.status_at <= axis.velocity_at else "velocity (606Ch)"
                return f"{self.name}: no {value} for {axis.age_s(now_s):.2f} s (timeouts.feedback_s {feedback_s:g} s)"
        if now_s - self.heartbeat_at > timeouts.drive_heartbeat_s:
            limit = f"timeouts.drive_heartbeat_s {self._robot.timeouts.drive_heartbeat_s:g} s"
            return f"{self.name}: no heartbeat for {now_s - self.heartbeat_at:.2f} s ({limit})"
        return ""

    def begin_boot(self, now_s: float) -> None:
        """Boot it (again). Does nothing while a boot runs, within RETRY_S after a failed one, and
        while the watchdog's ladder holds it: a boot would work against that.
        """
        too_soon = self.boot_error and now_s - self._since_s < RETRY_S
        if self.presence is not Presence.GONE or too_soon or now_s < self._held_until:
            return
        self._boot = NodeBoot(self.node_id, self._drives, self._robot, self._learned, identify=self._identify)
        self._boot_up_at = -math.inf
        self._owed_stop = False
        self._written, self._in_boot = "", WritesInBoot(self._foreign)
        self._go(Presence.BOOTING, now_s)

    def seek(self, now_s: float, sync_since: float) -> None:
        """Boot a node again that was ready and sent nothing for SEEK_S: it may answer an SDO. Only without power.

        `sync_since`: start of the present run of SYNCs [s]; before it the node had none to answer.
        """
        if self.presence is not Presence.READY:
            return
        last_sign_at = min(self.heartbeat_at, *(axis.status_at for axis in self.axes))
        if now_s - max(last_sign_at, self._since_s, sync_since) > SEEK_S:
            self.lose(f"gave no sign for {now_s - last_sign_at:.1f} s and is looked for", now_s)

    def lose(self, why: str, now_s: float) -> None:
        """It must be booted again before it counts: `why` completes the sentence that begins with its name."""
        had_power = self.has_pdos and any(axis.has_torque for axis in self.axes)
        self._owed_stop = had_power or self._owed_stop
        for axis in self.axes:
            axis.forget()
        self._values.forget()
        self._why_gone = why
        self._boot = self.report = None
        self._go(Presence.GONE, now_s)

    def release(self, now_s: float) -> None:
        """It is not ours any more until it is booted again; what it failed in before is forgotten."""
        self.lose("is not configured", now_s)
        self.boot_error, self._ready_at = "", math.inf

    def clear_lost_heartbeat(self, now_s: float) -> None:
        """Some drives keep a fault for a lost heartbeat or bus until an NMT reset, which a boot brings."""
        faulty = any(axis.state is DriveState.FAULT for axis in self.axes)
        if self.profile.heartbeat_fault == "reset_communication" and self._lost_heartbeat and faulty:
            self.lose("is reset: it is in fault for a lost heartbeat", now_s)

    def forget_emcy(self) -> None:
        """What it reported before a reset is no news any more."""
        self.emcy = None
        self._lost_heartbeat = False

    def measured(self, axis: Axis, now_s: float) -> Values:
        """Voltage, current and temperature of one of its axes."""
        return self._measures.values(axis.drive.axis, now_s)

    def named_values(self, now_s: float) -> tuple[NamedValue, ...]:
        """What robot.yaml wants published of it."""
        return self._values.values(now_s)

    def on_values(self, number: int, frame: Frame, now_s: float) -> bool:
        """Take a spare TPDO, counted from 0. False: not understood."""
        return not self.has_pdos or self._values.on_frame(number, frame.data, now_s)

    def emcy_text(self) -> str:
        """Its last emergency message in words; empty: none."""
        return self.emcy.text_with(self.profile.emcy) if self.emcy else ""

    def setpoints(self, goal: PowerGoal, left_mps: float, right_mps: float) -> list[Frame]:
        """The setpoint of each axis, one step towards `goal`; speeds of the rims, forward positive [m/s]."""
        words = self.controlwords(goal)
        return [
            axis.setpoint(goal, left_mps if axis.is_left else right_mps, words[at]) for at, axis in enumerate(self.axes)
        ]

    def stop_by_sdo(self, goal: PowerGoal, now_s: float) -> list[Frame]:
        """Controlwords and speeds by SDO while it takes no PDOs; it may have left NMT operational, motors turning."""
        return [] if self.has_pdos else self._sdo_stop.frames(self.controlwords(goal), now_s)

    def controlwords(self, goal: PowerGoal) -> list[int]:
        """6040h of each of its axes, one step towards `goal`; motors that share one get the same."""
        if self.profile.layout.controlword == "own":
            return [next_controlword(axis.state, goal) for axis in self.axes]
        return [common_controlword([axis.state for axis in self.axes], goal)] * len(self.axes)

    def on_heartbeat(self, frame: Frame, now_s: float) -> bool:
        """Take a frame 700h + id. False: neither a heartbeat nor an answer to node guarding that counts."""
        heartbeat = without_toggle(frame) if self._guarded is None else self._guarded.take_answer(frame)
        parsed = None if heartbeat is None else parse_heartbeat(heartbeat)
        if heartbeat is None or parsed is None or parsed[1] is None:
            return False
        self.heartbeat_at = now_s
        awaited = self._reset_at > -math.inf or (self._boot is not None and self._boot.reset_at > -math.inf)
        self._signs.on_heartbeat(parsed[1], now_s, of_reset=awaited)
        self._on_nmt_state(parsed[1], heartbeat, now_s)
        return True

    def _on_nmt_state(self, state: NmtState, heartbeat: Frame, now_s: float) -> None:
        self.nmt_state = state
        if (self.has_pdos or self._is_configured) and state is NmtState.INITIALISING:
            self.emcy = None
            self.lose(f"restarted (boot-up message){self._learn_to_settle(now_s)}", now_s)
        elif self.presence is Presence.READY and state is not NmtState.OPERATIONAL:
            self.lose(f"left NMT operational ({state.text})", now_s)
        elif self._boot is not None:
            self._boot.on_frame(heartbeat, now_s)
            if self._boot.error is not None and state is NmtState.INITIALISING:
                self._boot_up_at = self._boot.boot_up_at
                self._learn_to_settle(now_s)
        if state is NmtState.INITIALISING and self._reset_at > -math.inf:
            self._learn_to_wait("its boot-up message came", now_s)

    def _learn_to_settle(self, now_s: float) -> str:
        """A second boot-up message of one start: the next boot waits for it. What to add to a sentence about it."""
        gap_s = now_s - self._boot_up_at
        before_s, self._second_s = self._second_s, gap_s if gap_s <= SECOND_BOOT_UP_S else math.inf
        if self._second_s == math.inf:
            return ""
        gap = f", {gap_s:.2f} s after that of its boot"
        if abs(gap_s - before_s) > ALIKE * gap_s:
            return f"{gap}; if it does so after each boot, set start.settle_s in its drive profile"
        settle_s = SETTLE_FACTOR * gap_s + SETTLE_EXTRA_S
        self._learned = replace(self._learned, settle_s=max(self._learned.settle_s, settle_s))
        return f"{gap}, again; the next boot waits for it (drive profile: start.settle_s)"

    def _learn_to_wait(self, came: str, now_s: float) -> None:
        """Something of a node that a boot has reset in vain: the next boot waits for its reset."""
        took_s, self._reset_at = now_s - self._reset_at, -math.inf
        if took_s <= LONGEST_RESET_S:
            boot_up_s = max(self._learned.boot_up_s, RESET_FACTOR * took_s + RESET_EXTRA_S)
            self._learned = replace(self._learned, boot_up_s=boot_up_s)
            cure = f"set `start.boot_up_s: {boot_up_s:.1f}` in its drive profile; the next boot waits as long"
            self.boot_error = f"node {self.node_id}: {came} {took_s:.1f} s after an NMT reset: {cure}"

    def on_nmt(self, frame: Frame, now_s: float) -> None:
        """Take an NMT command (000h) that is on the bus: somebody keeps it pre-operational."""
        if frame.data in (bytes((NmtCommand.ENTER_PRE_OPERATIONAL, node)) for node in (ALL_NODES, self.node_id)):
            self._held_until = now_s + HOLD_S

    def on_status(self, axis: Axis, frame: Frame, now_s: float) -> bool:
        """Take 6041h and 6064h of one of its axes, and 606Ch where it is behind them. False: not understood."""
        return not self._sends_pdos or axis.on_status(frame.data, now_s)

    def on_velocity(self, axis: Axis, frame: Frame, now_s: float) -> bool:
        """Take 606Ch of one of its axes. False: not understood."""
        return not self._sends_pdos or axis.on_velocity(frame.data, now_s)

    def on_emcy(self, frame: Frame, now_s: float) -> bool:
        """Take a frame 080h + id. False: not an emergency message. It informs; only the statusword stops anything."""
        emcy = parse_emcy(frame)
        if emcy is None:
            return False
        self._signs.on_emcy(now_s)
        self.emcy = None if emcy.is_reset else emcy
        self._lost_heartbeat |= emcy.code in BUS_LOST  # some take the message back, and stay in fault
        return True

    def on_sdo(self, frame: Frame, now_s: float) -> bool:
        """Take an SDO answer. One without a request of ours is another client's, such as a tool's: where it confirms a
        write, the node is booted anew once it has no power."""
        self._signs.on_sdo(frame, now_s)
        if self._boot is not None:
            self._in_boot.take_sdo_answer(frame, self._boot)
            self._boot.on_frame(frame, now_s)
            return True
        self._written = self._foreign.take_sdo_answer(frame) or self._written
        if self.presence is Presence.READY:
            self._measures.on_frame(frame, now_s)
        elif (speed := self._sdo_stop.speed(frame)) is not None:
            self.axes[speed[0]].on_speed(speed[1], now_s)
        return True

    def tick(self, now_s: float) -> list[Frame]:
        """Let the boot go on, or request the next measured value. The frames to send."""
        if self.presence is Presence.READY or self._ready_at == math.inf:
            self._ready_at = now_s
        if self.presence is Presence.STARTING:
            self._check_started(now_s)
        if self._written and self.has_pdos and self.is_off(now_s):
            who = "another client, or a gateway that repeats answers,"
            self.lose(f"is configured anew: {who} has written its {self._written}", now_s)
        if self._boot is None:
            return self._measures.tick(now_s) if self.presence is Presence.READY else []
        frames = self._boot.tick(now_s)
        if self._boot.is_present and self._reset_at > -math.inf:
            self._learn_to_wait("it answered", now_s)
        if self._boot.error is not None:
            self._note_reset(self._boot, now_s)
            why_not_yet = self._why_not_yet(self._boot, now_s) if self._boot.error.may_pass else ""
            self.boot_error = f"{self._boot.error}{why_not_yet}"
            self.lose(f"could not be booted: {self.boot_error}", now_s)
        elif self._boot.report is not None and self.others_are_configured():
            frames.append(self._start(self._boot.report, now_s))
        return frames

    def _why_not_yet(self, boot: NodeBoot, now_s: float) -> str:
        """A sentence, with a space before it, about a drive that may not have started yet; empty: it has had its time.

        Aborts do not end its NMT reset: a drive may refuse all requests until its boot-up message.
        """
        if boot.reset_at == -math.inf:
            return self._signs.may_be_starting(now_s)
        return (
            f" Its NMT reset was {now_s - boot.reset_at:.1f} s ago, and its boot-up message has not come: it may take "
            "longer, and the boot learns how long (start.boot_up_s of its drive profile)."
        )

    def _note_reset(self, boot: NodeBoot, now_s: float) -> None:
        """A boot has failed. That of a node that its NMT reset was too long for waits longer the next time."""
        if boot.reset_at == -math.inf:
            return
        self._reset_at = boot.reset_at
        if self.nmt_state is NmtState.INITIALISING and self.heartbeat_at > boot.reset_at:
            self._learn_to_wait("its boot-up message came", self.heartbeat_at)

    def _start(self, report: BootReport, now_s: float) -> Frame:
        self._boot_up_at = self._boot.boot_up_at if self._boot is not None else -math.inf
        self.report, self.unshown_mode = report, report.unshown_mode
        self._lost_heartbeat = False
        if self._boot is not None:
            self._written = self._in_boot.left_by(self._boot)
        self._boot = None
        self.nmt_state = None
        self._guarded = None if self._guarded is None else GuardAnswers()
        for axis in self.axes:
            axis.factor.forget()
            axis.travel.reset_reference()  # to what came since it was lost: another drive of this id may have sent it
        self._go(Presence.STARTING, now_s)
        return nmt(NmtCommand.START, self.node_id)

    def _check_started(self, now_s: float) -> None:
        fed = all(axis.age_s(now_s) <= self._robot.timeouts.feedback_s for axis in self.axes)
        guarded = self._guarded is None or self._guarded.alternates
        if fed and guarded and self.nmt_state is NmtState.OPERATIONAL:
            self.boot_error = ""
            self._go(Presence.READY, now_s)
        elif now_s - self._since_s > START_TIMEOUT_S:
            waited_s = HEARTBEAT_S if now_s - self._since_s > HEARTBEAT_S else START_TIMEOUT_S
            self.boot_error = f"within {waited_s:.1f} s of NMT start it sent {self._not_started(now_s)}"
            if fed and (self._awaits_guard or (self.nmt_state is None and now_s - self._since_s <= HEARTBEAT_S)):
                return  # it sends feedback: another boot would bring no watchdog that sends requests
            self.lose(f"could not be started: {self.boot_error}", now_s)

    @property
    def _awaits_guard(self) -> bool:
        """It was started, and lacks nothing but answers to requests."""
        if self._guarded is None or self._guarded.alternates:
            return False
        return self.nmt_state is None or self.nmt_state is NmtState.OPERATIONAL

    def _not_started(self, now_s: float) -> str:
        """What a node that was started has not sent, and what that may come from. It has answered SDOs until then."""
        lacking = [
            self._misfit(axis)
            or f"no status of {axis.drive.joint} (its TPDOs: see pdo.synchronous of its drive profile)"
            for axis in self.axes
            if axis.age_s(now_s) > self._robot.timeouts.feedback_s
        ]
        if self.nmt_state is None:
            lacking.append(NO_ANSWER if self._guarded is not None else NO_HEARTBEAT)
        elif self.nmt_state is not NmtState.OPERATIONAL:
            kind = "a heartbeat" if self._guarded is None else "an answer to node guarding"
            lacking = [f"{kind} that says {self.nmt_state.text}, not operational: it has not taken NMT start (000h)"]
        elif self._guarded is not None and not self._guarded.alternates:
            lacking.append(NO_TOGGLE)
        notes = self.report.notes if self.report else ()
        return " and ".join(lacking) + (f"; its boot noted: {'; '.join(notes)}" if notes else "")

    def _misfit(self, axis: Axis) -> str:
        """A TPDO that came in another length than its mapping has; empty: none did."""
        if axis.misfit_bytes is None:
            return ""
        which, size = axis.misfit_bytes
        pdo = self.layout.feedback_pdo(axis.drive.axis, which)
        objects = ", ".join(f"{entry >> 16:04X}h:{entry >> 8 & 0xFF}" for entry in pdo.mapping)
        cob_id = f"{pdo.cob_id:03X}h"
        return (
            f"{pdo.name} ({cob_id}) of {axis.drive.joint} with {size} bytes, its mapping has {pdo.size}: let "
            f"{pdo.mapping_object:04X}h map {objects} alone and without padding, with the manufacturer's tool, or find "
            f"the other device that sends {cob_id}; {ELSE_UNUSABLE}"
        )

    def _go(self, presence: Presence, now_s: float) -> None:
        self.presence, self._since_s = presence, now_s
