"""Layer setting services (CiA 305): drives found by identity, and given a node id and a bit rate. Pure."""
