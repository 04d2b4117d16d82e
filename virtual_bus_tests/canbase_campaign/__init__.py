"""The campaign: the real cores of every process with simulated drives in virtual time, many failures, and a judge."""
