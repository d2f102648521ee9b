"""How fast kinematics is against py-opw-kinematics and pinocchio, in one run on one core.

python -m tools.bench kinematics [--robot NAME] [--poses 100000]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
import pinocchio
import py_opw_kinematics as opw
from scipy.spatial.transform import RigidTransform

from postproc.cell import OpwGeometry, load_robot
from postproc.kinematics import Kinematics, build
from postproc.kinematics.chain import SerialChain
from tools.bench.harness import rate

LENGTHS = ("a1", "a2", "b", "c1", "c2", "c3", "c4")


def opw_robot(geometry: OpwGeometry) -> opw.Robot:
    """Return the same arm in py-opw-kinematics."""
    model = opw.KinematicModel(
        **{key: getattr(geometry, key) for key in LENGTHS},
        offsets=tuple(geometry.offsets),
        flip_axes=tuple(bool(sign < 0) for sign in geometry.signs),
    )
    return opw.Robot(model, degrees=False)


def pinocchio_model(chain: SerialChain) -> tuple[pinocchio.Model, int]:
    """Return the same arm in pinocchio and the number of its flange frame."""
    model, parent = pinocchio.Model(), 0
    for place, axis in zip(chain.placements[:6], chain.axes, strict=True):
        joint = pinocchio.JointModelRevoluteUnaligned(np.asarray(axis))
        parent = model.addJoint(parent, joint, pinocchio.SE3(np.asarray(place)), f"j{parent}")
    end = pinocchio.SE3(np.asarray(chain.placements[6]))
    frame = pinocchio.Frame("flange", parent, 0, end, pinocchio.FrameType.OP_FRAME)
    return model, model.addFrame(frame)


def pinocchio_loop(
    model: pinocchio.Model, frame: int, q: np.ndarray, *, jacobian: bool
) -> Callable[[], None]:
    """Return a loop over configurations, as a user of the library would write it."""
    data = model.createData()

    def loop() -> None:
        for angles in q:
            if jacobian:
                pinocchio.computeFrameJacobian(
                    model, data, angles, frame, pinocchio.LOCAL_WORLD_ALIGNED
                )
            else:
                pinocchio.framesForwardKinematics(model, data, angles)

    return loop


def report(what: str, ours: float, others: dict[str, float]) -> None:
    """Print one line."""
    text = f"{what:28} {ours / 1e6:8.3f} M/s"
    for name, other in others.items():
        text += f"   {name} {other / 1e6:.3f} M/s, ratio {ours / other:.1f}"
    print(text)


def compare(kinematics: Kinematics, count: int) -> None:
    """Measure inverse kinematics, forward kinematics and Jacobian."""
    if kinematics.arm is None:
        raise SystemExit("this comparison needs a closed-form arm")
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (count, 6))
    T = kinematics.fk(q)
    robot = opw_robot(kinematics.arm.geometry)
    poses = RigidTransform.from_matrix(T[:20_000])
    model, frame = pinocchio_model(kinematics.chain)
    few = np.ascontiguousarray(q[:20_000])
    report(
        "IK, all 8 branches",
        rate(lambda: kinematics.ik(T), count, 5),
        {
            "py-opw reach": rate(lambda: robot.reach(poses), 20_000, 3),
            "py-opw inverse loop": rate(
                lambda: [robot.inverse(pose) for pose in poses[:3000]], 3000, 2
            ),
        },
    )
    report(
        "FK",
        rate(lambda: kinematics.fk(q), count, 5),
        {
            "pinocchio": rate(pinocchio_loop(model, frame, few, jacobian=False), 20_000, 3),
            "py-opw": rate(lambda: robot.batch_forward(few), 20_000, 3),
        },
    )
    report(
        "Jacobian",
        rate(lambda: kinematics.jacobian(q), count, 5),
        {"pinocchio": rate(pinocchio_loop(model, frame, few, jacobian=True), 20_000, 3)},
    )


def main() -> None:
    """Run the comparison for one robot."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="kuka_kr500_r2830")
    parser.add_argument("--poses", type=int, default=100_000)
    arguments = parser.parse_args()
    print(f"{arguments.robot}, {arguments.poses} poses, one core")
    compare(build(load_robot(arguments.robot)), arguments.poses)
