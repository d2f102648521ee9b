"""How far the tool axis may be tilted off the axis of the CAM data while the tool mills.

Lead is the angle in the direction of feed: a positive lead leans the holder forward, ahead of the
tip. Side tilt is the angle out of the plane of feed and CAM axis: a positive one leans the holder
to the right as seen along the feed. With k the CAM axis (from the tip to the holder), f the feed
direction across it and r = f x k, the tilted axis is

    cos(side) (cos(lead) k + sin(lead) f) + sin(side) r

as where lead is applied first and side tilt from there. The tip stays on the CAM point.

The feed direction at a tag: the way into it and the way out of it by cuts (lines and arcs), each
taken across the CAM axis there and of length 1, their sum. So a corner takes its bisector, an end
its only neighbour, an arc its tangent. A tag has no feed direction, and is not tilted, where it is
a hole or a joint target, where no cut meets it, where the cuts run along the tool axis (a plunge,
``PLUNGING``), and where the path turns back (``SHARPEST``).
"""

from __future__ import annotations

from postproc.units import DEG

SHARPEST = 100.0 * DEG
"""Where the feed direction turns by more, a tag has none."""
PLUNGING = 0.2
"""A cut whose share across the tool axis is smaller runs along it."""
