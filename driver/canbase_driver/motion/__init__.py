"""From the velocity command to wheel speeds, and from wheel positions to odometry."""
