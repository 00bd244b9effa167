"""The paper's experiments and how ours compare."""
