"""Run the ladder planner of ``tesseract-robotics`` on a planning workload, for comparison.

    python tools/bench/tesseract.py WORKLOADS SIZE

Same arm, holes, 36 turns and solids as ``python -m tools.bench planning search``, poses at the
holes only, one graph. The package is optional (``pip install tesseract-robotics scipy``; written
for 0.5.1) and may live in an environment of its own, so nothing of postproc is used. It takes about
7 MB of memory for each hole. Prints one line of JSON: time of the planner's call, memory of the
process, sum of squared joint steps [rad^2].
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

PLANNER, PROFILE = "DescartesMotionPlannerTask", "HOLES"
STEP = np.pi / 18.0
MM = 1e-3

KINEMATICS = """kinematic_plugins:
  search_libraries: [tesseract_kinematics_opw_factory, tesseract_kinematics_kdl_factories]
  fwd_kin_plugins:
    manipulator:
      default: KDLFwdKinChain
      plugins:
        KDLFwdKinChain:
          class: KDLFwdKinChainFactory
          config: {{base_link: link0, tip_link: tcp}}
  inv_kin_plugins:
    manipulator:
      default: OPWInvKin
      plugins:
        OPWInvKin:
          class: OPWInvKinFactory
          config:
            base_link: link0
            tip_link: flange
            params: {{{params}}}
"""
CONTACT = """contact_manager_plugins:
  search_libraries: [tesseract_collision_bullet_factories]
  discrete_plugins:
    default: BulletDiscreteBVHManager
    plugins: {BulletDiscreteBVHManager: {class: BulletDiscreteBVHManagerFactory}}
  continuous_plugins:
    default: BulletCastBVHManager
    plugins: {BulletCastBVHManager: {class: BulletCastBVHManagerFactory}}
"""


def write_scene(scene: Path, folder: Path) -> tuple[Path, Path]:
    """Write the robot, its groups and plug-ins; return the URDF and the SRDF."""
    data = json.loads((scene / "scene.json").read_text())
    size = data["robot"]
    urdf, srdf = folder / "workload.urdf", folder / "workload.srdf"
    urdf.write_text(
        "\n".join(['<robot name="workload">', *_links(scene, data), *_joints(data), "</robot>"])
    )
    pairs = [*data["skip_pairs"], ["link0", "panel"]]
    never = [f'<disable_collisions link1="{a}" link2="{b}" reason="Never"/>' for a, b in pairs]
    group = '<group name="manipulator"><chain base_link="link0" tip_link="tcp"/></group>'
    plugins = [
        f'<{name}_plugin_config filename="file://{folder / name}.yaml"/>'
        for name in ("kinematics", "contact_managers")
    ]
    srdf.write_text(
        "\n".join(['<robot name="workload" version="1.0.0">', group, *plugins, *never, "</robot>"])
    )
    params = {
        "a1": size["a1"], "a2": -size["a3"], "b": 0.0,
        "c1": size["d1"], "c2": size["a2"], "c3": size["d4"], "c4": size["d6"],
        "offsets": [0.0, -np.pi / 2.0, 0.0, 0.0, 0.0, 0.0],
        "sign_corrections": [int(sign) for sign in size["axis_signs"]],
    }  # fmt: skip
    text = ", ".join(f"{key}: {value}" for key, value in params.items())
    (folder / "kinematics.yaml").write_text(KINEMATICS.format(params=text))
    (folder / "contact_managers.yaml").write_text(CONTACT)
    return urdf, srdf


def _links(scene: Path, data: dict[str, Any]) -> list[str]:
    lines = ['<link name="flange"/>', '<link name="tcp"/>']
    for name in (*(f"link{i}" for i in range(7)), "tool", "panel", "obst"):
        solids = [
            f'<collision><geometry><mesh filename="file://{scene / file}"/></geometry></collision>'
            for file in data["files"][name]
        ]
        lines += [f'<link name="{name}">', *solids, "</link>"]
    return lines


def _joints(data: dict[str, Any]) -> list[str]:
    """Return the joints: at zero all frames are parallel to that of the base."""
    size = data["robot"]
    places = [(0, 0, 0), (size["a1"], 0, size["d1"]), (size["a2"], 0, 0)]
    places += [(size["d4"], 0, size["a3"]), (0, 0, 0), (0, 0, 0)]
    lines = []
    for i, (place, axis) in enumerate(zip(places, (2, 1, 1, 0, 1, 0), strict=True)):
        low, high = np.radians(size["limits_deg"][i])
        turn = size["axis_signs"][i] * np.eye(3)[axis]
        lines.append(
            f'<joint name="j{i + 1}" type="revolute"><parent link="link{i}"/>'
            f'<child link="link{i + 1}"/><origin xyz="{_text(place)}"/><axis xyz="{_text(turn)}"/>'
            f'<limit lower="{low}" upper="{high}" velocity="2" effort="1"/></joint>'
        )
    T_flange_tcp = np.array(data["flange_to_tcp"])
    R_link6_flange = Rotation.from_euler("y", 90.0, degrees=True).as_matrix()
    fixed = [
        ("link0", "panel", np.zeros(3), np.eye(3)),
        ("link0", "obst", np.zeros(3), np.eye(3)),
        ("link6", "tool", np.zeros(3), np.eye(3)),
        ("link6", "flange", (size["d6"], 0, 0), R_link6_flange),
        ("flange", "tcp", T_flange_tcp[:3, 3], T_flange_tcp[:3, :3]),
    ]
    for parent, child, place, R in fixed:
        rpy = Rotation.from_matrix(R).as_euler("xyz")
        lines.append(
            f'<joint name="{child}_joint" type="fixed"><parent link="{parent}"/>'
            f'<child link="{child}"/><origin xyz="{_text(place)}" rpy="{_text(rpy)}"/></joint>'
        )
    return lines


def _text(values: Any) -> str:  # noqa: ANN401 - tuples and arrays
    return " ".join(f"{float(value):.12g}" for value in values)


def program(path: Path, info: Any) -> Any:  # noqa: ANN401 - the package has no types
    """Return the holes of a workload as a program; the spin about the tool axis is free."""
    from tesseract_robotics import tesseract_command_language as language
    from tesseract_robotics.tesseract_common import Isometry3d

    result = language.CompositeInstruction()
    result.setManipulatorInfo(info)
    for row in np.loadtxt(path, delimiter=",", skiprows=1):
        T = np.eye(4)
        z = -row[3:] / np.linalg.norm(row[3:])
        x = np.cross([0.0, 1.0, 0.0], z)
        x /= np.linalg.norm(x)
        T[:3, :3], T[:3, 3] = np.column_stack([x, np.cross(z, x), z]), row[:3] * MM
        point = language.CartesianWaypoint(Isometry3d(T))
        wrapped = language.CartesianWaypointPoly_wrap_CartesianWaypoint(point)
        kind = language.MoveInstructionType_FREESPACE
        move = language.MoveInstruction(wrapped, kind, PROFILE, info)
        result.appendMoveInstruction(language.MoveInstructionPoly_wrap_MoveInstruction(move))
    return result


def profiles() -> Any:  # noqa: ANN401
    """Return the settings: 36 turns, collision at the holes, no turns of the joints."""
    from tesseract_robotics import tesseract_motion_planners_descartes as descartes
    from tesseract_robotics.tesseract_command_language import ProfileDictionary

    profile = descartes.DescartesDefaultPlanProfileD()
    profile.target_pose_fixed = False
    profile.target_pose_sample_axis = np.array([[0.0], [0.0], [1.0]])
    profile.target_pose_sample_resolution = STEP
    profile.target_pose_sample_min, profile.target_pose_sample_max = -np.pi, np.pi - STEP
    profile.enable_collision, profile.enable_edge_collision = True, False
    profile.use_redundant_joint_solutions = False
    result = ProfileDictionary()
    result.addProfile(PLANNER, PROFILE, descartes.cast_DescartesPlanProfileD(profile))
    return result


def joints(step: Any) -> np.ndarray:  # noqa: ANN401
    """Return the joints of one step of the answer: the seed of its pose."""
    from tesseract_robotics import tesseract_command_language as language

    # Each wrapper points into the one before: all must live until the numbers are copied.
    move = language.InstructionPoly_as_MoveInstructionPoly(step)
    way = move.getWaypoint()
    if way.isStateWaypoint():
        state = language.WaypointPoly_as_StateWaypointPoly(way)
        return np.array(state.getPosition()).ravel()
    pose = language.WaypointPoly_as_CartesianWaypointPoly(way)
    seed = pose.getSeed()
    return np.array(seed.position).ravel()


def run(workloads: Path, size: int, folder: Path) -> dict[str, float]:
    """Plan one workload and return its figures."""
    from tesseract_robotics import tesseract_common as common
    from tesseract_robotics.tesseract_environment import Environment
    from tesseract_robotics.tesseract_motion_planners import PlannerRequest
    from tesseract_robotics.tesseract_motion_planners_descartes import DescartesMotionPlannerD

    urdf, srdf = write_scene(workloads / "scene", folder)
    environment, locator = Environment(), common.GeneralResourceLocator()
    files = (common.FilesystemPath(str(path)) for path in (urdf, srdf))
    if not environment.init(*files, locator):
        raise SystemExit("tesseract-robotics does not take the scene")
    info = common.ManipulatorInfo()
    info.manipulator, info.tcp_frame, info.working_frame = "manipulator", "tcp", "link0"
    request = PlannerRequest()
    request.instructions = program(workloads / f"workload_{size}.csv", info)
    request.env, request.profiles = environment, profiles()
    planner = DescartesMotionPlannerD(PLANNER)
    cpu, wall = time.process_time(), time.perf_counter()
    response = planner.solve(request)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    if not response.successful:
        raise SystemExit(f"tesseract-robotics finds no way: {response.message}")
    q = np.array([joints(step) for step in response.results.flatten()])
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    cost = float(np.square(np.diff(q, axis=0)).sum())
    return {"tags": len(q), "wall_s": wall, "cpu_s": cpu, "mb": memory, "rad2": cost}


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        print(json.dumps(run(Path(sys.argv[1]), int(sys.argv[2]), Path(place))))
