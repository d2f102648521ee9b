"""What a search pays for, in one order: one number holds it all, the dear before the cheap.

The unit is that of the objectives: 1 is all the stiffness of a tag, .01 one percent of it. From
above: a step that no free way was found for, a pose that the tool cannot leave; another posture
where these are kept steady (both, and losses, a thousand times as much where the cell bounds
losses: ``BOUND_PRICE``); a pose beyond the bound of ``smooth``; stiffness, travel, margins as
weighed; what a spin off the round ones or off the main one has to gain; ties.
"""

from __future__ import annotations

PARTED = 10.0
"""What a step costs that leads where no free way was found, in ``CHANGE``: changes may help."""
STUCK = 1e6
"""Cost of a state from which the tool cannot back off where a cut ends: more than any way costs,
as a tool that is stuck is refused."""
CHANGE_BOUND = 1e3
"""So many times as much where the cell bounds losses, which are priced accordingly."""
CHANGE = 1e5
"""Cost of another shoulder, elbow or wrist at the next tag where a search keeps them steady: more
than all that such changes could gain."""
DEARER = 300.0
"""What each further 1 (100 %) of loss beyond the bound costs."""
DEAR = 30.0
"""Cost of a state beyond the bound of loss: taken only where nothing else can be run."""
ROLL_PRICE = 0.02
"""What a cut that rolls the tool beyond ``STEADY_BAND`` must gain: 1 % of stiffness, and as
much for the grid of spins, whose rounding may favour one of two mirrored poses by it."""
FINER_PRICE = 0.01
"""What a less round spin has to gain: 1 % of stiffness a level, less than any arm is known to."""
MIRRORED_PRICE = 0.01
"""What a hole's pose has to gain over its mirror image, about: 1 % of stiffness. Families of poses
that mirror each other (left and right of the arm, wrist turned over) cost almost the same in all;
then a hole more, or a base some mm beside, turned the whole panel, if nothing told them apart."""
CUT_TRAVEL = 3e-3
"""Weight of travel inside a cut where every tag is optimised for itself: 0.3 % of stiffness for a
joint step of 10 degrees. Without it neighbours stand at opposite spins and no line joins them."""
HOME_SHARE = 0.05
"""Share of the price of travel that counts from home and back: one move, and a long one."""
TIE_SPIN = 1e-5
"""What the square of a spin costs, in units of ten degrees, where every tag takes its own best."""
TIE_TRAVEL = 1e-7
"""Weight of travel that only breaks ties."""
