"""Layer setting services of the simulated drive: node id and bit rate by identity (CiA 305)."""
