"""DriveDistance: the motion profile, the goal, the action server and its client."""
