"""A graph that runs begins again: all nodes through their life cycle and back, in order."""

from collections.abc import Iterable, Sequence

from ac_common.topics import SCENARIO, Topic
from bringup.launch.process_table import ACTIVATION_ORDER
from bringup.nodes.scenario import OFFSETS


def reset(names: Iterable[str], domain: int, topics: Sequence[Topic]) -> None:
    """Put a graph at rest where it began, without live faults and changes; accommodation stays as switched.

    The plant is stopped first, since it sets the pace; then every node is deactivated, cleaned up, configured, and,
    when all have found each other, activated, the plant last. A node that is somewhere on that way already, because an
    earlier attempt failed, is taken on from there.

    Parameters
    ----------
    names : iterable of str
        The nodes of the graph.
    domain : int
        Its ROS domain.
    topics : sequence of Topic
        Those of the run.

    Raises
    ------
    UserError
        One line: which node did not follow.
    """
    from lifecycle_msgs.msg import Transition

    from bringup.launch.processes import ros_environment
    from bringup.launch.supervisor import Supervisor

    order = [name for name in ACTIVATION_ORDER if name in set(names)]
    environment = {**ros_environment(), "ROS_DOMAIN_ID": str(domain)}
    with Supervisor(dict.fromkeys(order), environment, topics=topics) as supervisor:
        supervisor.meet(order)
        for name in reversed(order):
            if supervisor.state(name) == "active":
                supervisor.change([name], Transition.TRANSITION_DEACTIVATE, "inactive")
        for name in reversed(order):
            if supervisor.state(name) == "inactive":
                supervisor.change([name], Transition.TRANSITION_CLEANUP, "unconfigured")
        if SCENARIO in order:
            supervisor.set_parameters(SCENARIO, {parameter.name: 0.0 for parameter in OFFSETS})
        supervisor.activate(order)
