"""Starting the graph and watching over it."""
