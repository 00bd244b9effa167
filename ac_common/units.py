"""Units of the people: rpm, kPa, per cent. Inside and on the wire everything is SI."""

import math

#: One revolution per minute in rad/s.
RPM = 2.0 * math.pi / 60.0
#: One kilopascal in Pa.
KPA = 1000.0
