"""Synthesis, offline, of what the nodes load: observer, isolation filter, controller, compensators."""
