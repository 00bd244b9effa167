"""`python -m fdi_node`: the node `fdi`."""

import sys

from fdi_node.node import main

sys.exit(main())
