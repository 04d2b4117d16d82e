"""What the campaign proves, a sentence for each property. judge.py looks at them; its violations have their names.

What no software can do has its rows in excuses.py.
"""

from __future__ import annotations

PROPERTIES = {
    "envelope": "the base is beyond what its leases order for T_react at most, and then brakes",
    "sources": "the base moves only while a source orders it, and for the timeouts of mux and filter and T_react after",
    "neutral": "after a reset the base does not move for a source that ordered motion then and has shown no zero since",
    "latched": "a trip of the watchdog and a latched stop of the driver end by an accepted reset alone, in all lives",
    "held": "after a latched stop, or a requested one, the base brakes, stands, and does not move before the reset",
    "enabling": "no drive gets power without a watchdog that lives and is not tripped",
    "heartbeat": "a drive that hears neither watchdog nor driver stops by itself",
    "estop": "the base stands while the emergency stop is pressed",
    "rest": "while zero is commanded no wheel creeps for longer than the stated time, and a base at rest stays there",
    "pauses": "after a lock, or a second without scans, a joystick that was held moves nothing before it shows zero",
    "zero": "after the emergency stop nothing is ordered before the command was zero once",
    "obstacle": "the base never touches what it could have seen in time",
    "blind": "where no scanner sees the base is no faster than blind_mps, once that was noticed",
    "odometry": "the driver's pose never jumps, and is the true one as long as the encoders tell the truth",
    "locked": "nothing is ordered while somebody publishes that a lock holds",
    "goal": "every goal ends exactly once, in its time; one that succeeded is where it should be",
    "over": "a goal that has ended, or from which a source or a lock took the base, orders no motion later by itself",
    "short": "an emergency stop takes v²/(2·a_emergency) after the reaction, nothing longer",
    "runaway": "no wheel is faster than it was ordered to be for longer than the stated time",
    "path": "the base turns as it was ordered to, or not at all, but for the stated time",
    "standstill": "what the driver reports as standstill is one",
    "exception": "nothing raises",
}
