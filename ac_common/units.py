"""Units of the people: rpm, kPa, per cent. Inside and on the wire everything is SI."""

import math

#: One revolution per minute in rad/s.
RPM = 2.0 * math.pi / 60.0
#: One kilopascal in Pa.
KPA = 1000.0
#: One per cent.
PERCENT = 0.01
#: One kilogram per hour in kg/s.
KG_H = 1.0 / 3600.0
