"""Fault campaigns: seeded faults of processes, messages and the plant at once, and the promises checked afterwards."""
