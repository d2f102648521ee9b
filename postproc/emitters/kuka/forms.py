"""Inline forms: motions that the smartPAD shows, edits and touches up.

Visible text, hidden parameters, code and data of a form say the same, since the pad writes the code
anew from the others. KSS 8.5 and older keep the parameters in the fold's line (``%P``), KSS 8.6 and
newer in a fold of their own (``;Params``).
"""

from __future__ import annotations

from postproc import krl
from postproc.cell import Kss
from postproc.emitters.kuka.points import PointStore
from postproc.records import dataclass

SPEED_MAX = 2.0
"""BAS(#CP_PARAMS) takes no more than DEF_VEL_CP [m/s] and says nothing."""
_RELEASE = "%R 8.3.42,%MKUKATPBASIS,%CMOVE"
_PROVIDER = "IlfProvider=kukaroboter.basistech.inlineforms.movement.old"


@dataclass(frozen=True, slots=True)
class FormWriter:
    """Writes forms whose points and motion data go into a data list; ``kss`` of the controller."""

    points: PointStore
    kss: Kss

    def ptp(self, index: int, pose: krl.Pose, percent: float) -> list[krl.Statement]:
        """Return a PTP form; it ends exactly, ``percent`` is the axis speed."""
        name = self.points.form_point(index, pose)
        data = self.points.ptp_data(float(percent))
        speed = krl.numbers.percent(percent)
        code = [
            krl.Assign("PDAT_ACT", krl.Expr(f"P{data}")),
            krl.Assign("FDAT_ACT", krl.Expr(f"F{name}")),
            krl.Call("BAS", (krl.Enum("PTP_PARAMS"), float(percent))),
        ]
        head = f"PTP {name} Vel={speed} % {data} {self._frames(index)}"
        old = f"{_RELEASE},%VPTP,%P 1:PTP, 2:{name}, 3:, 5:{speed}, 7:{data}"
        new = self._params(name, "False", f"MoveDataPtpName={data}", f"VelocityPtp={speed}", "PTP")
        motion = krl.Move(krl.MoveWord.PTP, krl.Expr(f"X{name}"))
        return self._form(head, old, new, code, motion)

    def lin(
        self, index: int, pose: krl.Pose, speed_m_s: float, blend_mm: float
    ) -> list[krl.Statement]:
        """Return a LIN form; with ``blend_mm`` > 0 it is approximated."""
        speed_m_s = min(speed_m_s, SPEED_MAX)
        name = self.points.form_point(index, pose)
        data = self.points.cp_data(speed_m_s, blend_mm)
        speed = krl.numbers.speed(speed_m_s).rstrip("0").rstrip(".")
        blend = ("C_DIS",) if blend_mm > 0.0 else ()
        code = [
            krl.Assign("LDAT_ACT", krl.Expr(f"L{data}")),
            krl.Assign("FDAT_ACT", krl.Expr(f"F{name}")),
            krl.Call("BAS", (krl.Enum("CP_PARAMS"), speed_m_s)),
        ]
        cont = "CONT " if blend else ""
        head = f"LIN {name} {cont}Vel={speed} m/s {data} {self._frames(index)}"
        old = f"{_RELEASE},%VLIN,%P 1:LIN, 2:{name}, 3:{''.join(blend)}, 5:{speed}, 7:{data}"
        new = self._params(
            name, str(bool(blend)), f"MoveDataName={data}", f"VelocityPath={speed}", "LIN"
        )
        motion = krl.Move(krl.MoveWord.LIN, krl.Expr(f"X{name}"), blend=blend)
        return self._form(head, old, new, code, motion)

    def home(self, percent: float, *, is_spline: bool) -> list[krl.Statement]:
        """Return the form of HOME: XHOME, FHOME and PDEFAULT are the controller's own."""
        speed = krl.numbers.percent(percent)
        head = f"{'SPTP' if is_spline else 'PTP'} HOME Vel={speed} % DEFAULT"
        if is_spline:
            return self._spline_home(head, speed)
        code = [
            krl.Assign("PDAT_ACT", krl.Expr("PDEFAULT")),
            krl.Assign("FDAT_ACT", krl.Expr("FHOME")),
            krl.Call("BAS", (krl.Enum("PTP_PARAMS"), float(percent))),
        ]
        if not self.kss.has_parameter_folds:
            code.append(krl.Assign("$H_POS", krl.Expr("XHOME")))
        old = f"{_RELEASE},%VPTP,%P 1:PTP, 2:HOME, 3:, 5:{speed}, 7:DEFAULT"
        new = self._params(
            "HOME", "False", "MoveDataPtpName=DEFAULT", f"VelocityPtp={speed}", "PTP"
        )
        return self._form(head, old, new, code, krl.Move(krl.MoveWord.PTP, krl.Expr("XHOME")))

    @staticmethod
    def _spline_home(head: str, speed: str) -> list[krl.Statement]:
        """Return the form of KSS 8.6: what it sets holds for its own motion only."""
        settings = {
            "$VEL_AXIS[1]": f"SVEL_JOINT({float(speed):.1f})",
            "$TOOL": "STOOL2(FHOME)",
            "$BASE": "SBASE(FHOME.BASE_NO)",
            "$IPO_MODE": "SIPO_MODE(FHOME.IPO_FRAME)",
            "$LOAD": "SLOAD(FHOME.TOOL_NO)",
            "$ACC_AXIS[1]": "SACC_JOINT(PDEFAULT)",
            "$APO": "SAPO_PTP(PDEFAULT)",
            "$GEAR_JERK[1]": "SGEAR_JERK(PDEFAULT)",
            "$COLLMON_TOL_PRO[1]": "USE_CM_PRO_VALUES(0)",
        }
        parameters = (
            f"Params {_PROVIDER.replace('.old', '.spline')}; Kuka.IsGlobalPoint=False; "
            "Kuka.PointName=HOME; Kuka.BlendingEnabled=False; Kuka.MoveDataPtpName=DEFAULT; "
            f"Kuka.VelocityPtp={speed}; Kuka.VelocityFieldEnabled=True; "
            "Kuka.CurrentCDSetIndex=0; Kuka.MovementParameterFieldEnabled=True; IlfCommand=SPTP"
        )
        assigned = tuple(krl.Assign(name, krl.Expr(value)) for name, value in settings.items())
        return [
            krl.FoldBegin(f"{head} ;%{{PE}}"),
            krl.FoldBegin("Parameters ;%{h}"),
            krl.Comment(parameters),
            krl.FoldEnd(),
            krl.Move(krl.MoveWord.SPTP, krl.Expr("XHOME"), settings=assigned),
            krl.FoldEnd(),
        ]

    def _frames(self, index: int) -> str:
        tool, base = self.points.numbers(index)
        return f"Tool[{tool}] Base[{base}]"

    @staticmethod
    def _params(name: str, blending: str, data: str, speed: str, word: str) -> str:
        return (
            f"Params {_PROVIDER}; Kuka.IsGlobalPoint=False; Kuka.PointName={name}; "
            f"Kuka.BlendingEnabled={blending}; Kuka.{data}; Kuka.{speed}; "
            "Kuka.CurrentCDSetIndex=0; Kuka.MovementParameterFieldEnabled=True; "
            f"IlfCommand={word}"
        )

    def _form(
        self, head: str, old: str, new: str, code: list[krl.Statement], motion: krl.Move
    ) -> list[krl.Statement]:
        begin: list[krl.Statement]
        if not self.kss.has_parameter_folds:
            begin = [krl.FoldBegin(f"{head};%{{PE}}{old}")]
        else:
            begin = [
                krl.FoldBegin(f"{head} ;%{{PE}}"),
                krl.FoldBegin("Parameters ;%{h}"),
                krl.Comment(new),
                krl.FoldEnd(),
            ]
            code = [*code, krl.Call("SET_CD_PARAMS", (0,))]
        return [*begin, krl.Assign("$BWDSTART", False), *code, motion, krl.FoldEnd()]
