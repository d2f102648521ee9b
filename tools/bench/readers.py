"""Speed and memory of the readers on large inputs made here, one process an input.

    python -m tools.bench readers [--mb 50] [--only NAME]

Prints MB/s of processor time on one core, points/s, and the peak memory as a multiple of the file
(bare interpreter with numpy subtracted), each beside its goal. Reference, numbers of single
libraries on another machine: APT line loop 22 MB/s, split + np.loadtxt or fromstring 52-63;
CSV np.loadtxt 103, csv module 12; XML lxml iterparse 39 MB/s.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

from postproc.readers import READERS, read
from tools.bench.harness import alone, peak_mb, spent

GOALS = {"apt": (15.0, 12.0), "csv": (40.0, 12.0), "delmia": (20.0, None)}
XML_PEAK_MB = 400.0
MEGA = 1e6


def nx() -> Iterator[str]:
    """Five-axis milling: long runs of points, every third with an axis."""
    yield "TOOL PATH/SURFACE,TOOL,BALL_10\nTLDATA/MILL,10.0000,5.0000,75.0000,0.0000,0.0000\n"
    yield "MSYS/100.0,50.0,20.0,0.0000000,1.0000000,0.0000000,-1.0000000,0.0000000,0.0000000\n"
    yield "LOAD/TOOL,2\nPAINT/COLOR,186\nRAPID\n"
    yield "GOTO/0.0000,0.0000,80.0000,0.0000000,0.0000000,1.0000000\n"
    yield "FEDRAT/MMPM,800.0000\n"
    for i in count(1):
        x, y, z = 300.0 * math.sin(0.001 * i), 0.01 * i % 400.0, 20.0 * math.cos(0.013 * i)
        axis = ""
        if i % 3 == 0:
            t = 0.3 * math.sin(0.002 * i)
            axis = f",{math.sin(t):.7f},0.0000000,{math.cos(t):.7f}"
        yield f"GOTO/{x:.4f},{y:.4f},{z:.4f}{axis}\n"
        if i % 40 == 0:
            yield f"PAINT/COLOR,{31 + i % 7}\n"


def solidworks() -> Iterator[str]:
    """Pocketing: short runs between rapids, feeds and arcs."""
    yield "PARTNO/1\nUNIT/MM\nINSERT/8MM CRB 3FL\nCUTTER/8.,0,4.,0,0,0,63.\nLOAD/TOOL,1\n"
    yield "CSI_SET_FLUTE_LENGTH/20.\nSPINDL/9000,RPM,CLW\nTRNTYP/WORLD,0,0,0\n"
    yield "CSYS/1.,0,0,0,0,1.,0,0,0,0,1.,0\n"
    for i in count(1):
        x, y, z = 7.0 * (i % 61), 9.0 * (i % 47), -0.25 * (i % 11)
        yield f"RAPID/\nGOTO/{x:.6f},{y:.6f},25.\nRAPID/\nGOTO/{x:.6f},{y:.6f},2.\n"
        yield f"FEDRAT/{300 + i % 9}.5,MMPM\nGOTO/{x:.6f},{y:.6f},{z:.4f}\nCUTCOM/LEFT\n"
        yield f"FEDRAT/900.,MMPM\nGOTO/{x + 20.0:.6f},{y:.6f},{z:.4f}\n"
        yield f"CIRCLE/{x + 20.0:.6f},{y + 3.0:.6f},{z:.4f},0,0,1.\n"
        yield f"GOTO/{x + 23.0:.6f},{y + 3.0:.6f},{z:.4f}\n"
        yield f"GOTO/{x + 23.0:.6f},{y + 9.0:.6f},{z:.4f}\nCUTCOM/OFF\n"


def catia() -> Iterator[str]:
    """Drilling: a cycle switched on and off around every hole."""
    yield "$$*CATIA0\n$$ Axis\n$$ 1.00000 0.00000 0.00000 100.0\n"
    yield "$$ 0.00000 1.00000 0.00000 50.0\n$$ 0.00000 0.00000 1.00000 20.0\n"
    yield "PARTNO PANEL\nLOADTL/1,1\nSPINDL/ 3000.0000,RPM,CLW\nFEDRAT/ 300.0000,MMPM\nRAPID\n"
    yield "GOTO  /    0.00000,    0.00000,  100.00000\n"
    for i in count(1):
        yield (
            f"CYCLE/DRILL, {6 + i % 3}.000000, 5.000000\n"
            f"GOTO  / {15.0 * (i % 99):10.5f}, {15.0 * (i // 99 % 99):10.5f},   20.00000\n"
            "CYCLE/OFF\n"
        )


def csv_numbers() -> Iterator[str]:
    """Points and normals."""
    yield "x,y,z,i,j,k\n"
    yield from (",".join(_row(i)) + "\n" for i in count(1))


def csv_holes() -> Iterator[str]:
    """Hole list with names and operations."""
    yield "id,x,y,z,i,j,k,depth,diameter,feed,operation\n"
    for i in count(1):
        row = ",".join(_row(i))
        yield f"R{i // 100:04d}H{i % 100:02d},{row},6.0,{4.8 + i % 2:.1f},120,skin{i // 500}\n"


def csv_comma() -> Iterator[str]:
    """Semicolons and decimal commas."""
    yield "Punkt;X [mm];Y [mm];Z [mm];I;J;K\r\n"
    for i in count(1):
        yield f"P{i};" + ";".join(_row(i)).replace(".", ",") + "\r\n"


def xml() -> Iterator[str]:
    """Cartesian targets with six joints each."""
    yield "<?xml version='1.0' encoding='UTF-8'?>\n<OLPData>\n <Resource id='r'>\n"
    yield "  <GeneralInfo><ResourceName>r</ResourceName></GeneralInfo>\n  <ActivityList Task='T'>\n"
    for i in count(1):
        x, y, z = (float(v) / 1000.0 for v in _row(i)[:3])
        joints = "".join(
            f"      <Joint DOFNumber='{j}' JointName='Joint {j}' JointType='Rotational' "
            "Units='deg'>\n"
            f"       <JointValue LowerTravelLimit='-170.0000156' Status='WithinReach' "
            f"UpperTravelLimit='170.0000156'>{10.0 * j + 0.001 * (i % 999):.8f}\n"
            "       </JointValue>\n      </Joint>\n"
            for j in range(1, 7)
        )
        yield (
            f"   <Activity ActivityType='DNBRobotMotionActivity' Operation='O{i}' id='_{i}'>\n"
            f"    <OperationAttributeList/>\n    <ActivityName>RobotMotion.{i}</ActivityName>\n"
            "    <MotionAttributes>\n     <MotionProfile>Default</MotionProfile>\n"
            "     <ToolProfile>Default</ToolProfile>\n"
            "     <AccuracyProfile>Default</AccuracyProfile>\n"
            "     <ObjectFrameProfile>Default</ObjectFrameProfile>\n"
            "     <MotionType>Linear</MotionType>\n    </MotionAttributes>\n"
            "    <Target Default='Cartesian' ViaPoint='false'>\n     <BaseWRTWorld>\n"
            "      <Position Units='m' X='0' Y='0' Z='0'/>\n"
            "      <Orientation Pitch='0' Roll='0' Units='deg' Yaw='0'/>\n     </BaseWRTWorld>\n"
            f"     <CartesianTarget Status='WithinReach'>\n"
            f"      <Position Units='m' X='{x:.9f}' Y='{y:.9f}' Z='{z:.9f}'/>\n"
            f"      <Orientation Pitch='{i % 80}.5' Roll='18.02' Units='deg' Yaw='15.54'/>\n"
            f"      <Config Name='Config_1'/>\n      <Tag TagGroup='G'>T{i}</Tag>\n"
            f"     </CartesianTarget>\n     <JointTarget>\n{joints}     </JointTarget>\n"
            "    </Target>\n    <AttributeList/>\n   </Activity>\n"
        )


def _row(i: int) -> tuple[str, ...]:
    t = 0.3 * math.sin(0.01 * i)
    return (
        f"{1000.0 * math.sin(0.0007 * i):.6f}",
        f"{0.5 * (i % 4000):.6f}",
        f"{800.0 + 0.01 * (i % 977):.6f}",
        f"{math.sin(t):.9f}",
        "0.000000000",
        f"{math.cos(t):.9f}",
    )


CASES: dict[str, tuple[str, str, Callable[[], Iterator[str]], str]] = {
    "nx": ("apt", ".cls", nx, "END-OF-PATH\n"),
    "solidworks": ("apt", ".apt", solidworks, "FINI\n"),
    "catia": ("apt", ".aptsource", catia, "FINI\n"),
    "csv_numbers": ("csv", ".csv", csv_numbers, ""),
    "csv_holes": ("csv", ".csv", csv_holes, ""),
    "csv_comma": ("csv", ".csv", csv_comma, ""),
    "xml": ("delmia", ".xml", xml, "  </ActivityList>\n </Resource>\n</OLPData>\n"),
}


def write_input(path: Path, parts: Iterator[str], end: str, size: float) -> None:
    """Write about ``size`` bytes."""
    written = 0
    with path.open("w", encoding="latin-1", newline="") as stream:
        while written < size:
            chunk = "".join(next(parts) for _ in range(2000))
            stream.write(chunk)
            written += len(chunk)
        stream.write(end)


def measure(path: str) -> None:
    """Read one file in this process and print what it took as JSON."""
    list(READERS)
    bare = peak_mb()
    with spent() as used:
        toolpath = read(path)
    print(json.dumps({"s": used.cpu, "n": len(toolpath), "peak_mib": peak_mb() - bare}))


def main() -> None:
    """Measure all cases."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--mb", type=float, default=50.0)
    parser.add_argument("--only", choices=list(CASES))
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        measure(arguments.measure)
        return
    print("case             MB    MB/s  goal  kpoints/s  peak MB  x file")
    for name, (kind, suffix, make, end) in CASES.items():
        if arguments.only not in (None, name):
            continue
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"input{suffix}"
            write_input(path, make(), end, arguments.mb * MEGA)
            size = path.stat().st_size / MEGA
            result = alone("readers", "--measure", str(path))
        used = result["peak_mib"] * 2**20 / MEGA
        goal, times = GOALS[kind]
        limit = f"{used / size:6.1f}x" if times else f"<{XML_PEAK_MB:.0f} MB"
        print(
            f"{name:<12} {size:6.1f} {size / result['s']:7.1f} {goal:5.0f} "
            f"{result['n'] / result['s'] / 1000:10.0f} {used:8.0f} {limit:>7}"
        )
