"""What all tests share."""

import os
import sys
from pathlib import Path

# Matrices here are small: several BLAS threads make the linear algebra ten times slower. Read when numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# pytest puts this folder on the path, where tests/gimc would pass for (a part of) the package gimc.
sys.path.insert(0, str(Path(__file__).parents[1]))
