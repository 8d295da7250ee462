/** Which point of a map lies under the pointer. */
import { type Camera, Matrix4, type Mesh, Raycaster, Vector2, Vector3 } from 'three';
import type { MapLayer } from './layers';

export interface Pick {
  layer: MapLayer;
  index: number;
  position: Vector3;
}

/** What hides points farther away: the place, where it is shown. Half a metre is forgiven, since maps err. */
const BEHIND_M = 0.5;

function nearestHit_m(place: Mesh | null, camera: Camera, at: Vector2): number {
  if (!place?.visible) return Infinity;
  const ray = new Raycaster();
  ray.setFromCamera(at, camera);
  return ray.intersectObject(place, false)[0]?.distance ?? Infinity;
}

/**
 * The nearest to the eye of those shown within `radius_px` of a place on the canvas (from -1 to 1, y up) that the place
 * does not hide; null if there is none.
 */
export function pickPoint(layers: MapLayer[], place: Mesh | null, camera: Camera, at: Vector2, size: { width: number; height: number }, radius_px = 8): Pick | null {
  camera.updateMatrixWorld();
  const toScreen = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  const eye = camera.getWorldPosition(new Vector3());
  const limit_m = nearestHit_m(place, camera, at) + BEHIND_M;
  let best: Pick | null = null;
  let best_m = limit_m;
  const position = new Vector3();
  const screen = new Vector3();
  for (const layer of layers) {
    for (let i = 0; layer.points.visible && i < layer.count; ++i) {
      position.fromArray(layer.positions, 3 * i);
      screen.copy(position).applyMatrix4(toScreen);
      const x_px = ((screen.x - at.x) * size.width) / 2;
      const y_px = ((screen.y - at.y) * size.height) / 2;
      if (Math.abs(screen.z) > 1 || x_px * x_px + y_px * y_px > radius_px * radius_px) continue;
      const distance_m = position.distanceTo(eye);
      if (distance_m >= best_m) continue;
      best_m = distance_m;
      best = { layer, index: i, position: position.clone() };
    }
  }
  return best;
}
