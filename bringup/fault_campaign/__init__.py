"""Runs with faults of processes and messages drawn at random."""
