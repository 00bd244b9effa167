"""How messages of the loop are offered: figures that the nodes' QoS and the metadata of a bag share."""

#: How far behind a subscriber (the recorder above all) may fall before a message is lost, in ticks.
DEPTH = 1000
#: A publisher of a loop topic that is silent for longer misses its deadline.
DEADLINE_S = 1.0
