"""The ROS 2 side of the driver: node, services, messages, diagnostics."""
