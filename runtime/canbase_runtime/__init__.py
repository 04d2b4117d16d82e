"""What the ROS processes share at run time: states, causes, receive times, the journal. See also canbase_base."""
