"""Entry points give linear algebra one thread, whatever has been imported before."""

import os
import subprocess
import sys

import pytest

SHOW = "import numpy, scipy.linalg, threadpoolctl; print({x['num_threads'] for x in threadpoolctl.threadpool_info()})"
LIMIT = "from ac_common.blas_threads import one_blas_thread; one_blas_thread()"


@pytest.mark.parametrize("code", [f"{LIMIT}; {SHOW}", f"import numpy; {LIMIT}; {SHOW}"], ids=["before", "after"])
def test_one_thread_before_and_after_numpy_has_been_imported(code: str) -> None:
    if os.cpu_count() == 1:
        pytest.skip("one processor: there is one thread anyway")
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    said = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert said.stdout == "{1}\n"


def test_the_users_word_counts() -> None:
    code, environment = f"import numpy; {LIMIT}; {SHOW}", {**os.environ, "OPENBLAS_NUM_THREADS": "2"}
    said = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert said.stdout == f"{{{min(2, os.cpu_count() or 1)}}}\n"


@pytest.mark.parametrize("entry", ["bringup.cli", "ac_ros_common.loop_node", "bringup.benchmarks.endurance"])
def test_entry_points_ask_for_it(entry: str) -> None:
    """And nothing else does: a library must not change its user's environment."""
    code = f"import os; os.environ.pop('OPENBLAS_NUM_THREADS', None); import {entry} as entry\n"
    code += "assert 'OPENBLAS_NUM_THREADS' not in os.environ\nassert entry.one_blas_thread"
    subprocess.run([sys.executable, "-c", code], check=True)
