"""ROS domains of this process of tests: three in a row that no other one of the last thirty has."""

import os

OWN = 10 + 3 * (os.getpid() % 30)
