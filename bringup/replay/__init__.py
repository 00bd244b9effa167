"""A recording through one node again."""
