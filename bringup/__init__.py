"""Starts things: the command line, the graph of processes, its recorder, replay, live page, benchmarks, campaigns."""
