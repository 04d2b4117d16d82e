"""Finds out what is wrong with a robot: checks, symptoms, evidence, the support bundle."""
