"""The CANopen motor driver: CiA 301 and 402 as tables, kinematics, odometry, limits, the SYNC cycle, the ROS node."""
