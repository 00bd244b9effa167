"""gimc."""
