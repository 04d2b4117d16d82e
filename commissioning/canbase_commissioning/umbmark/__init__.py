"""Calibration by squares in both directions (UMBmark), with the room as the ruler: a scanner sees each stop. Pure."""
