"""When the drives may have power and what takes it away: state machine, reset, lifecycle, the watchdog, latch."""
