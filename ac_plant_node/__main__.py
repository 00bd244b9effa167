"""`python -m ac_plant_node`: the node `ac_plant`."""

import sys

from ac_plant_node.node import main

sys.exit(main())
