"""The nodes that belong to a run and not to the loop: scenario and recorder."""
