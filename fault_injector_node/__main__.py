"""`python -m fault_injector_node`: the node `fault_injector`."""

import sys

from fault_injector_node.node import main

sys.exit(main())
