"""What the processes of the robot share at run time: the journal, systemd, locks, latch files. No robot.yaml."""
