"""Record the reference bag anew: ``python tests/bringup/graph/update_references.py``.

To be run on purpose, when a change of behaviour is wanted; the difference then shows in the version history.
"""

import os
import shutil
import tempfile
from pathlib import Path

from ac_experiments.scenario import load
from bringup.launch.launch import run_graph

HERE = Path(__file__).parent
REFERENCE = HERE / "reference"
SCENARIO = HERE / "reference.yaml"


def main() -> None:
    """Run the reference scenario through the graph and keep its bag."""
    os.environ.setdefault("ROS_DOMAIN_ID", str(60 + os.getpid() % 40))
    with tempfile.TemporaryDirectory() as folder:
        run = run_graph(load(SCENARIO), folder)
        if REFERENCE.exists():
            shutil.rmtree(REFERENCE)
        shutil.copytree(run.bag, REFERENCE)
    size = sum(file.stat().st_size for file in REFERENCE.iterdir())
    print(f"{REFERENCE}: {run.ticks} ticks, {size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
