"""What driver, watchdog, filter and tools share byte by byte: sockets, files, locks. No package of ours, no ROS."""
