"""How many threads linear algebra may take."""

import os
import sys

VARIABLE = "OPENBLAS_NUM_THREADS"


def one_blas_thread() -> None:
    """Give linear algebra in this process and its children one thread, unless the user has said otherwise.

    The matrices here are small: several threads make the linear algebra ten times slower, and compete with the nodes.
    For entry points; it works before and after numpy has been imported.
    """
    if VARIABLE in os.environ:
        return
    os.environ[VARIABLE] = "1"  # is read when numpy or scipy load their library
    if "numpy" in sys.modules:
        from threadpoolctl import threadpool_limits

        threadpool_limits(1, user_api="blas")
