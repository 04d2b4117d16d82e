"""What the campaign proves, a sentence for each property; and what no software can do.

judge.py looks at the properties. Its violations have their names.
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
    "zero": "after the emergency stop nothing is ordered before the command was zero once",
    "obstacle": "the base never touches what it could have seen in time",
    "blind": "where no scanner sees the base is no faster than blind_mps, once that was noticed",
    "odometry": "the driver's pose never jumps, and is the true one as long as the encoders tell the truth",
    "locked": "nothing is ordered while somebody publishes that a lock holds",
    "goal": "every goal ends exactly once, in its time; one that succeeded is where it should be",
    "runaway": "no wheel is faster than it was ordered to be for longer than the stated time",
    "path": "the base turns as it was ordered to, or not at all, but for the stated time",
    "standstill": "what the driver reports as standstill is one",
    "exception": "nothing raises",
}
EXCUSES = {
    "unreachable": "no process has a line to a drive that turns, and it cannot stop by itself: it watches nothing, or "
    "its own quick stop closes its loop on a sensor that lies; only STO stops it. Times count from when it is reached. "
    "A process that hangs for less than watchdog_s is there",
    "scaled": "a wheel whose encoder counts a share of the motion is to every part a smaller wheel; orders are "
    "compared with the motion in the measure of its encoder",
    "strange hands": "who sends setpoints or NMT commands to the drives past all layers asks no watchdog (enabling), "
    "and moves them again after a stop, until that is stopped too (held, neutral: T_react from its begin on); its way "
    "may be longer than the free one (obstacle: unless the filter orders motion into it)",
    "fault reaction": "a drive whose sensor lies, or that does not brake as its settings say, takes no controlword in "
    "its fault reaction (CiA 402-2): as unreachable, until the watchdog has found it, ordered its power off and reset "
    "its node; and while no watchdog reaches it. A wheel that stood may turn again for the time that its lie takes to "
    "be found, all such times of one stop together (held)",
    "cut off": "one drive of several is cut off and turns the base on until its own watch stops it, or, reached again, "
    "a later rung does (held)",
    "overpowered": "a motor that brakes with all its force cannot stop a side that an unreachable drive turns on "
    "(heartbeat: its time counts from when it can)",
    "swing": "a loaded base swings back with the velocity loops of its drives, after the ramp of a stop has ended "
    "(heartbeat, held: SWING_S)",
    "deaf watchdog": "it cannot keep a standing base from starting; driver and drives miss it within T_react from the "
    "begin on (held)",
    "reset by a stranger": "a drive that another master has reset has forgotten 1016h, until its power is off "
    "(heartbeat)",
    "unheard button": "a filter that never heard the button knows of no emergency stop (zero)",
    "unasked": "without a driver there is no SYNC, and no drive tells anything: it is missed first; so is the "
    "watchdog, when a stranger's setpoints move the base (runaway)",
    "ran away": "a wheel whose sensor lies is faster than ordered, or turns the base, for the times of runaway and "
    "path at most, and rolls out without power then; its way may be longer than the free one (obstacle: unless the "
    "filter orders motion into it)",
    "unproven stand": "a drive with a dead encoder may push for stand_impulse_s before it has to let go, and its wheel "
    "rolls out after that: nothing shows it (standstill; neutral: unless the filter orders motion)",
    "no watch": "a drive of a kind that watches neither heartbeats nor setpoints goes on turning (heartbeat)",
}
"""What no software can do, each as a state of the world that is looked at, and never by a fault's name."""
