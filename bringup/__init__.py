"""What ties the nodes together: topics, scenarios, the graph and its recorder, replay, summary, report, commands."""

import os

# The matrices here are small: several BLAS threads make the linear algebra ten times slower, and compete with the
# nodes. Read when numpy is imported, which must not have happened yet.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
