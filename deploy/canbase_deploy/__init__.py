"""Puts a robot's services onto a Linux with systemd. What they are is in deploy/systemd; how, in docs/services.md."""
