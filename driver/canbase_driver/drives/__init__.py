"""The drives of the base: the group of them, one CANopen node, one axis, raw units, telemetry."""
