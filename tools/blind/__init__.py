"""Withheld-effect check of the gap diagnosis: hidden robots, sealed answers, a scorer.

Nothing of ``postproc`` is imported here. The robots are products of exponentials (screws) with
springs in the joints, in the links and under the base, in full static equilibrium; the diagnosis
is judged through its command line only. ``python -m tools.blind --help``.

What counts as true
    The size of a hidden effect is the rms per axis of what it adds beside all others. From 3 times
    the noise on it is true: to be named. Between 0.2 and 3 times it is a nuisance: naming it is
    neither right nor wrong. That also holds for the errors of geometry and registration which every
    campaign has in the background, and for the give of the arm under the loads of a campaign whose
    hidden effect is another one. Planned effects have 4 times the noise or more.
Frames
    Half of the campaigns stand in the robot's own frame: base and tool are off by a little, or by
    so much that base_frame and tool_frame are effects by the rule above. The other half is measured
    by a tracker that stands anywhere with a reflector beside the tool point, and diagnosed with
    ``--register``: then base_frame and tool_frame are always wrong names, and the size of an
    effect counts without what frame and reflector place can imitate.
What the simulation knows
    Some loaded campaigns come with the true stiffness in a model file (``known.toml``); the gap
    counts against that. Otherwise the nominal arm is rigid. The controller is taken to hold the
    arm against its own weight, but for the share that gravity_sag leaves.
Outside the library
    An effect that the contract does not name, or one whose columns were not logged. Right is: no
    wrong name, and "unexplained" said, or a name of its own (table ``beyond.OUTSIDE``). Its part
    that frames, joint offsets and constant give cannot imitate has 3.5 times the noise or more.
Families
    ``families`` draws campaigns that go wrong in one way each: sizes, few rows, logged conditions,
    genuine rows that look like faults, the instrument, rails, readings of one or two dimensions,
    causes in no list. A row's file may then lack coordinates; new rows always have three.
    What creeps in one set-up of the instrument is left out of the model for new rows: they have
    another. Tools, fixtures and the rail stay: new rows log which, and are moved by them as well.
New rows
    ``fresh.csv`` has new poses of the same design, ``transfer.csv`` another design: predicted and
    actual shrinkage are compared on the first; neither may get worse by a diagnosis.
"""
