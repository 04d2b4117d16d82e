"""Whole worlds: a robot.yaml turned into simulated drives on a plant, stepped in virtual or real time."""
