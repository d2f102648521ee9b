"""The roles of columns in a point list: meaning, unit, and every spelling of the name.

A spelling is in lower case, without blanks, accents and signs: English, German and French, and what
RoboDK, CATIA, PolyWorks, SpatialAnalyzer and measuring machines write.
"""

from __future__ import annotations

from postproc.records import dataclass
from postproc.units import DEG, MM, MM_PER_MIN, RPM, Dimension

LENGTH, ANGLE = (Dimension.LENGTH,), (Dimension.ANGLE,)
FEED = (Dimension.SPEED, Dimension.ADVANCE)


@dataclass(frozen=True, slots=True)
class Role:
    """What a column can be.

    ``names``: spellings; ``unit_needed``: spellings that mean it beside a unit only, for without
    one they have more than one meaning; ``dimensions``: of the units it may have, none for numbers
    without one; ``bare``: factor to SI where no unit stands.
    """

    name: str
    meaning: str
    names: str = ""
    unit_needed: str = ""
    dimensions: tuple[Dimension, ...] = ()
    bare: float = 1.0
    is_text: bool = False


def _axis(letter: str, normal: str, meaning: tuple[str, str]) -> tuple[Role, Role]:
    """Return the roles of a coordinate and of a component of the tool axis."""
    point = "{0} m{0} p{0} {0}pos pos{0} {0}1"
    axis = (
        "{1} n{0} v{0} n{1} normal{0} normal{1} {0}n axis{1} axis{0} u{0} dir{0} vector{0} vec{0} "
        "direction{0} normale{0} richtung{0}"
    )
    return (
        Role(letter, meaning[0], point.format(letter, normal), "", LENGTH, MM),
        Role(normal, meaning[1], axis.format(letter, normal)),
    )


_X, _I = _axis(
    "x", "i", ("point: tip of the tool, top of a hole", "tool axis, from the tip into the holder")
)
_Y, _J = _axis("y", "j", ("the same", "the same"))
_Z, _K = _axis("z", "k", ("the same", "the same"))

ROLES = (
    _X, _Y, _Z, _I, _J, _K,
    Role("a", "KUKA A of the tool frame, in place of i, j, k", "a kukaa", "", ANGLE, DEG),
    Role("b", "KUKA B", "b kukab", "", ANGLE, DEG),
    Role("c", "KUKA C", "c kukac", "", ANGLE, DEG),
    Role("roll", "rotation about x, in place of i, j, k: R = Rz(yaw) Ry(pitch) Rx(roll)", "w",
         "roll rx rotx", ANGLE, DEG),
    Role("pitch", "rotation about y", "p", "pitch ry roty", ANGLE, DEG),
    Role("yaw", "rotation about z", "r", "yaw rz rotz", ANGLE, DEG),
    Role("qw", "quaternion of the tool frame, in place of i, j, k", "qw q0 quatw"),
    Role("qx", "x of it", "qx q1 quatx"),
    Role("qy", "y of it", "qy q2 quaty"),
    Role("qz", "z of it", "qz q3 quatz"),
    Role("id", "name of the point, used in messages and pins",
         "id name tag label no nr index elementname element pointname pointid holeid holename "
         "pointno feature featurename bezeichnung fastener fastenerid fastenername fastenerno "
         "bohrungsnr bohrungsnummer lochnr rivet bolt target "
         "point points hole punkt bohrung trou nom numero", is_text=True),
    Role("depth", "the point is a hole of this depth below it, along the tool axis",
         "depth tiefe drilldepth boredepth drillingdepth bohrtiefe bohrungstiefe lochtiefe "
         "profondeur", "", LENGTH, MM),
    Role("diameter", "of the hole; shown, not used for the motion",
         "diameter dia diam d durchmesser bohrdurchmesser bohrungsdurchmesser lochdurchmesser "
         "holediameter \u00f8 diametre", "",
         LENGTH, MM),
    Role("feed", "cutting feed, mm/min, or mm/rev beside a spindle speed",
         "feed feedrate f vf vorschub vorschubgeschwindigkeit avance vitesseavance vitessedavance "
         "cuttingfeed drillfeed workfeed bohrvorschub",
         "speed velocity vel v linearspeed pathspeed feedspeed geschwindigkeit "
         "bahngeschwindigkeit vitesse fn", FEED, MM_PER_MIN),
    Role("spindle", "speed of the spindle, 1/min: started before the first tag, 0 stops it, a "
         "minus or the sense turns it counterclockwise",
         "spindle spindlespeed spindlerpm rpm spindel spindeldrehzahl drehzahl broche "
         "vitessebroche vitessedebroche vitesserotation vitessederotation frequencederotation "
         "rotationspeed rotationalspeed spindlerotation",
         "s n speed vitesse", (Dimension.TURNS,), RPM),
    Role("sense", "which way the spindle turns: CW or CCW, M3 or M4, 1 or -1; M5 or off stands",
         "sense senseofrotation rotationdirection directionofrotation spindledirection spindledir "
         "spindlesense spindlerotationdirection drehrichtung drehsinn spindelrichtung sens "
         "sensrotation sensderotation sensdebroche cwccw", is_text=True),
    Role("operation", "name of the operation that the row belongs to",
         "operation op process step bearbeitung", is_text=True),
    Role("tool", "number or name of the tool, as a tool of the cell claims it",
         "tool toolnumber toolno toolname toolid t werkzeug werkzeugnummer werkzeugnr outil "
         "numerooutil", is_text=True),
    Role("base", "number or name of the setup, as a base of the cell claims it",
         "base setup workoffset werkstueck basis nullpunkt", is_text=True),
    Role("clearance", "height above the hole from which it is fed",
         "clearance approach safety rapto sicherheitsabstand", "", LENGTH, MM),
    Role("retract", "height above the hole to which the tool is withdrawn",
         "retract retraction rtrcto ruckzug rueckzug", "", LENGTH, MM),
    Role("dwell", "time at the bottom, s", "dwell dwelltime verweilzeit temporisation", "",
         (Dimension.TIME,)),
    Role("peck", "depth of one peck", "peck pecking peckdepth peckstep debourrage zustelltiefe", "",
         LENGTH, MM),
    Role("motion", "rapid or linear", "motion move movetype motiontype", is_text=True),
)  # fmt: skip
BY_NAME = {role.name: role for role in ROLES}
"""Roles by the names that ``--columns`` takes."""
_SPELLED: dict[str, list[tuple[Role, bool]]] = {}
for _role in ROLES:
    for _spelling in {_role.name: None, **dict.fromkeys(_role.names.split())}:
        if _spelling not in _role.unit_needed.split():
            _SPELLED.setdefault(_spelling, []).append((_role, False))
    for _spelling in _role.unit_needed.split():
        _SPELLED.setdefault(_spelling, []).append((_role, True))

_HARMLESS = (
    # text for people
    "comment comments remark remarks note notes description desc bemerkung kommentar beschreibung "
    "anmerkung commentaire remarque text info "
    # what is joined, and where in the assembly
    "grip griplength gripcode klemmlange klemmlaenge serrage part partno partnumber partname teil "
    "teilenummer teilnummer artikel piece assembly drawing zeichnung revision rev version panel "
    "section bay stringer rib rippe spant row reihe material werkstoff matiere fastenertype "
    "fastenercode fastenerpart collar nut batch lot serial serialno seriennummer layer group color "
    "colour farbe "
    # how it was measured
    "number deviation abweichung ecart dev error tolerance tol uncertainty unc sigma std rms "
    "quality confidence timestamp date uhrzeit operator inspector prufer pruefer reflector "
    "instrument temperature temp"
)
HARMLESS = frozenset(_HARMLESS.split())
"""Names of columns that change nothing of what the robot does."""


def roles_spelled(spelling: str) -> list[tuple[Role, bool]]:
    """Return the roles that a spelling can mean, and whether each of them needs a unit."""
    return _SPELLED.get(spelling, [])
