"""`canbase prove evidence`: what is known about the stops of one robot, in one folder, and what is missing of it."""
