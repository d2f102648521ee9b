"""A wing panel in two setups: every hole drilled in pecks, countersunk and reamed."""

from dataclasses import dataclass

TOOLS = ((1, "DRILL"), (2, "CSINK"), (3, "REAM"))
CYCLES = {
    1: "CYCLE/DRILL,DEEP,STEP,5.,CLEAR,3.,FEDTO,-12.,RTRCTO,20.,MMPM,250.",
    2: "CYCLE/DRILL,CLEAR,3.,FEDTO,-2.,RTRCTO,20.,MMPM,120.",
    3: "CYCLE/REAM,CLEAR,3.,FEDTO,-12.,RTRCTO,20.,MMPM,90.",
}
DEPTHS = {1: 12.0, 2: 2.0, 3: 12.0}
LENGTHS = {1: 60.0, 2: 48.0, 3: 80.0}
"""Length of the cutters [mm], from the TCP to the holder."""
SETUPS = {1: (0.0, 0.0, 0.0), 2: (400.0, 100.0, 0.0)}
"""Origin of each MSYS in the part [mm]."""
ORIGINS = {1: (1500.0, -300.0, 600.0), 2: (1500.0, 200.0, 600.0)}
"""Where the cell has them in the robot root [mm]."""
HEAD = 'schema = "postproc.cell/1"\n[robot]\nmodel = "kuka_kr500_r2830"\n'
HOME = "[motion]\nhome_deg = [0, -90, 90, 0, 45, 0]\nfeed_mm_min = 500\n"


@dataclass(frozen=True)
class Hole:
    """A hole of the job: tool and setup of the CAM file, its top in the setup [mm]."""

    tool: int
    setup: int
    x: float
    y: float


def grid(count):
    """Return ``count`` places on a panel, 15 mm apart, 20 in a row."""
    return [((i % 20) * 15.0, (i // 20) * 15.0) for i in range(count)]


def holes(count):
    """Return the holes of the job in their order, ``count`` places in each setup."""
    return [
        Hole(tool, setup, x, y) for setup in SETUPS for tool, _ in TOOLS for x, y in grid(count)
    ]


def apt_text(count):
    """Return the job as NX writes it."""
    lines = ["PARTNO wing", "UNITS/MM"]
    for origin in SETUPS.values():
        for tool, _ in TOOLS:
            lines += [
                "MSYS/" + ",".join(f"{v:.4f}" for v in (*origin, 1, 0, 0, 0, 1, 0)),
                f"LOADTL/{tool}", "SPINDL/2000,RPM,CLW", "RAPID", "GOTO/0.,0.,80.,0.,0.,1.",
                CYCLES[tool],
                *(f"GOTO/{x:.3f},{y:.3f},0.,0.,0.,1." for x, y in grid(count)),
                "CYCLE/OFF", "RAPID", "GOTO/0.,0.,80.,0.,0.,1.",
            ]  # fmt: skip
    return "\n".join([*lines, "SPINDL/OFF", "FINI", ""])


def csv_text(count):
    """Return the same holes as a list; tools and bases by number and by name."""
    names = dict(TOOLS)
    rows = [
        f"H{i},{h.x},{h.y},0,0,0,1,{DEPTHS[h.tool]},"
        f"{h.tool if h.setup == 1 else names[h.tool]},{'MSYS_1' if h.setup == 1 else 'MCS_2'}"
        for i, h in enumerate(holes(count))
    ]
    return "\n".join(["id,x,y,z,i,j,k,depth,tool,base", *rows, ""])


def tool_text(tool, name, longer=0.0, cutter=True):
    """Return the entry of a tool; its spindle stands across the flange."""
    reach = LENGTHS[tool] + longer
    solid = f"cutter = {{ diameter_mm = 6, length_mm = {reach} }}\n" if cutter else ""
    return (
        f'[[tools]]\nnumber = {6 + tool}\nname = "{name.lower()}"\ncam = [{tool}, "{name}"]\n'
        f'frame = {{ xyz_mm = [{47 + reach}, 0, 362] }}\naxis = "+x"\n'
        f"mass_kg = {79 + tool}\ncog_mm = [0, 0, 200]\n{solid}"
        "meshes = [{ box = { size_mm = [80, 80, 100] }, xyz_mm = [0, 0, 300] }]\n"
    )


def base_text(setup, cam, origin=None, thick=12):
    """Return the entry of a base with its panel, its origin [mm] and how thick it is [mm]."""
    return (
        f"[[bases]]\nnumber = {2 + setup}\ncam = {cam}\n"
        f"frame = {{ xyz_mm = {list(origin or ORIGINS[setup])}, "
        f"abc_deg = [{5 * (setup - 1)}, 0, 0] }}\n"
        f"meshes = [{{ box = {{ size_mm = [330, 330, {thick}] }}, "
        f"xyz_mm = [150, 150, {-thick / 2}] }}]\n"
    )


def cell_text(*tables, tools=TOOLS, longer=None, cutter=True):
    """Return the cell of the job; ``longer``: CAM tool to what its cutter is longer by [mm]."""
    longer = longer or {}
    parts = [tool_text(tool, name, longer.get(tool, 0.0), cutter) for tool, name in tools]
    parts += [base_text(1, '["MSYS_1"]'), base_text(2, '["MCS_2"]')]
    return HEAD + "".join(parts) + HOME + "".join(tables)
