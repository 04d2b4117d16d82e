"""The process: its threads, the bus, recordings to disk."""
