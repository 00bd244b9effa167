"""QoS profiles of the graph, by name."""

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from ac_common.delivery import DEADLINE_S, DEPTH
from ac_common.topics import BY_NAME, TICKED, Topic

#: What publishers of the loop's topics offer, which have a message in every tick.
LOOP_QOS = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
    history=HistoryPolicy.KEEP_LAST,
    depth=DEPTH,
    deadline=Duration(seconds=DEADLINE_S),
)
#: Of every subscription, and of /clock, /diagnostics and what is not in every tick: reliable, without a deadline.
PLAIN_QOS = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=DEPTH)

#: Of /rosout: who listens later hears what was said before.
ROSOUT_QOS = QoSProfile(
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    history=HistoryPolicy.KEEP_LAST,
    depth=DEPTH,
)


def qos_of(topic: Topic) -> QoSProfile:
    """Return the QoS that a publisher of a topic of the loop offers; one that is not in every tick has no deadline."""
    return LOOP_QOS if BY_NAME[topic.name] in TICKED else PLAIN_QOS
