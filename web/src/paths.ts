/** A flight's path in time, and the camera's frame along it: x right, y down, z forward. */
import { Quaternion, Vector3 } from 'three';

const NUMBERS_A_POSE = 8; // seconds from the flight's start, position, rotation as quaternion x y z w

export interface Pose {
  position: Vector3;
  rotation: Quaternion;
}

export class Path {
  constructor(private readonly poses: Float32Array) {}

  get length(): number {
    return this.poses.length / NUMBERS_A_POSE;
  }
  time_s(i: number): number {
    return this.poses[i * NUMBERS_A_POSE]!;
  }
  get end_s(): number {
    return this.length === 0 ? 0 : this.time_s(this.length - 1);
  }

  pose(i: number): Pose {
    const p = this.poses.subarray(i * NUMBERS_A_POSE, (i + 1) * NUMBERS_A_POSE);
    return { position: new Vector3(p[1], p[2], p[3]), rotation: new Quaternion(p[4], p[5], p[6], p[7]) };
  }

  /** Between the poses before and after; the first or last one outside the path's time. */
  at(time_s: number): Pose {
    let low = 0;
    let high = this.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.time_s(middle) <= time_s) low = middle;
      else high = middle;
    }
    const before = this.pose(low);
    const after = this.pose(high);
    const span_s = this.time_s(high) - this.time_s(low);
    const share = span_s > 0 ? Math.min(1, Math.max(0, (time_s - this.time_s(low)) / span_s)) : 0;
    return { position: before.position.lerp(after.position, share), rotation: before.rotation.slerp(after.rotation, share) };
  }

  /** All positions, three numbers each. */
  positions(): number[] {
    const out: number[] = [];
    for (let i = 0; i < this.length; ++i) out.push(...this.poses.subarray(i * NUMBERS_A_POSE + 1, i * NUMBERS_A_POSE + 4));
    return out;
  }
}

/** Corners of a camera's pyramid in its own frame, tip first. */
export function pyramid(halfWidth: number, halfHeight: number, depth_m: number): Vector3[] {
  const corner = (x: number, y: number) => new Vector3(x * halfWidth * depth_m, y * halfHeight * depth_m, depth_m);
  return [new Vector3(), corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
}

/** Ends of the pyramid's edges at a pose, three numbers each; a stroke above the picture tells which side is up. */
export function pyramidEdges(pose: Pose, halfWidth: number, halfHeight: number, depth_m: number): number[] {
  const corners = pyramid(halfWidth, halfHeight, depth_m);
  corners.push(new Vector3(0, -1.35 * halfHeight * depth_m, depth_m));
  const placed = corners.map((c) => c.applyQuaternion(pose.rotation).add(pose.position));
  const edges = [0, 1, 0, 2, 0, 3, 0, 4, 1, 2, 2, 3, 3, 4, 4, 1, 1, 5, 2, 5];
  return edges.flatMap((i) => placed[i]!.toArray());
}
