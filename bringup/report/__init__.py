"""What a run is shown as: plots, the report, the paper's experiments."""
