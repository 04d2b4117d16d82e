"""The drive profile of the simulated drive: state machine, option codes, modes 3 and 9 (CiA 402-2)."""
