"""The frames that stop one node, rung by rung, and those that read whether it stands. Rules: ladder.py."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog import frames
from canbase_watchdog.frames import Frame
from canbase_watchdog.ladder import Braking, LadderPosition, NodeFeedback, Step, advance, first
from canbase_watchdog.slowing import Slope, SlowingWatch
from canbase_watchdog.view import NEVER, Axis, BusView, View

QUICK_STOP_PERIOD_S = 0.01
NMT_PERIOD_S = 0.05
SDO_PERIOD_S = 0.01
"""One SDO request at a time: most drives have a single SDO server that keeps one request."""
REQUESTS = 4
"""Of one axis in a turn: the controlword is written; statusword, position and velocity are read."""
IDLE_SDO_PERIOD_S = 0.05
STALE_S = 0.02
"""While it is stopped, feedback that is older is read: two cycles, or an SDO's way to and fro."""
RESET_PERIOD_S = 1.0
"""A drive needs this long to restart [s]."""
AGAIN_S = 0.5
"""A stopped node that sends nothing is read again after this time, while no master configures it ..."""
FRESH_S = 1.5
"""... and a reset needs a look at it that is no older: two motors take 0.3 s."""
DRIVER_MISSED = 0.5
"""Of drive_heartbeat_s, in which a driver sends three heartbeats: without one for this long none is there."""
SEEK_PERIOD_S = 0.5
"""A node of which nothing is known after the start is read this seldom: tools find the SDO channel free ..."""
SOUGHT_OFTEN = 20
"""... but for the first readings of one that is NMT operational: a second of them, some may be lost."""

_WORD_BY_STEP = {
    Step.PRE_OPERATIONAL: frames.QUICK_STOP_WORD,
    Step.DISABLE_VOLTAGE: frames.DISABLE_VOLTAGE_WORD,
    Step.HEARTBEAT_WITHHELD: frames.DISABLE_VOLTAGE_WORD,
    Step.RESET_NODE: frames.DISABLE_VOLTAGE_WORD,
}


class Stopper:
    """Stops one node and keeps it stopped, from the trip until the reset."""

    def __init__(
        self,
        node_id: int,
        config: WatchdogConfig,
        view: View,
        now_s: float,
        trusted: bool = True,
        resting: bool = False,
    ) -> None:
        """Begins at the foot of the ladder at the monotonic time `now_s` [s]; without `trusted`, a sensor lied.

        `resting`: for a trip of before the start. A drive that is off is left alone, so that it can be booted; one that
        has power or moves is stopped. One that sends nothing is read, unless a driver boots it.
        """
        self._node_id = node_id
        self._config = config
        self._braking = Braking.of(config)
        self._trusted = trusted
        self._resting_since = now_s if resting else math.inf
        drives = [drive for drive in config.drives if drive.node_id == node_id]
        self._layout, self._axis_count = drives[0].layout, len(drives)
        self._stale_s = min(config.feedback_timeout_s, max(STALE_S, 2.0 / config.control_hz))
        self._slopes = [Slope.of(config, drive.velocity_mps_per_bit) for drive in drives]
        self._slowing: list[SlowingWatch] = []
        self._bus: BusView | None = None
        """What it has looked at; None: it looks again."""
        self._begin_slowing(now_s)
        self._feedback = self._node_feedback(view)
        foot = first(self._feedback, now_s)
        self.ladder: LadderPosition = replace(foot, stopped=resting, stopped_at=now_s, assumed=resting and not trusted)
        self._quick_stop_at = self._nmt_at = self._sdo_at = self._reset_at = NEVER
        self._sdo_turn = 0

    @property
    def settled(self) -> bool:
        """True when the node stands and is off or held, by its feedback, or when there is no such node."""
        return (self.ladder.stopped and self._feedback.seen_at > self.ladder.since) or not self._feedback.present

    def is_fresh(self, now_s: float) -> bool:
        """Whether that evidence came in the last moments: a wheel that was stopped may roll again, or may have rolled
        unseen. A node that never sent a frame sends none now."""
        return now_s < self._feedback.seen_at + FRESH_S or not self._feedback.present

    def tick(self, view: View, now_s: float) -> list[Frame]:
        """Look at the node, climb where the rules demand it, and return the frames that are due."""
        if view.bus is not self._bus:
            self._bus = view.bus
            self._sample_slowing(view)
            self._feedback = self._node_feedback(view)
        before = self.ladder
        self.ladder = advance(before, self._feedback, self._braking, now_s)
        brakes_already = self.ladder.step is Step.PRE_OPERATIONAL and not self._feedback.enabled
        if self.ladder.since > before.since and not brakes_already:
            self._begin_slowing(now_s)
        if self.ladder.step is not before.step:
            self._quick_stop_at = self._nmt_at = self._sdo_at = NEVER
            self._sdo_turn = 0
        defied = self._defied(view, now_s)
        out: list[Frame] = []
        if not self.ladder.stopped or defied:
            # The PDO first: pre-operational makes the node deaf to it.
            out += self._stop_word(now_s) + self._reset_node(now_s) + self._pre_operational(now_s)
        return out + self._sdo(view, defied, now_s)

    def _begin_slowing(self, now_s: float) -> None:
        """A rung begins now. A drive that is braking by its own ramp goes on with it when nothing but NMT changes."""
        self._slowing, self._bus = [SlowingWatch(slope, now_s) for slope in self._slopes], None

    def _sample_slowing(self, view: View) -> None:
        for at, axis in enumerate(self._axes(view)):
            self._slowing[at].on_sample(axis.velocity_mps, axis.powered, axis.velocity_at)

    def _axes(self, view: View) -> list[Axis]:
        return [axis for axis in view.axes if axis.drive.node_id == self._node_id]

    def _node_feedback(self, view: View) -> NodeFeedback:
        axes = self._axes(view)
        node = view.node(self._node_id)
        seen_at = min(axis.seen_at for axis in axes)
        return NodeFeedback(
            enabled=any(axis.enabled for axis in axes),
            powered=any(axis.powered for axis in axes),
            standing=self._is_unreported(axes) or all(self._stands(axis) for axis in axes),
            speed_mps=max(abs(axis.velocity_mps) for axis in axes),
            begin_mps=max(self._begin_mps(axis) for axis in axes),
            seen_at=seen_at,
            present=node.last_frame_at > NEVER or any(axis.asks_for_power for axis in axes),
            trusted=self._trusted and all(axis.trusted for axis in axes),
            unslowed=any(watch.fails for watch in self._slowing),
            reading_s=self._axis_count * REQUESTS * SDO_PERIOD_S,
        )

    def _is_unreported(self, axes: Sequence[Axis]) -> bool:
        """Since the start a part of its state is not known: neither that it moves, nor that it is stopped.

        A statusword with power, or a velocity, is enough to stop it, whichever client requested the value.
        """
        if self._resting_since == math.inf:
            return False
        seen_at, noise_mps = min(axis.seen_at for axis in axes), self._config.motion_tolerance_mps
        reported = any(axis.powered or abs(axis.velocity_mps) > noise_mps for axis in axes)
        return seen_at <= self._resting_since and not reported

    def _stands(self, axis: Axis) -> bool:
        """Standing takes several samples to prove. Until then a drive that was found off is not stopped in vain.

        One that stopped as no wheel can is looked at again, until it is trusted no more.
        """
        off = self._resting_since < math.inf and not axis.powered
        sudden = axis.sudden and axis.trusted and not axis.enabled
        return (axis.standing and not sudden) or (off and abs(axis.velocity_mps) <= self._config.standstill_mps)

    def _begin_mps(self, axis: Axis) -> float:
        """How fast it may get before it begins to brake: towards its setpoint, for as long as the drive lags."""
        speed_mps, config = abs(axis.velocity_mps), self._config
        gain_mps = config.acceleration_mps2 * config.drive_lag_s
        return max(speed_mps, min(abs(axis.target_mps), speed_mps + gain_mps))

    def _defied(self, view: View, now_s: float) -> bool:
        """Somebody goes on commanding motion."""
        recent = now_s - self._config.lease_timeout_s
        return any(axis.command_at > recent and axis.target_mps != 0.0 for axis in self._axes(view))

    def _stop_word(self, now_s: float) -> list[Frame]:
        """By the PDO that is the watchdog's own: quick stop, from the rung of that name on disable voltage."""
        if now_s < self._quick_stop_at + QUICK_STOP_PERIOD_S:
            return []
        self._quick_stop_at = now_s
        off = self.ladder.step >= Step.DISABLE_VOLTAGE
        order = frames.disable_voltage if off else frames.quick_stop
        return [order(self._node_id, self._axis_count, self._layout)]

    def _reset_node(self, now_s: float) -> list[Frame]:
        """Once, and again where the drive reports after it that it still has power. No other one is made to boot."""
        has_power = self._feedback.powered and self._feedback.seen_at > self._reset_at
        if self.ladder.step < Step.RESET_NODE or not has_power or now_s < self._reset_at + RESET_PERIOD_S:
            return []
        self._reset_at = now_s
        return [frames.reset_node(self._node_id)]

    def _pre_operational(self, now_s: float) -> list[Frame]:
        if self.ladder.step < Step.PRE_OPERATIONAL or now_s < self._nmt_at + NMT_PERIOD_S:
            return []
        self._nmt_at = now_s
        return [frames.pre_operational(self._node_id)]

    def _sdo(self, view: View, defied: bool, now_s: float) -> list[Frame]:
        """The next request in turn. A stopped node that sends feedback, or is configured, is left alone."""
        if now_s < self._sdo_at + (IDLE_SDO_PERIOD_S if self.ladder.stopped else SDO_PERIOD_S):
            return []
        rests = self.ladder.stopped and not defied
        seeks = rests and self._is_unknown(view, now_s)
        seldom = seeks and (not view.node(self._node_id).operational or self._sdo_turn >= SOUGHT_OFTEN)
        stopped_s = SEEK_PERIOD_S if seldom else IDLE_SDO_PERIOD_S
        period_s = stopped_s if self.ladder.stopped else SDO_PERIOD_S
        if now_s < self._sdo_at + period_s or (rests and not seeks and not self._is_old(view, now_s)):
            return []
        requests = self._requests(view, now_s)
        if not requests:
            return []
        self._sdo_at = now_s
        self._sdo_turn += 1
        return [requests[(self._sdo_turn - 1) % len(requests)]]

    def _is_unknown(self, view: View, now_s: float) -> bool:
        """Since the start it has not told its state, and no driver boots it: it may turn as it did before the start.

        One that is NMT operational was started by a driver, and has told nothing for as long as SYNCs would take: it
        may have power, and nobody needs its SDO channel. Nor where no driver sends heartbeats. Any other one may be
        booted within a heartbeat's time.
        """
        node, since, booted_s = view.node(self._node_id), self._resting_since, self._config.drive_heartbeat_s
        if now_s < node.configured_at + booted_s or not self._is_unreported(self._axes(view)):
            return False
        waits_s = min(self._config.feedback_timeout_s, booted_s) if node.operational else booted_s
        is_alone = now_s >= max(since, view.bus.driver_at) + DRIVER_MISSED * booted_s
        return is_alone or now_s >= since + waits_s

    def _is_old(self, view: View, now_s: float) -> bool:
        """It sent feedback once, and not recently; and no other client needs its SDO channel."""
        reported_at, quiet_since = self._feedback.seen_at, view.node(self._node_id).configured_at
        return reported_at > NEVER and now_s >= max(reported_at, quiet_since) + AGAIN_S

    def _requests(self, view: View, now_s: float) -> Sequence[Frame]:
        """Writes of this rung, and readings of what TPDOs do not carry (no SYNC, or pre-operational)."""
        word = None if self.ladder.stopped else _WORD_BY_STEP.get(self.ladder.step)
        requests: list[Frame] = []
        for axis in self._axes(view):
            number = axis.drive.axis
            if word is not None:
                requests.append(frames.write_controlword(self._node_id, number, word, self._layout))
            stale_s = self._config.feedback_timeout_s if self.ladder.stopped else self._stale_s
            if word is not None or now_s >= axis.seen_at + stale_s:
                requests += frames.read_feedback(self._node_id, number, self._layout)
        return requests
