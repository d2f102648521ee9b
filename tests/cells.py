"""Cells of the tests as text: a KR 500 with an angle head, and what a test changes of it."""

JOINT_STIFFNESS = (1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8)
"""N*mm/rad, A1 to A6 of a KR 500: Jiao et al. 2022, without a grid."""
STIFFNESS = f"[stiffness]\njoint_Nmm_per_rad = {list(JOINT_STIFFNESS)}\n"
FEED = "[motion]\nfeed_mm_min = 600\n"


def cell_text(
    *tables: str,
    robot: str = "kuka_kr500_r2830",
    tcp: tuple[float, float, float] = (107, 0, 362),
    tcp_abc: tuple[float, float, float] = (0, 0, 0),
    tool: str = "",
    origin: tuple[float, float, float] = (1700, 0, 700),
) -> str:
    """Return the text of a cell.

    Args:
        tables: further tables.
        robot: name of the arm.
        tcp: tool point in the flange [mm].
        tcp_abc: its turn, KUKA A, B, C [deg].
        tool: further keys of the tool, whole lines.
        origin: CAM coordinates in the robot root [mm].
    """
    return f"""\
schema = "postproc.cell/1"
name = "bench"
[robot]
model = "{robot}"
[tool]
number = 1
name = "head"
frame = {{ xyz_mm = {list(tcp)}, abc_deg = {list(tcp_abc)} }}
axis = "+x"
{tool}[workpiece]
number = 1
frame = {{ xyz_mm = {list(origin)}, abc_deg = [0, 0, 0] }}
{"".join(tables)}"""


def twin_text(*tables: str, origin: tuple[float, float, float]) -> str:
    """Return the text of the cell whose arm ``tools.dev.hidden_twin`` simulates."""
    tool = "mass_kg = 50.0\ncog_mm = [53.5, 0, 362]\n"
    return cell_text(*tables, tcp_abc=(0, 0, 180), tool=tool, origin=origin)
