"""`python -m gimc_controller_node`: the node `gimc_controller`."""

import sys

from gimc_controller_node.node import main

sys.exit(main())
