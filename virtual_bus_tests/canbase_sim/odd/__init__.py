"""Odd drives: simulated drives with behaviour that CiA 301 and CiA 402-2 allow, and that few drives have."""
