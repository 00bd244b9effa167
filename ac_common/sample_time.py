"""The sample time of the loop: its default and its range, for scenarios, nodes and designs alike."""

DEFAULT_SAMPLE_TIME_S = 0.1
SHORTEST_SAMPLE_TIME_S = 0.01
LONGEST_SAMPLE_TIME_S = 0.1
