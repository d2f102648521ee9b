// Frames as files have them: X Y Z in mm, A B C in degrees, R = Rz(A) Ry(B) Rx(C).
import { Matrix4 } from "./three.bundle.js";

const DEG = Math.PI / 180;

export function matrixOf(xyz, abc) {
  const turned = ["Z", "Y", "X"].map((axis, k) =>
    new Matrix4()[`makeRotation${axis}`](abc[k] * DEG),
  );
  const [x, y, z] = xyz.map((v) => v / 1000);
  return new Matrix4()
    .makeTranslation(x, y, z)
    .multiply(turned[0])
    .multiply(turned[1])
    .multiply(turned[2]);
}

// {xyz_mm, abc_deg} to a thousandth
export function frameOf({ elements: e }) {
  const flat = Math.hypot(e[0], e[1]);
  const straight = flat < 1e-9; // B = +-90 deg: A is what is left of the turn
  const abc = straight
    ? [Math.atan2(-e[4], e[5]), Math.atan2(-e[2], flat), 0]
    : [Math.atan2(e[1], e[0]), Math.atan2(-e[2], flat), Math.atan2(e[6], e[10])];
  const rounded = (values, scale) => values.map((v) => Math.round(v * scale * 1000) / 1000 + 0);
  return { xyz_mm: rounded(e.slice(12, 15), 1000), abc_deg: rounded(abc, 1 / DEG) };
}
