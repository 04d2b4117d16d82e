"""What the simulated drives turn: motors, wheels and the robot on them. Pure, in SI units."""
