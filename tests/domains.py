"""ROS domains of this process of tests: three in a row that the other workers of pytest-xdist do not have."""

import os

#: Of workers that belong together the numbers differ; other sessions on this machine may be anywhere.
_NUMBER = os.getppid() + int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))

OWN = 10 + 3 * (_NUMBER % 30)
