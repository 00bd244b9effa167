"""What all tests share."""

import os

# Matrices here are small: several BLAS threads make the linear algebra ten times slower. Read when numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
