"""Fault campaigns: what happens in a run, picked from a seed, and the promises it is judged by."""
