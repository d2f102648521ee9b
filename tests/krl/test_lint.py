"""Lint: each row of the table has text that triggers it, and text that looks real and must not."""

from pathlib import Path

import pytest

from postproc.errors import KrlError, Severity
from postproc.jobs.lint import lint as lint_files
from postproc.krl.lint import RULES, lint
from postproc.krl.rules.subject import LintOptions
from postproc.krl.rules.values import nearest
from postproc.krl.system import system_variables
from postproc.krl.text.parse import load_modules, parse_files

FIXTURES = Path(__file__).parent / "data"

MAIN = """&ACCESS RVP
&REL 1
&PARAM EDITMASK = *
DEF PANEL( )
DECL INT nHole
;FOLD INI
GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM()
INTERRUPT ON 3
BAS(#INITMOV,0)
;ENDFOLD (INI)
BAS(#TOOL,1)
BAS(#BASE,2)
$ADVANCE=3
$VEL.ORI1=200.0000
$APO.CPTP=50
$APO.CDIS=1.0000
BAS(#VEL_PTP,50)
PTP {A1 -10.0,A2 -80.0,A3 100.0,A4 0.0,A5 45.0,A6 10.0} C_PTP
PP_SPINDLE_ON(3000)
PTP XP1
$VEL.CP=0.800000
LIN {X 100.0000,Y 0.0000,Z 5.0000,A 0.00000,B 90.00000,C 0.00000} ; CAM line 4
$VEL.CP=0.010000
LIN {X 100.0000,Y 0.0000,Z -8.0000,A 0.00000,B 90.00000,C 0.00000}
WAIT SEC 0.5
$VEL.CP=0.800000
LIN {X 100.0000,Y 0.0000,Z 50.0000,A 0.00000,B 90.00000,C 0.00000} C_DIS
LIN {X 130.0000,Y 0.0000,Z 50.0000,A 0.00000,B 90.00000,C 0.00000} C_DIS
CIRC {X 140.0000,Y 10.0000,Z 50.0000},{X 130.0000,Y 20.0000,Z 50.0000,A 0.0,B 90.0,C 0.0}
FOR nHole=1 TO 3
  IF nHole<>2 THEN
    PANEL_001()
  ENDIF
ENDFOR
PP_SPINDLE_OFF()
PTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 45.0,A6 0.0}
END
"""
DATA = """&ACCESS RVP
DEFDAT PANEL
DECL E6POS XP1={X 100.0,Y 0.0,Z 50.0,A 0.0,B 90.0,C 0.0,S 2,T 'B000010'}
DECL FDAT FP1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " "}
DECL LDAT LCPDAT1={VEL 2.0,ACC 100.0,APO_DIST 100.0,APO_FAC 50.0,ORI_TYP #VAR}
DECL PDAT PPDAT1={VEL 100.0,ACC 100.0,APO_DIST 100.0,GEAR_JERK 50.0,EXAX_IGN 0}
ENDDAT
"""
FORM = (
    ";FOLD LIN P2 CONT Vel=0.5 m/s CPDAT1 Tool[1]:t Base[2];%{PE}%MKUKATPBASIS,"
    "%P 1:LIN, 2:P2, 3:C_DIS, 5:0.5, 7:CPDAT1"
)
PART = """&ACCESS RVP
DEF PANEL_001( )
BAS(#TOOL,1)
BAS(#BASE,2)
PTP {A1 -12.0,A2 -80.0,A3 100.0,A4 0.0,A5 45.0,A6 10.0}
$VEL.CP=0.020000
$APO.CDIS=0.2000
LIN {X 200.0000,Y 0.0000,Z 0.0000,A 0.0,B 90.0,C 0.0} C_DIS
LIN {X 210.0000,Y 0.0000,Z 0.0000,A 0.0,B 90.0,C 0.0} C_DIS
LIN {X 210.0000,Y 10.0000,Z 0.0000,A 0.0,B 90.0,C 0.0}
FORM
$BWDSTART=FALSE
LDAT_ACT=LCPDAT1
FDAT_ACT=FP2
BAS(#CP_PARAMS,0.5)
LIN XP2 C_DIS
;ENDFOLD
SLIN_SAFE( )
LIN {X 210.0000,Y 10.0000,Z 90.0000,A 0.0,B 90.0,C 0.0}
END
DEF SLIN_SAFE( )
HALT
END
""".replace("FORM", FORM)
PART_DATA = """&ACCESS RVP
DEFDAT PANEL_001
DECL E6POS XP2={X 210.0,Y 10.0,Z 60.0,A 0.0,B 90.0,C 0.0,S 2,T 2}
DECL FDAT FP2={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " "}
DECL LDAT LCPDAT1={VEL 2.0,ACC 100.0,APO_DIST 20.0,APO_FAC 50.0,ORI_TYP #VAR}
ENDDAT
"""
FILES = {
    "PANEL.src": MAIN,
    "PANEL.dat": DATA,
    "PANEL_001.src": PART,
    "PANEL_001.dat": PART_DATA,
}


def run(files, options=None):
    encoded = {
        name: text if isinstance(text, bytes) else text.replace("\n", "\r\n").encode()
        for name, text in files.items()
    }
    return lint(parse_files(encoded), options)


def found(files, options=None):
    return {
        (finding.code, str(finding.severity))
        for finding in run(files, options)
        if finding.severity is not Severity.NOTE
    }


def mutated(name, old, new):
    assert old in FILES[name], f"{old!r} is not in {name}"
    return {**FILES, name: FILES[name].replace(old, new, 1)}


def test_the_clean_program_is_clean():
    assert found(FILES) == set()


@pytest.mark.parametrize("folder", ["forms85", "forms86", "milling"])
def test_real_looking_programs_are_clean(folder):
    findings = lint(load_modules([FIXTURES / folder]))
    assert [str(i) for i in findings] == []


FIRST = "LIN {X 100.0000,Y 0.0000,Z 5.0000,A 0.00000,B 90.00000,C 0.00000} ; CAM line 4\n"
BOTTOM = "LIN {X 100.0000,Y 0.0000,Z -8.0000,A 0.00000,B 90.00000,C 0.00000}"
ABOVE = "LIN {X 100.0000,Y 0.0000,Z 5.0000,A 0.00000,B 90.00000,C 0.00000}"
CIRCLE = "CIRC {X 140.0000,Y 10.0000,Z 50.0000},"
RESUMED = "PTP {A1 -12.0,A2 -80.0,A3 100.0,A4 0.0,A5 45.0,A6 10.0}"
POINT = "DECL E6POS XP1={X 100.0,Y 0.0,Z 50.0,A 0.0,B 90.0,C 0.0,S 2,T 'B000010'}"
TRIGGER = "TRIGGER WHEN DISTANCE=0 DELAY=0 DO "

FUNCTION = "DEFFCT BOOL NEAR(a :IN,b[] :OUT)\nDECL REAL a\nDECL INT b[]\nRETURN a>1\nENDFCT\n"
LAST = "DEF SLIN_SAFE( )\nHALT\nEND\n"

MUTANTS = [
    # row, severity, file, text, replaced by
    (1, "error", "PANEL.src", FIRST, "LIN {X 1,5,Y 0.0}\n"),
    (1, "error", "PANEL.src", "WAIT SEC 0.5", "WAIT 0.5"),
    (1, "error", "PANEL.dat", POINT, POINT[:-1]),
    (2, "error", "PANEL.src", "BAS(#INITMOV,0)", "BAS(#INITMOV,0)\nINI"),
    (2, "error", "PANEL.src", "WAIT SEC 0.5", "// wait"),
    (2, "error", "PANEL.src", "WAIT SEC 0.5", "G04 P500"),
    (2, "error", "PANEL.src", "PTP XP1", "PTP P1 Vel=100 % PDAT1"),
    (2, "error", "PANEL.src", "  ENDIF\n", ""),
    (2, "error", "PANEL.src", "ENDFOR\n", "ENDWHILE\n"),
    (2, "error", "PANEL.src", "WAIT SEC 0.5", "EXIT"),
    (2, "error", "PANEL.src", "WAIT SEC 0.5", "ELSE"),
    (2, "error", "PANEL.src", "WAIT SEC 0.5", "ENDSPLINE"),
    (2, "error", "PANEL_001.src", "HALT\nEND\n", "HALT\n"),
    (2, "error", "PANEL.dat", "ENDDAT\n", ""),
    (3, "error", "PANEL.src", "DEF PANEL( )", "DEF PANELS( )"),
    (3, "error", "PANEL.dat", "DEFDAT PANEL", "DEFDAT OTHER"),
    (4, "error", "PANEL.dat", "FP1=", "A234567890123456789012345="),
    (4, "error", "PANEL.dat", "FP1=", "WAIT="),
    (4, "error", "PANEL.dat", "FP1=", "$FP1="),
    (4, "error", "PANEL.dat", "DECL FDAT FP1", "DECL FDAT XP1"),
    (4, "error", "PANEL_001.src", "DEF SLIN_SAFE( )", "DEF PANEL_001( )"),
    (4, "error", "PANEL_001.src", FORM, FORM.replace("P2 CONT", "P23456789012345678901234 CONT")),
    (5, "error", "PANEL.dat", POINT + "\n", ""),
    (5, "error", "PANEL.src", "DECL INT nHole\n", ""),
    (5, "error", "PANEL.src", "WAIT SEC 0.5", "WAIT SEC rPause"),
    (5, "warning", "PANEL.src", "WAIT SEC 0.5", "CLAMP_OPEN(1)"),
    (6, "error", "PANEL.src", "DECL INT nHole", "DECL INT nHole=1"),
    (6, "error", "PANEL.src", "WAIT SEC 0.5", "DECL INT nLate"),
    (6, "error", "PANEL.dat", "DEFDAT PANEL", "DEFDAT PANEL\nDECL INT n\nn=3"),
    (6, "error", "PANEL.dat", "DEFDAT PANEL", "DEFDAT PANEL\nWAIT SEC 1"),
    (7, "error", "PANEL.src", BOTTOM, BOTTOM.replace("Z -8.0000", "Z nan")),
    (7, "error", "PANEL.src", BOTTOM, BOTTOM.replace("Y 0.0000", "X 0.0000")),
    (7, "error", "PANEL.src", BOTTOM, BOTTOM.replace("Y 0.0000", "Q 0.0000")),
    (7, "error", "PANEL.src", BOTTOM, BOTTOM.replace("Y 0.0000", "A1 0.0000")),
    (7, "error", "PANEL.dat", "IPO_FRAME #BASE", "IPO_FRAM #BASE"),
    (7, "warning", "PANEL.src", BOTTOM, BOTTOM.replace("X 100.0000", "X 10000000.0")),
    (8, "error", "PANEL.src", "WAIT SEC 0.5", 'gcText[]="\u00e4"'),
    (8, "warning", "PANEL.src", "CAM line 4", "CAM line \u00e4"),
    (8, "warning", "PANEL.src", "CAM line 4", "x" * 260),
    (9, "error", "PANEL.src", "BAS(#INITMOV,0)\n", ""),
    (9, "error", "PANEL.src", "BAS(#INITMOV,0)\n", "BAS(#INITMOV,0)\nBAS(#INITMOV,0)\n"),
    (9, "error", "PANEL.src", "BAS(#TOOL,1)\n", ""),
    (9, "error", "PANEL.src", "BAS(#TOOL,1)\n", "$TOOL=TOOL_DATA[1]\n"),
    (9, "error", "PANEL.src", "BAS(#BASE,2)\n", ""),
    (9, "error", "PANEL_001.src", "BAS(#TOOL,1)", "BAS(#INITMOV,0)\nBAS(#TOOL,1)"),
    (10, "error", "PANEL.src", "BAS(#TOOL,1)", "BAS(#TOOL,17)"),
    (10, "error", "PANEL.src", "BAS(#BASE,2)", "BAS(#BASE,0)"),
    (10, "error", "PANEL_001.src", "BAS(#TOOL,1)", "BAS(#TOOL,3)"),
    (10, "warning", "PANEL_001.dat", "BASE_NO 2", "BASE_NO 0"),
    (11, "error", "PANEL.src", "PTP {A1 -10.0,A2 -80.0,A3 100.0,", "PTP {A1 -10.0,A2 -80.0,"),
    (11, "error", "PANEL_001.src", RESUMED + "\n", ""),
    (11, "error", "PANEL.src", "PTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 45.0,A6 0.0}", FIRST),
    (11, "error", "PANEL_001.src", RESUMED, "PTP {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}"),
    (11, "warning", "PANEL_001.src", RESUMED, "PTP $AXIS_ACT"),
    (12, "error", "PANEL.dat", "S 2,T 'B000010'", "S 6,T 'B000010'"),
    (12, "error", "PANEL.dat", "S 2,T 'B000010'", "S 2,T 'B1000010'"),
    (12, "error", "PANEL.dat", "S 2,T 'B000010'", "S 10,T 'B000010'"),
    (12, "warning", "PANEL.dat", "S 2,T 'B000010'", "S 18,T 'B000010'"),
    (12, "error", "PANEL.src", BOTTOM, BOTTOM.replace("C 0.00000}", "C 0.0,S 6,T 18}")),
    (15, "error", "PANEL.src", "$VEL.CP=0.010000", "$VEL.CP=0.00"),
    (15, "error", "PANEL.src", "$VEL.CP=0.800000", "$VEL.CP=800.0"),
    (15, "warning", "PANEL.src", "$VEL.CP=0.800000", "BAS(#VEL_CP,2.5)"),
    (15, "error", "PANEL_001.src", "BAS(#CP_PARAMS,0.5)", "BAS(#CP_PARAMS,0)"),
    (15, "error", "PANEL.src", "$ADVANCE=3", "$ADVANCE=3\n$ACC.CP=0.0"),
    (16, "error", "PANEL.src", "$ADVANCE=3", "$ADVANCE=3\n$VEL_AXIS[7]=50"),
    (16, "error", "PANEL.src", "$ADVANCE=3", "$ADVANCE=3\n$ACC_AXIS[2]=0"),
    (16, "error", "PANEL.src", "$VEL.ORI1=200.0000", "$VEL.ORI1=572.96"),
    (30, "error", "PANEL.src", "WAIT SEC 0.5", "$CIRC_TYPE=5"),
    (16, "error", "PANEL.src", "$VEL.ORI1=200.0000", "$VEL={CP 0.2,ORI1 572.96,ORI2 200.0}"),
    (16, "error", "PANEL.src", "BAS(#VEL_PTP,50)", "BAS(#VEL_PTP,500)"),
    (16, "error", "PANEL.dat", "DECL PDAT PPDAT1={VEL 100.0", "DECL PDAT PPDAT1={VEL 0.0"),
    (17, "error", "PANEL.src", "$ADVANCE=3", "$ADVANCE=6"),
    (17, "error", "PANEL.src", "$APO.CPTP=50", "$APO.CPTP=150"),
    (17, "error", "PANEL.src", "$APO.CDIS=1.0000", "$APO.CDIS=-1.0"),
    (17, "warning", "PANEL.src", "$ADVANCE=3", "$ADVANCE=0"),
    (17, "warning", "PANEL_001.src", "$APO.CDIS=0.2000", "$APO.CDIS=8.0"),
    (18, "error", "PANEL.src", BOTTOM, BOTTOM + " C_DIS"),
    (18, "error", "PANEL.src", ABOVE, ABOVE + " C_DIS"),
    (18, "error", "PANEL.src", "A5 45.0,A6 0.0}\nEND", "A5 45.0,A6 0.0} C_PTP\nEND"),
    (18, "error", "PANEL.src", BOTTOM, BOTTOM + " C_PTP"),
    (18, "error", "PANEL.src", BOTTOM, BOTTOM + " C_SPL"),
    (18, "error", "PANEL.src", "PP_SPINDLE_OFF()", f"SPLINE\nS{BOTTOM} C_SPL\nENDSPLINE"),
    (18, "warning", "PANEL.src", "WAIT SEC 0.5\n", "WAIT SEC 0.5\n" + ABOVE + " C_DIS\nHALT\n"),
    (18, "warning", "PANEL.src", "PTP XP1", "PTP XP1 C_PTP\nS" + ABOVE),
    (20, "warning", "PANEL.src", "WAIT SEC 0.5", "$OUT[7]=TRUE"),
    (20, "warning", "PANEL.src", "WAIT SEC 0.5", "IF $IN[4] THEN\nHALT\nENDIF"),
    (21, "warning", "PANEL.src", "PP_SPINDLE_OFF()\n", ""),
    (21, "warning", "PANEL.src", "PP_SPINDLE_ON(3000)\n", ""),
    (
        22,
        "warning",
        "PANEL.src",
        "WAIT SEC 0.5",
        f"{TRIGGER}$OUT[1]=TRUE\nHALT",
    ),
    (22, "warning", "PANEL.src", "PTP XP1", "TRIGGER WHEN PATH=5 DELAY=0 DO $OUT[1]=TRUE\nPTP XP1"),
    (22, "error", "PANEL.src", "PTP XP1", f"{TRIGGER}PP_BLOW(1)\nPTP XP1"),
    (22, "error", "PANEL.src", "PTP XP1", f"{TRIGGER}PP_BLOW() PRIO=200\nPTP XP1"),
    (22, "warning", "PANEL.src", "PTP XP1", f"{TRIGGER}PP_BLOW() PRIO=50\nPTP XP1"),
    (22, "error", "PANEL.src", "$ADVANCE=3", "INTERRUPT DECL 200 WHEN $IN[1] DO PP_X( )"),
    (22, "error", "PANEL.src", "$ADVANCE=3", "INTERRUPT ON 21"),
    (22, "error", "PANEL.src", "WAIT SEC 0.5", "BRAKE"),
    (22, "error", "PANEL.src", "WAIT SEC 0.5", "RESUME"),
    (7, "error", "PANEL.src", "WAIT SEC 0.5", "WAIT SEC -1"),
    (17, "warning", "PANEL_001.src", "$APO.CDIS=0.2000", "$APO.CDIS=0"),
    (17, "warning", "PANEL_001.src", "$APO.CDIS=0.2000", "$APO={CDIS 0.0,CPTP 50}"),
    (27, "error", "PANEL.src", "WAIT SEC 0.5", 'nHole="abc"'),
    (30, "error", "PANEL.src", "$ADVANCE=3", "$OV_PRO=200"),
    (30, "error", "PANEL.src", "$ADVANCE=3", "$ANOUT[1]=2.5"),
    (30, "error", "PANEL.src", "$ADVANCE=3", "$SOFTP_END[13]=2.5"),
    (16, "error", "PANEL.src", "$ADVANCE=3", "$ACC_EXTAX[2]=120"),
    (22, "warning", "PANEL.src", "$ADVANCE=3", "INTERRUPT DECL 3 WHEN $IN[1] DO PP_X( )"),
    (
        22,
        "warning",
        "PANEL.src",
        "$ADVANCE=3",
        "INTERRUPT DECL 21 WHEN $IN[1] DO PP_X( )\nINTERRUPT DECL 21 WHEN $IN[2] DO PP_X( )",
    ),
    (23, "warning", "PANEL.src", ";ENDFOLD (INI)\n", ""),
    (23, "warning", "PANEL.src", ";FOLD INI\n", ""),
    (23, "error", "PANEL_001.src", "Tool[1]:t", "Tool[2]:t"),
    (23, "error", "PANEL_001.src", "LIN XP2 C_DIS", "LIN XP2"),
    (23, "error", "PANEL_001.src", "LIN XP2 C_DIS", "PTP XP2 C_DIS"),
    (23, "error", "PANEL_001.src", "Vel=0.5 m/s", "Vel=0.7 m/s"),
    (23, "error", "PANEL_001.src", "2:P2", "2:P3"),
    (23, "error", "PANEL_001.src", "P2 CONT", "P9 CONT"),
    (23, "warning", "PANEL_001.src", "LIN XP2 C_DIS", "LIN XP2 C_DIS\n$VEL.CP=0.1"),
    (24, "error", "PANEL.src", CIRCLE, "CIRC {X 130.0,Y 10.0,Z 50.0},"),
    (24, "error", "PANEL.src", CIRCLE, "CIRC {X 130.0,Y 20.0,Z 50.0},"),
    (24, "error", "PANEL.src", CIRCLE, "CIRC {X 130.0,Y 0.0,Z 50.0},"),
    (24, "warning", "PANEL.src", CIRCLE, "CIRC {X 130.0005,Y 10.0,Z 50.0},"),
    (25, "warning", "PANEL.dat", "T 'B000010'}", "T 'B000010',E1 12.5}"),
    (26, "warning", "PANEL.src", "CAM line 4", "made 2024-05-17"),
    (26, "warning", "PANEL.src", "&REL 1", "&COMMENT 17.05.2024"),
    (26, "warning", "PANEL.src", "CAM line 4", "at 14:03:22"),
    (26, "warning", "PANEL.src", BOTTOM, BOTTOM.replace("Y 0.0000", "Y -0.0000")),
    (1, "error", "PANEL.src", ABOVE, f"{ABOVE} C_DISS"),
    (1, "error", "PANEL.src", ABOVE, f"{ABOVE},CA 90"),
    (4, "error", "PANEL_001.src", "DEF SLIN_SAFE( )", "DEF BAS( )"),
    (4, "error", "PANEL_001.src", "DEF SLIN_SAFE( )", "DEF Sqrt( )"),
    (6, "error", "PANEL.src", "DECL INT nHole", "DECL INT nHole,nSizes[]"),
    (7, "error", "PANEL.dat", POINT, POINT.replace("E6POS", "FRAME")),
    (7, "error", "PANEL.dat", "T 'B000010'}", "T 'B000010',E1 1.0}\nDECL POS XP2={X 1.0,E1 2.0}"),
    (7, "error", "PANEL.src", "BAS(#TOOL,1)", "$BASE={X 1.0,S 2}\nBAS(#TOOL,1)"),
    (22, "warning", "PANEL.src", "PTP XP1", f"{TRIGGER.replace('=0', '=2', 1)}HALT\nPTP XP1"),
    (27, "error", "PANEL.dat", POINT, POINT.replace("E6POS", "INT")),
    (27, "error", "PANEL.dat", POINT, POINT.replace("E6POS", "REAL")),
    (27, "error", "PANEL.dat", POINT, POINT.replace("E6POS", "LOAD")),
    (27, "error", "PANEL.dat", POINT, POINT.replace("E6POS", "E6AXIS")),
    (27, "error", "PANEL.dat", POINT, POINT.replace("E6POS", "E7POS")),
    (27, "warning", "PANEL.dat", POINT, POINT.replace("E6POS", "PLACE_T")),
    (27, "error", "PANEL.dat", "ENDDAT", "DECL INT nFlag=TRUE\nENDDAT"),
    (27, "error", "PANEL.dat", "ENDDAT", "DECL BOOL bFlag=1\nENDDAT"),
    (27, "error", "PANEL.dat", "ENDDAT", "DECL REAL rFlag=#BASE\nENDDAT"),
    (27, "error", "PANEL.dat", "ENDDAT", "ENUM SIDE_T L,R\nDECL SIDE_T eSide=#M\nENDDAT"),
    (27, "error", "PANEL.dat", "ENDDAT", "STRUC JOB_T INT N\nDECL JOB_T j={M 1}\nENDDAT"),
    (27, "error", "PANEL.src", "WAIT SEC 0.5", "nHole=XP1"),
    (27, "error", "PANEL.src", "WAIT SEC 0.5", "nHole=nHole>1"),
    (27, "error", "PANEL.src", "WAIT SEC 0.5", "XP1.X=TRUE"),
    (27, "error", "PANEL.src", "WAIT SEC 0.5", "$BASE=3"),
    (27, "error", "PANEL.src", "WAIT SEC 0.5", "$OUT[7]=1"),
    (27, "error", "PANEL.src", "PTP XP1", "PTP nHole"),
    (27, "error", "PANEL.src", BOTTOM, "LIN {A1 3.0}"),
    (28, "error", "PANEL.src", "PANEL_001()", "PANEL_001(3)"),
    (28, "error", "PANEL_001.src", "SLIN_SAFE( )\nLIN", "SLIN_SAFE(1)\nLIN"),
    (28, "error", "PANEL_001.src", "DEF SLIN_SAFE( )", "DEF SLIN_SAFE(n :IN)"),
    (28, "error", "PANEL.src", "nHole<>2", "nHole<>PANEL_001()"),
    (28, "error", "PANEL.src", "WAIT SEC 0.5", "RETURN 3"),
    (28, "error", "PANEL.src", "BAS(#TOOL,1)", "BAS(#TOOL,1)\nBAS(#BASE)"),
    (4, "error", "PANEL.src", "WAIT SEC 0.5", "A234567890123456789012345( )"),
    (27, "error", "PANEL.src", "nHole<>2", "nHole"),
    (27, "error", "PANEL.src", "WAIT SEC 0.5", "WAIT FOR XP1"),
    (27, "error", "PANEL.src", "nHole<>2", "nHole<>#BASE"),
    (28, "warning", "PANEL_001.src", LAST, LAST + FUNCTION.replace("RETURN a>1\n", "")),
    (28, "warning", "PANEL_001.src", LAST, FUNCTION + LAST.replace("HALT", "NEAR( )")),
    (29, "error", "PANEL.src", "WAIT SEC 0.5", "GOTO NOWHERE"),
    (29, "error", "PANEL.src", "WAIT SEC 0.5", "AGAIN:\nAgain:"),
    (30, "error", "PANEL.src", "WAIT SEC 0.5", "$VELL.CP=1.0"),
    (30, "error", "PANEL.src", "WAIT SEC 0.5", "WAIT FOR $TIEMR_FLAG[1]"),
    (30, "warning", "PANEL.src", "WAIT SEC 0.5", "$GLUE_FLOW=1.0"),
    (30, "error", "PANEL.src", "WAIT SEC 0.5", "$VEL.XX=1.0"),
    (30, "error", "PANEL.src", "WAIT SEC 0.5", "$IN[3]=TRUE"),
    (30, "error", "PANEL.src", "WAIT SEC 0.5", "$POS_ACT.X=3.0"),
    (30, "error", "PANEL.src", "PTP XP1", f"{TRIGGER}$IN[1]=TRUE\nPTP XP1"),
    (30, "error", "PANEL.src", "WAIT SEC 0.5", "$OUT[0]=TRUE"),
    (30, "error", "PANEL.src", "WAIT SEC 0.5", "$ORI_TYPE=#FOO"),
    (30, "error", "PANEL.src", "WAIT SEC 0.5", f"S{BOTTOM} WITH $ORI_TYPE=#FOO"),
    (30, "error", "PANEL.src", "WAIT SEC 0.5", "BAS(#TOOLS,1)"),
    (31, "error", "PANEL.src", BOTTOM, f"SPLINE\nWAIT SEC 1\nS{BOTTOM}\nENDSPLINE"),
    (31, "error", "PANEL.src", BOTTOM, f"SPLINE\n$VEL.CP=0.1\nS{BOTTOM}\nENDSPLINE"),
    (31, "error", "PANEL.src", BOTTOM, f"SPLINE\nPP_BLOW( )\nS{BOTTOM}\nENDSPLINE"),
    (31, "error", "PANEL.src", BOTTOM, f"SPLINE\n{BOTTOM}\nENDSPLINE"),
    (31, "error", "PANEL.src", BOTTOM, f"PTP_SPLINE\nS{BOTTOM}\nENDSPLINE"),
    (31, "error", "PANEL.src", BOTTOM, BOTTOM.replace("LIN", "SPL")),
]
SOUND = [
    # row, file, text, replaced by what a controller takes
    (1, "PANEL.src", ABOVE, ABOVE + " C_DIS"),
    (4, "PANEL_001.src", "DEF SLIN_SAFE( )", "DEF BAS_SAFE( )"),
    (6, "PANEL_001.src", LAST, FUNCTION + LAST),
    (7, "PANEL.dat", "ENDDAT", "DECL FRAME fA={X 1.0,C 2.0}\nDECL POS pA={X 1.0,S 2}\nENDDAT"),
    (22, "PANEL.src", "PTP XP1", f"{TRIGGER.replace('=0', '=1', 1)}$OUT[1]=TRUE\nPTP XP1"),
    (27, "PANEL.dat", POINT, POINT.replace("DECL", "DECL GLOBAL").replace("E6POS", "POS")),
    (27, "PANEL.dat", "ENDDAT", "DECL INT n=2.5\nDECL REAL r=2\nDECL CHAR c[4]\nENDDAT"),
    (27, "PANEL.dat", "ENDDAT", 'DECL CHAR c[4]\nc[]="abc"\nDECL E6POS P[2]\nP[1]={X 1.0}\nENDDAT'),
    (27, "PANEL.dat", "ENDDAT", "ENUM SIDE_T L,R\nDECL SIDE_T eSide=#l\nENDDAT"),
    (27, "PANEL.dat", "ENDDAT", "STRUC J_T INT N,REAL X,Y\nDECL J_T j={N 1,X 2.0}\nENDDAT"),
    (27, "PANEL.dat", "ENDDAT", "STRUC V_T REAL X,Y\nDECL V_T v={X 1.0,Y 2.0}\nENDDAT"),
    (27, "PANEL.src", "WAIT SEC 0.5", "nHole=rOfNobody*2.5\nnHole=nHole/2"),
    (27, "PANEL.src", "WAIT SEC 0.5", "XP1=$POS_ACT\nXP1.X=nHole\n$BASE=BASE_DATA[2]"),
    (27, "PANEL.src", "WAIT SEC 0.5", "XP1=$BASE:XP1\n$OUT[7]=nHole>2 AND $IN[3]"),
    (27, "PANEL.src", "PTP XP1", "PTP $AXIS_ACT\nPTP XP1\nPTP XOFNOBODY"),
    (27, "PANEL.src", BOTTOM, "LIN XP1\nLIN $POS_ACT\n" + BOTTOM),
    (28, "PANEL_001.src", LAST, FUNCTION + LAST.replace("HALT", "IF NEAR(2,n[]) THEN\nENDIF")),
    (28, "PANEL.src", "BAS(#TOOL,1)", "BAS(#TOOL,1)\nBAS(#FRAMES)"),
    (28, "PANEL_001.src", LAST, FUNCTION + LAST.replace("HALT", "NEAR(2)")),
    (29, "PANEL.src", "WAIT SEC 0.5", "IF nHole>3 THEN\nGOTO again\nENDIF\nAGAIN:"),
    (30, "PANEL.src", "WAIT SEC 0.5", "$OUT[7]=$IN[3]\n$ORI_TYPE=#CONSTANT\n$IPO_MODE=#tcp"),
    (30, "PANEL.dat", "ENDDAT", "DECL GLOBAL REAL $VELL=1.0\nENDDAT"),
    (30, "PANEL.src", "WAIT SEC 0.5", "$TIMER[1]=0\n$CYCFLAG[9]=$TIMER_FLAG[1]\n$VEL.ORI1=100.0"),
    (
        31,
        "PANEL.src",
        BOTTOM,
        "SPLINE WITH $VEL.CP=0.05\n;FOLD way\n"
        f"TRIGGER WHEN PATH=5 DELAY=0 DO $OUT[1]=TRUE\nSPL XP1\nTIME_BLOCK START\n"
        f"S{BOTTOM} WITH $VEL.CP=0.1\n;ENDFOLD\n\nTIME_BLOCK END=2\nENDSPLINE C_SPL",
    ),
    (31, "PANEL.src", "PTP XP1", "PTP_SPLINE\nSPTP XP1\nENDSPLINE"),
]


@pytest.mark.parametrize(
    ("row", "severity", "name", "old", "new"),
    MUTANTS,
    ids=[f"{row}-{index}" for index, (row, *_) in enumerate(MUTANTS)],
)
def test_each_row_is_triggered(row, severity, name, old, new):
    assert (f"KRL1{row:02d}", severity) in found(mutated(name, old, new))


@pytest.mark.parametrize(
    ("row", "name", "old", "new"),
    SOUND,
    ids=[f"{row}-{index}" for index, (row, *_) in enumerate(SOUND)],
)
def test_what_a_controller_takes_is_no_finding_of_the_row(row, name, old, new):
    assert f"KRL1{row:02d}" not in {code for code, _ in found(mutated(name, old, new))}


@pytest.mark.parametrize(
    ("declared", "line", "is_wrong"),
    [
        ("DECL INT n[3]", "n[3]=1", False),
        ("DECL INT n[3]", "n[4]=1", True),
        ("DECL INT n[3]", "n[0]=1", True),
        ("DECL INT n[3]", "WAIT SEC n[5]", True),
        ("DECL INT n[3],i", "n[i]=1", False),
        ("DECL REAL r[2,4]", "r[2,4]=1", False),
        ("DECL REAL r[2,4]", "r[3,4]=1", True),
        ("DECL CHAR t[8]", 't[]="12345678"', False),
        ("DECL INT i", 'i="A"', False),
        ("DECL INT i", 'i="AB"', True),
        ("IMPORT INT n IS /R1/OTHER..n", "n=4", False),
        ("IMPORT REAL DIST[3] IS /R1/OTHER..DIST", "DIST[2]=4", False),
        ("DECL RSI_T r", "IF RSI_ON(#RELATIVE)<>RSIOK THEN\nHALT\nENDIF", False),
    ],
)
def test_elements_and_names_from_elsewhere(declared, line, is_wrong):
    lines = mutated("PANEL.src", "DECL INT nHole", f"DECL INT nHole\n{declared}")
    text = lines["PANEL.src"].replace("WAIT SEC 0.5", line)
    errors = {code for code, severity in found({**lines, "PANEL.src": text}) if severity == "error"}
    assert errors == ({"KRL127"} if is_wrong else set())


def test_constants_need_no_decl(tmp_path):
    data = 'DEFDAT GOOD\nCONST CHAR XA[16]\nXA[]="1.2"\nCONST INT N=3\nENDDAT\n'
    folder = on_disk(tmp_path, {"GOOD.src": "DEF GOOD( )\nHALT\nEND\n", "GOOD.dat": data})
    assert not [f for f in lint(load_modules([folder])) if f.severity is Severity.ERROR]


def test_every_row_that_text_shows_has_a_mutant():
    rows = {row for row, *_ in MUTANTS}
    assert rows == set(range(1, 32)) - {13, 14, 19}
    assert rows >= {row for row, *_ in SOUND} >= set(range(27, 32))


def test_files_on_their_own():
    bom = b"\xef\xbb\xbf" + MAIN.replace("\n", "\r\n").encode()
    assert ("KRL108", "error") in found({**FILES, "PANEL.src": bom})
    unix = {**FILES, "PANEL.src": MAIN.encode()}
    assert ("KRL108", "warning") in found(unix)
    mixed = {**FILES, "PANEL.src": MAIN.replace("\n", "\r\n", 5).encode()}
    assert ("KRL108", "warning") in found(mixed)
    unclosed = {**FILES, "PANEL.src": MAIN.replace("\n", "\r\n").rstrip().encode()}
    assert ("KRL108", "warning") in found(unclosed)
    small = LintOptions(max_points=3)
    assert ("KRL108", "warning") in found(FILES, small)
    assert ("KRL108", "warning") in found(FILES, LintOptions(max_bytes=100))


def test_names_over_the_whole_batch():
    twice = {**FILES, "sub/panel.src": MAIN, "sub/panel.dat": DATA}
    assert ("KRL103", "error") in found(twice)
    shared = {
        "A.src": "DEF A( )\nEND\n",
        "A.dat": "DEFDAT A PUBLIC\nDECL GLOBAL INT n=1\nENDDAT\n",
        "B.src": "DEF B( )\nEND\n",
        "B.dat": "DEFDAT B PUBLIC\nDECL GLOBAL INT n=2\nENDDAT\n",
    }
    assert ("KRL104", "error") in found(shared)
    routines = {
        "A.src": "DEF A( )\nEND\nGLOBAL DEF HELP( )\nEND\n",
        "B.src": "DEF B( )\nEND\nGLOBAL DEF help( )\nEND\n",
    }
    assert ("KRL104", "error") in found(routines)


def test_what_the_options_allow():
    zero = mutated("PANEL.src", "BAS(#BASE,2)", "BAS(#BASE,0)")
    assert ("KRL110", "error") not in found(zero, LintOptions(allow_zero=True))
    many = mutated("PANEL.src", "BAS(#TOOL,1)", "BAS(#TOOL,20)")
    assert ("KRL110", "error") not in found(many, LintOptions(max_tool=32))
    paused = mutated("PANEL.src", "WAIT SEC 0.5", "WAIT SEC rPause")
    assert found(paused, LintOptions(names=frozenset({"rpause"}))) == set()
    clamp = mutated("PANEL.src", "WAIT SEC 0.5", "CLAMP_OPEN(1)")
    assert found(clamp, LintOptions(routines=frozenset({"Clamp_Open"}))) == set()
    assert ("KRL125", "warning") in found(FILES, LintOptions(externals=1))


def test_the_config_of_the_controller_declares_names():
    config = {"$config.dat": "DEFDAT $CONFIG\nDECL REAL rPause=0.5\nENDDAT\n"}
    paused = mutated("PANEL.src", "WAIT SEC 0.5", "WAIT SEC rPause")
    assert found({**paused, **config}) == set()


def test_notes_and_places():
    findings = run(mutated("PANEL.dat", "ENDDAT", "DECL E6POS XSPARE={X 1.0,Y 2.0,Z 3.0}\nENDDAT"))
    notes = [i for i in findings if i.severity is Severity.NOTE]
    assert {i.code for i in notes} == {"KRL105"}
    assert any("XSPARE" in i.message and i.source.path == "PANEL.dat" for i in notes)
    assert any("PP_SPINDLE_ON" in i.message and i.source.line == 19 for i in notes)


def test_hundreds_of_findings_are_counted_not_listed():
    lines = "".join(f"LIN {{X {i}.0,Y -0.0,Z 1.0}}\n" for i in range(500))
    findings = run(mutated("PANEL.src", "WAIT SEC 0.5\n", lines))
    zeros = [i for i in findings if i.code == "KRL126"]
    assert len(zeros) == 101
    assert zeros[0].message == "400 more findings of KRL126"


def test_the_order_of_rules_and_findings_is_fixed():
    files = mutated("PANEL.src", "$ADVANCE=3", "$ADVANCE=9\n$VEL.CP=0")
    assert run(files) == run(files)
    lines = [i.source.line for i in run(files) if i.source.path == "PANEL.src"]
    assert lines == sorted(lines)
    assert len(RULES) == len({rule.__name__ for rule in RULES})


def test_calls_of_global_routines_of_the_folder_are_held_against_them(tmp_path):
    library = (
        "DEF LIB( )\nEND\nGLOBAL DEF HOLE(d :IN,n :IN)\nDECL REAL d\nDECL INT n\n"
        'IF VARSTATE("n")==#UNDEFINED THEN\nn=1\nENDIF\nIF d>1 THEN\nENDIF\nEND\n'
    )
    calls = "HOLE(1,2)\nHOLE(1)\nHOLE(1,2,3)\nHOLE(TRUE,2)\nHOLE({X 1.0},2)\n"
    folder = on_disk(tmp_path, {"LIB.src": library, "JOB.src": f"DEF JOB( )\n{calls}END\n"})
    findings, _ = lint_files([folder])
    told = {(i.code, i.source.line) for i in findings if i.severity is Severity.ERROR}
    assert told == {("KRL128", 4), ("KRL127", 5), ("KRL127", 6)}


def test_types_and_signals_of_a_config_are_known(tmp_path):
    text = (
        "DEF JOB( )\nDECL SIDE_T eSide\nDECL POST xPost\neSide=#LEFT\nIF DI_ON THEN\nENDIF\nEND\n"
    )
    config = (
        "DEFDAT $CONFIG\nENUM SIDE_T LEFT,RIGHT\nSTRUC POST INT N\nSIGNAL DI_ON $IN[7]\nENDDAT\n"
    )
    folder = on_disk(tmp_path, {"JOB.src": text, "config/$config.dat": config})
    findings, _ = lint_files([folder / "JOB.src"], config=[folder / "config/$config.dat"])
    assert [i for i in findings if i.severity is not Severity.NOTE] == []


def test_types_that_two_files_define_otherwise_are_not_judged():
    first = "DEFDAT A\nENUM SIDE_T L,R\nDECL SIDE_T e=#L\nENDDAT\n"
    second = "DEFDAT B\nENUM SIDE_T UP,DOWN\nDECL SIDE_T e=#UP\nENDDAT\n"
    assert "KRL127" not in {code for code, _ in found({"A.dat": first, "B.dat": second})}


def test_a_bracket_alone_is_one_error():
    assert ("KRL101", "error") in found(mutated("PANEL.src", "WAIT SEC 0.5", "("))


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("$VELL", "$VEL"),
        ("$ADVNACE", "$ADVANCE"),
        ("$ADVANC", "$ADVANCE"),
        ("$BACE", "$BASE"),
        ("$BASES", ""),
        ("$MYBASE", ""),
        ("$AXWORKSTATE9", ""),
        ("$IM", ""),
    ],
)
def test_the_nearest_name_is_one_slip_away(name, meant):
    assert nearest(name, {*system_variables(), "$VEL"}, counts_digits=False) == meant


CONTROLLER = {
    "R1/System/$config.dat": (
        "DEFDAT $CONFIG\nINT MAX_TOOL=20\nSIGNAL DI_CLAMP $IN[7]\nDECL REAL rPause=0.5\nENDDAT\n"
    ),
    "R1/System/bas.src": (
        "DEF BAS(CMD :IN,V :IN)\nDECL BAS_COMMAND CMD\nREAL V\nIF A10_OPTION==1 THEN\nENDIF\nEND\n"
    ),
    "R1/Mada/$machine.dat": (
        "DEFDAT $MACHINE PUBLIC\nINT $EX_AX_NUM=0\n"
        "$CYLWORKSPACE[1]={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0,Z1 0.0,Z2 0.0,MODE #OFF}\n"
        "DECL ACC_CAR $ACC_CAR_LIMIT={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0,ABS 0.0}\nENDDAT\n"
    ),
    "STEU/$config.dat": "DEFDAT $CONFIG\nENDDAT\n",
    "R1/Program/points.dat": "DEFDAT POINTS PUBLIC\nDECL GLOBAL REAL gSpeed=0.1\nENDDAT\n",
    "R1/Program/job.src": (
        "DEF JOB( )\nDECL BOOL ok\nBAS(#INITMOV,0)\nBAS(#TOOL,18)\nok=READY(gSpeed,rPause)\n"
        "IF ok AND DI_CLAMP THEN\nLIN {X 1.0}\nENDIF\nX$1=A10_OPTION\nEND\n"
        "DEFFCT BOOL READY(a[,]:OUT, b:IN)\nREAL a[,]\nREAL b\n"
        "IF b>0 THEN\nRETURN TRUE\nENDIF\nSET_IT(# State)\nRETURN FALSE\nENDFCT\n"
    ),
    "R1/Program/job.dat": "DEFDAT JOB\nDECL INT X$1=0\nENDDAT\n",
}


def on_disk(folder, files):
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text.replace("\n", "\r\n").encode())
    return folder


@pytest.mark.parametrize("asked", ["", "R1", "R1/Program", "R1/Program/job.src"])
def test_a_controller_is_one_project(tmp_path, asked):
    findings, files = lint_files([on_disk(tmp_path, CONTROLLER) / asked])
    assert [str(i) for i in findings if i.severity is Severity.ERROR] == []
    assert str(tmp_path / "STEU" / "$config.dat") not in files
    options = [i for i in findings if "A10_OPTION" in i.message]
    assert len(options) <= 1


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("gSpeed,", "gSpeedy,", "KRL105"),
        ("#TOOL,18", "#TOOL,21", "KRL110"),
        ("ENDIF\nX$1", "X$1", "KRL102"),
        ("LIN {X 1.0}", "LIN {X 1.0,Q 2.0}", "KRL107"),
        ("RETURN FALSE", "RETURN FALSE FALSE", "KRL101"),
    ],
)
def test_faults_of_a_project_stay_errors(tmp_path, old, new, code):
    text = CONTROLLER["R1/Program/job.src"]
    assert old in text
    folder = on_disk(tmp_path, {**CONTROLLER, "R1/Program/job.src": text.replace(old, new, 1)})
    findings, _ = lint_files([folder / "R1"])
    assert code in {i.code for i in findings if i.severity is Severity.ERROR}


def test_a_module_taken_from_its_project_gets_one_warning(tmp_path):
    names = "".join(f"rA=gValue{i}+gOther{i}\n" for i in range(20))
    text = f"DEF JOB( )\nDECL REAL rA\nSTATION1( )\n{names}END\n"
    findings, _ = lint_files([on_disk(tmp_path, {"JOB.src": text}) / "JOB.src"])
    assert [i.code for i in findings if i.severity is not Severity.NOTE] == ["KRL105"]
    assert "STATION1, GOTHER0" in findings[0].message


def test_a_bad_file_in_a_folder_is_a_finding(tmp_path):
    folder = on_disk(tmp_path, {"GOOD.src": "DEF GOOD( )\nEND\n"})
    (folder / "bad.src").write_bytes(b"\x00\x01\x02")
    findings, files = lint_files([folder])
    assert [(i.code, i.source.path) for i in findings] == [("KRL001", str(folder / "bad.src"))]
    assert len(files) == 2
    with pytest.raises(KrlError, match="KRL001"):
        lint_files([folder / "bad.src"])


def test_letters_that_an_editor_broke_in_a_comment_are_no_binary_file(tmp_path):
    text = "DEF JOB( )\n; uderza\x05 o siebie\nBAS(#INITMOV,0)\nEND\n"
    assert "KRL001" not in {i.code for i in run({"JOB.src": text})}
    folder = on_disk(tmp_path, {"BAD.src": "DEF BAD( )\nx\x05=1 ; a letter\nEND\n"})
    assert {i.code for i in lint_files([folder])[0]} == {"KRL001"}


def test_structures_of_options_have_components_of_their_own():
    nested = (
        "DEFDAT PARAMS PUBLIC\n"
        "STRUC STIFF_T REAL X,Y,Z,RX,RY,RZ\n"
        "DECL GLOBAL IMP_T imp[2]\n"
        "imp[1]={STIFFNESS {X 1.0,Y 1.0,Z 1.0,RX 2.0,RY 2.0,RZ 2.0},K 1.0}\n"
        "imp[2]={X 1.0,Y 1.0,Z 1.0,RX 2.0,RY 2.0,RZ 2.0}\nENDDAT\n"
    )
    assert "KRL107" not in {code for code, _ in found({"PARAMS.dat": nested})}
    load = "DEFDAT D\nDECL LOAD l={M 1.0,CM {X 1.0,Y 1.0,Z 1.0,A 0.0,B 0.0,C 0.0,Q 1.0}}\nENDDAT\n"
    assert ("KRL107", "error") in found({"D.dat": load})


def test_words_that_follow_interrupt_alone_are_names(tmp_path):
    text = "DEF JOB( ENABLE:IN )\nBOOL ENABLE\nIF ENABLE THEN\nENDIF\nEND\n"
    assert "KRL104" not in {code for code, _ in found({"JOB.src": text})}


def test_what_bas_lowers_is_a_warning():
    high = mutated("PANEL.dat", "ENDDAT", "DECL PDAT PX={VEL 50.0,ACC 500.0,APO_DIST 1.0}\nENDDAT")
    assert {s for c, s in found(high) if c == "KRL116"} == {"warning"}
    none = mutated("PANEL.dat", "ENDDAT", "DECL PDAT PX={VEL 50.0,ACC 0.0,APO_DIST 1.0}\nENDDAT")
    assert ("KRL116", "error") in found(none)


def test_a_fold_may_hold_whole_routines():
    text = ";FOLD HELP ( )\nDEF HELP( )\nEND\n;ENDFOLD HELP ( )\n"
    folded = "DEF JOB( )\nEND\n" + text
    assert "KRL123" not in {code for code, _ in found({"JOB.src": folded})}
    open_fold = "DEF JOB( )\nEND\n" + text.replace(";ENDFOLD HELP ( )\n", "")
    assert ("KRL123", "warning") in found({"JOB.src": open_fold})


@pytest.mark.parametrize(
    ("behind", "is_lost"),
    [
        ("LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\n", False),
        ("MOVE_ON( )\n", False),
        ("ENDIF\nMOVE_ON( )\nIF TRUE THEN\n", False),
        ("WAIT SEC 1.0\nMOVE_ON( )\n", True),
        ("", True),
    ],
)
def test_the_motion_of_a_trigger_may_stand_in_a_routine(behind, is_lost):
    text = (
        "DEF JOB( )\nBAS(#INITMOV,0)\nIF TRUE THEN\n"
        "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE\n"
        f"{behind}{'ENDIF' if behind else ''}\nEND\n"
        "DEF MOVE_ON( )\nPTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 10.0,A6 0.0}\nEND\n"
    )
    if not behind:
        text = text.replace("IF TRUE THEN\n", "")
    lost = [i for i in run({"JOB.src": text}) if "without a motion" in i.message]
    assert bool(lost) == is_lost


def test_globals_of_a_config_that_is_absent_are_one_warning_per_module(tmp_path):
    uses = "rA=gOne+gTwo\nIF gThree THEN\nENDIF\n"
    files = {f"JOB{i}.src": f"DEF JOB{i}( )\nDECL REAL rA\n{uses}END\n" for i in range(2)}
    files["LAST.src"] = "DEF LAST( )\nDECL REAL rA\nrA=gOne\nEND\n"
    findings, _ = lint_files([on_disk(tmp_path, files)])
    shown = [(i.code, i.severity) for i in findings if i.severity is not Severity.NOTE]
    assert shown == [("KRL105", Severity.WARNING)] * 3


def test_points_of_a_data_list_that_is_absent_stay_errors(tmp_path):
    moves = "".join(f"FDAT_ACT=FP{i}\nLIN XP{i}\n" for i in range(9))
    text = f"DEF JOB( )\nBAS(#INITMOV,0)\n{moves}END\n"
    findings, _ = lint_files([on_disk(tmp_path, {"JOB.src": text}) / "JOB.src"])
    missing = [i for i in findings if i.code == "KRL105" and i.severity is Severity.ERROR]
    assert len(missing) == 18
