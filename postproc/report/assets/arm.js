// Forward kinematics: a product of rotations about the joint axes of the zero pose.
import { Matrix4, Vector3 } from "./three.bundle.js";

// a matrix of three.js from the rows of a 4 x 4 matrix
export function matrix(rows) {
  return new Matrix4().set(...rows);
}

export class Arm {
  #zero;
  #axes;
  #points;
  #world = new Matrix4();

  // robot: link_frames of the zero pose, joint_axes and joint_points in the robot's root
  constructor(robot) {
    this.#zero = robot.link_frames.map(matrix);
    this.#axes = robot.joint_axes.map((axis) => new Vector3(...axis));
    this.#points = robot.joint_points;
    this.frames = this.#zero.map(() => new Matrix4());
    this.stand(robot.T_world_robroot);
  }

  // where the robot's root stands in the world (rows of 4 x 4)
  stand(rows) {
    this.#world.set(...rows);
  }

  // a point of the robot's root in the world
  inWorld(point) {
    return new Vector3(...point).applyMatrix4(this.#world).toArray();
  }

  // moves the link frames in the world to joint angles [rad]
  place(angles) {
    const chain = this.#world.clone();
    this.frames[0].copy(chain).multiply(this.#zero[0]);
    this.#points.forEach(([x, y, z], j) => {
      chain.multiply(new Matrix4().makeTranslation(x, y, z));
      chain.multiply(new Matrix4().makeRotationAxis(this.#axes[j], angles[j]));
      chain.multiply(new Matrix4().makeTranslation(-x, -y, -z));
      this.frames[j + 1].copy(chain).multiply(this.#zero[j + 1]);
    });
  }

  // the origins of the link frames in the world at joint angles [rad], the arm left as it stands
  origins(angles) {
    const kept = this.frames.map((frame) => frame.clone());
    this.place(angles);
    return this.frames.map((frame, k) => {
      const origin = frame.elements.slice(12, 15);
      frame.copy(kept[k]);
      return origin;
    });
  }

  // the origin of the flange in the world [m]
  get tip() {
    return this.frames.at(-1).elements.slice(12, 15);
  }
}
