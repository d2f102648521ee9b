"""Every factor between the units of files and SI; no other module holds 1000, 25.4 or pi/180."""

from __future__ import annotations

import math

MM = 1e-3
"""One millimetre in metres."""
UM = 1e-6
"""One micrometre in metres."""
INCH = 25.4e-3
"""One inch in metres."""
DEG = math.pi / 180.0
"""One degree in radians."""
MM_PER_MIN = 1e-3 / 60.0
"""One mm/min in m/s."""
INCH_PER_MIN = 25.4e-3 / 60.0
"""One inch/min in m/s."""
RPM = 1.0 / 60.0
"""One turn per minute in turns per second."""
MS = 1e-3
"""One millisecond in seconds."""
MEGABYTE = 1e6
"""One megabyte in bytes."""
PERCENT = 1e-2
"""One percent."""
NMM_PER_RAD = 1e-3
"""One N*mm/rad of joint stiffness in N*m/rad."""
N_PER_MM = 1e3
"""One N/mm of Cartesian stiffness in N/m."""
STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2]."""
