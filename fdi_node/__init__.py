"""fdi_node."""
