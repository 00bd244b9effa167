"""What the live page knows of a graph, for tests of what it shows."""

from bringup.dash.view import View

#: A graph that runs at rest; `dataclasses.replace` says what is otherwise.
RUNNING = View(
    phase="running",
    message="",
    failed=False,
    point="med",
    mode="realtime",
    recorded=False,
    accommodate=True,
    live_faults=frozenset(),
    status=None,
    plant={},
    parameters={},
    restarting=(),
)
