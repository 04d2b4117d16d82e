"""When the drives may have power and what takes it away: supervisor, reset, lifecycle, the watchdog, latch."""
