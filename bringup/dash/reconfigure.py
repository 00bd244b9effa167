"""Another operating point for a graph that runs: all nodes through their life cycle and back, in order."""

import json
from collections.abc import Iterable

from ac_common.topics import COMPENSATOR, CONTROLLER, FDI, PLANT, SCENARIO
from bringup.launch.launch import ACTIVATION_ORDER
from bringup.nodes.scenario import OFFSETS

#: Nodes whose design, or rest, is that of an operating point.
AT_A_POINT = (PLANT, FDI, COMPENSATOR, CONTROLLER)


def scenario_at(given: str, point: str) -> str:
    """Scenario of the node `scenario` for another operating point, as JSON.

    Parameters
    ----------
    given : str
        Its present one: a built-in name, a path, or JSON.
    point : str
        "low", "med" or "high".
    """
    from ac_experiments.scenario import check, load

    scenario = check(json.loads(given)) if given.lstrip().startswith("{") else load(given)
    return json.dumps({**scenario.model_dump(mode="json"), "operating_point": point})


def reconfigure(names: Iterable[str], domain: int, point: str, scenario: str) -> None:
    """Put a graph at rest at an operating point, without live faults and changes; accommodation stays as switched.

    The plant is stopped first, since it beats time for all; then every node is deactivated, cleaned up, told the point,
    configured, and, when all have found each other, activated, the plant last. A node that is somewhere on that way
    already, because an earlier attempt failed, is taken on from there.

    Parameters
    ----------
    names : iterable of str
        The nodes of the graph.
    domain : int
        Its ROS domain.
    point : str
        "low", "med" or "high".
    scenario : str
        What the node `scenario` plays now: a built-in name, a path, or JSON.

    Raises
    ------
    BringupError
        One line: which node did not follow, or what is wrong with the scenario.
    """
    from lifecycle_msgs.msg import Transition

    from bringup.launch.processes import ros_environment
    from bringup.launch.supervisor import Supervisor

    new_scenario = scenario_at(scenario, point)
    order = [name for name in ACTIVATION_ORDER if name in set(names)]
    with Supervisor(dict.fromkeys(order), {**ros_environment(), "ROS_DOMAIN_ID": str(domain)}) as supervisor:
        supervisor.meet(order)
        for name in reversed(order):
            if supervisor.state(name) == "active":
                supervisor.change([name], Transition.TRANSITION_DEACTIVATE, "inactive")
        for name in reversed(order):
            if supervisor.state(name) == "inactive":
                supervisor.change([name], Transition.TRANSITION_CLEANUP, "unconfigured")
        for name in order:
            if name in AT_A_POINT:
                supervisor.set_parameters(name, {"operating_point": point})
        if SCENARIO in order:
            nothing = {parameter.name: 0.0 for parameter in OFFSETS}
            supervisor.set_parameters(SCENARIO, {"scenario": new_scenario, **nothing})
        supervisor.activate(order)
