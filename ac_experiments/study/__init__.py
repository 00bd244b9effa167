"""Studies: many runs of drawn scenarios, on one machine or a cluster, and what they amount to."""
