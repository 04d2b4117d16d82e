"""What a fleet sees of a robot: metrics, and the safety part of the VDA 5050 state. It only reads topics."""
