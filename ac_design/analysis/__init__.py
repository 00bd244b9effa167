"""What a design is worth: error rates, stability of the loop, bounds, step responses."""
