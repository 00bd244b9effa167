"""The plant's equations and their integration, compiled."""
