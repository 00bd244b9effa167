"""Another operating point for a graph that runs: all nodes through their life cycle and back, in order."""

import json
from collections.abc import Iterable
from typing import Any

from ac_common.cache import cache_folder
from ac_common.topics import INJECTOR, PLANT, SCENARIO
from ac_experiments.designs import write_designs_of
from ac_experiments.scenario import check, load
from ac_experiments.scenario_schema import Scenario
from ac_plant_node.rest import prepare
from bringup.launch.process_table import ACTIVATION_ORDER
from bringup.nodes.scenario import OFFSETS


def scenario_at(given: str, point: str) -> Scenario:
    """Return the scenario of the node `scenario` for another operating point.

    Parameters
    ----------
    given : str
        Its present one: a built-in name, a path, or JSON.
    point : str
        "low", "med" or "high".
    """
    scenario = check(json.loads(given)) if given.lstrip().startswith("{") else load(given)
    return check({**scenario.model_dump(mode="json"), "operating_point": point})


def reconfigure(names: Iterable[str], domain: int, point: str, scenario: str) -> None:
    """Put a graph at rest at an operating point, without live faults and changes; accommodation stays as switched.

    The plant is stopped first, since it sets the pace; then every node is deactivated, cleaned up, told the point,
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
    UserError
        One line: which node did not follow, or what is wrong with the scenario.
    """
    from lifecycle_msgs.msg import Transition

    from bringup.launch.processes import ros_environment
    from bringup.launch.supervisor import Supervisor

    new_scenario = scenario_at(scenario, point)
    prepare(point)
    folder = cache_folder() / "designs"
    folder.mkdir(parents=True, exist_ok=True)
    changes: dict[str, dict[str, Any]] = {
        PLANT: {"operating_point": point},
        INJECTOR: {"operating_point": point},
        **{node: {"design_file": str(file)} for node, file in write_designs_of(new_scenario, folder).items()},
        SCENARIO: {
            "scenario": json.dumps(new_scenario.model_dump(mode="json")),
            **{parameter.name: 0.0 for parameter in OFFSETS},
        },
    }
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
            if name in changes:
                supervisor.set_parameters(name, changes[name])
        supervisor.activate(order)
