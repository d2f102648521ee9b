"""The numbers of a search: what it pays for, how far it looks, how much it holds.

One number holds all that a way costs, in one order, the dear before the cheap. The unit is that of
the objectives: 1 is all the stiffness of a tag, .01 one percent of it. From above: a step that no
free way was found for (it, and losses, a thousand times as much where the cell bounds losses:
``BOUND_PRICE``), a pose that the tool cannot leave; a pose beyond the bound of ``smooth``;
stiffness, travel, margins as weighed; what a spin off the round ones or off the main one has to
gain; ties.

That is the order of a tuple as long as what is cheap stays below one of what is dear: values of a
rung are told from the least of them, so only differences between ways must. Tuples of a level and
a price would say it by themselves, but the best of them on each row takes 3.7 times as long (two
products of matrices, two minima), on rungs of 100 states as of 800, and sweeps take 5 % of the time
of a panel, 43 % of that of a long contour.
"""

from __future__ import annotations

from postproc.units import DEG

PARTED = 1e6
"""What a step costs that leads where no free way was found: more than any way costs."""
PARTED_BOUND = 1e3
"""So many times as much where the cell bounds losses, which are priced accordingly."""
STUCK = 1e6
"""Cost of a state from which the tool cannot back off where a cut ends: more than any way costs,
as a tool that is stuck is refused."""
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
TIE_TRAVEL = 1e-7
"""Weight of travel that only breaks ties."""

CUT_UNIT = 0.01
"""Length [m] of cut over which states and travel weigh as at one tag by itself: what a cut costs
must not depend on how densely the CAM system set its points."""
LEAST_STEP = 1e-3
"""A step on a cut counts as at least so long [m]."""
KEY_STEP = 0.02
"""Longest way [m] on a cut from key tag to key tag, unless the points lie farther apart."""
KEY_TURN = 5.0 * DEG
"""Largest turn of the tool axis [rad] from key tag to key tag, likewise."""
BRIDGED = 0.05
"""Longest way [m] from key tag to key tag over which runs of spins are followed; contours and
pockets take three times as long without any."""
BRIDGED_TURN = 15.0 * DEG
"""Largest turn of the tool axis [rad], likewise."""
STEADY_TURN = 45.0 * DEG
"""Largest turn of the tool about its axis [rad] from key tag to key tag over that way, more over a
longer one; a faster turn is looked for only where there is no way without. A pocket takes seven
times as long if any turn will do."""
STEADY_BAND = 45.0 * DEG
"""How far [rad] to each side a cut may roll the tool off its main spin without earning it."""
MAIN_STEP = 5.0 * DEG
"""The main spin is looked for in steps of this [rad]."""
GAP_AROUND = 30.0 * DEG
"""No free way between two poses: so far [rad] around them none is looked for any more."""
FINEST_SPIN = 0.1 * DEG
"""Step [rad] of the spins about a pose where the cell rounds none."""

OWN_SPINS = 8
"""Of the spins that tags of a stroke have so many are tried, ..."""
PRICED = 100
"""... and so many of its tags are priced."""
ALONG = 4
"""So many tags along from a colliding pose are checked, and one spin to each side of it: a round of
the search costs more than the poses that a narrow rim finds later, a wide rim of free ones too. A
cut that no pose serves takes twice as long with 1."""
ALIKE = 0.6
"""Steps are alike if no joint at either end differs by more [rad]. A crowded cut that nothing
serves takes twice as long if they are not looked at along with one that fails."""
OFTEN = 4
"""Every so often the cheapest steps between two tags are checked, ..."""
MOST_LOOKED_AT = 5000
"""... so many of them at most, ..."""
LEAST_LOOKED_AT = 32
"""... so few at first ..."""
MOSTLY = 0.5
"""... and twice as many again while more than this share of them fails. Without such looks long
steps take six times as long."""
ALL_INSIDE = 8
"""All tags inside a failing cut of no more become key tags."""
SHORT = 0.05
"""A longer cut [m] is not taken out: its key tags are to stay as they are."""
TAKEN_OUT = 8
"""Where so many cuts were taken out ..."""
TAKEN_WITHIN = 0.06
"""... within so much way [m], key tags are added: dense contours take ten times as long without."""
CARRIED_ON = 1000
"""So many poses at most are carried on into a cut to tell what stops them."""
MOST_STATES = 12_000_000
"""A search that holds more gives up: a good gigabyte."""
MOST_REFINED = 2000
"""Tags without any pose that are searched on the finest grid, at most."""
LAP = 12_000
"""Tags of a lap: about 300 MB. Shorter jobs are searched whole."""
AHEAD = 500
"""Tags of the next lap that are searched with one."""

DEFAULT_BOUND = 0.05
"""Bound of loss of the strategy ``smooth`` where the cell sets none."""
LOSS_SPACING = 0.01
"""On cuts the optimum of single tags is looked for this often [m], and interpolated."""
HALVINGS = 6
"""A step of the grid is halved so often to find the stiffest pose at an edge of reach."""
EDGE_GAIN = 1.005
"""Edges are looked at where this times the best of the grid may stand there."""
EDGE_RISE = 1.5
"""From the last spin to the edge stiffness rises by no more than this times the step before."""
