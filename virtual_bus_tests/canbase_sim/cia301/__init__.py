"""The communication profile of the simulated drive, one service a file (CiA 301)."""
