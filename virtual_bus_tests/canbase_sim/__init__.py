"""The bench: simulated motor drives and a robot under them, on any python-can bus. Never imports the driver."""
