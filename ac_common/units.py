"""Units of the people: rpm, kPa, per cent. Inside and on the wire everything is SI."""

import math

#: One revolution per minute in rad/s.
RPM = 2.0 * math.pi / 60.0
#: One kilopascal in Pa.
KPA = 1000.0

#: Unit in which the size of each kind of fault is given, and how much that is in SI.
FAULT_UNITS = {"compressor_speed": ("rpm", RPM), "evaporator_pressure": ("kPa", KPA)}
