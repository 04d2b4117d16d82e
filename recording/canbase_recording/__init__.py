"""What a recording of a CAN bus shows: each frame in words, the state of each node, each stop with its first cause."""
