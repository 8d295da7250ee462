/** The things in the view, each made from what the page holds. */
import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  Color,
  DoubleSide,
  InstancedMesh,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  Points,
  PointsMaterial,
  Texture,
  LinearMipmapLinearFilter,
} from 'three';
import { Line2 } from 'three/examples/jsm/lines/Line2.js';
import { LineGeometry } from 'three/examples/jsm/lines/LineGeometry.js';
import { LineMaterial } from 'three/examples/jsm/lines/LineMaterial.js';
import { type CellsHeader, type MapHeader, type PlaceHeader, UNKNOWN_MM, type ViewData } from './data';
import { type Path, pyramidEdges } from './paths';

export type ColorBy = 'source' | 'error' | 'picture';

/** The place's triangles under their texture, as bright as it was photographed. */
export async function placeMesh(data: ViewData, place: PlaceHeader): Promise<Mesh> {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(data.positions(place.positions), 3));
  geometry.setAttribute('uv', new BufferAttribute(data.shorts(place.uv), 2, true));
  geometry.setIndex(new BufferAttribute(data.words(place.indices), 1));
  const image = await createImageBitmap(new Blob([data.raw(place.texture)], { type: 'image/jpeg' }));
  const texture = new Texture(image);
  texture.flipY = false;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.anisotropy = 4;
  texture.needsUpdate = true;
  return new Mesh(geometry, new MeshBasicMaterial({ map: texture, side: DoubleSide }));
}

/** How bright each side of a box is: faces of BoxGeometry are +x -x +y -y +z -z, four vertices each. */
const SIDE_LIGHT = [0.82, 0.7, 0.76, 0.64, 1, 0.5];

function litBox(size_m: number): BoxGeometry {
  const box = new BoxGeometry(size_m, size_m, size_m);
  const colors = SIDE_LIGHT.flatMap((light) => Array<number>(12).fill(light));
  box.setAttribute('color', new BufferAttribute(new Float32Array(colors), 3));
  return box;
}

/** Occupied cells as boxes, dark green low and light green high. */
export function cellBoxes(data: ViewData, header: CellsHeader): InstancedMesh {
  const cells = data.shorts(header.cells);
  const count = cells.length / 3;
  const boxes = new InstancedMesh(litBox(0.96 * header.size_m), new MeshBasicMaterial({ vertexColors: true }), count);
  const low = new Color(0.23, 0.44, 0.3);
  const high = new Color(0.83, 0.95, 0.8);
  let top = 1;
  for (let i = 0; i < count; ++i) top = Math.max(top, cells[3 * i + 2]!);
  const matrix = new Matrix4();
  for (let i = 0; i < count; ++i) {
    const place = [0, 1, 2].map((axis) => header.origin_m[axis]! + (cells[3 * i + axis]! + 0.5) * header.size_m);
    boxes.setMatrixAt(i, matrix.makeTranslation(place[0]!, place[1]!, place[2]!));
    boxes.setColorAt(i, low.clone().lerp(high, cells[3 * i + 2]! / top));
  }
  return boxes;
}

/** Colours of an error between 0 and the limit, as on the page's other pictures. */
export function errorColor(share: number, stops: [number, number, number][]): [number, number, number] {
  const place = Math.min(1, Math.max(0, share)) * (stops.length - 1);
  const below = Math.min(Math.floor(place), stops.length - 2);
  const mix = (axis: number) => stops[below]![axis]! + (place - below) * (stops[below + 1]![axis]! - stops[below]![axis]!);
  return [mix(0), mix(1), mix(2)];
}

/** Pixels: many points are drawn smaller. */
function dotSize(count: number): number {
  return count > 20000 ? 1.7 : 2.6;
}

/** A map's points, with what is known of each. */
export class MapLayer {
  readonly positions: Float32Array;
  readonly points: Points<BufferGeometry, PointsMaterial>;
  private readonly surface_mm: Uint16Array | null;
  private readonly voxel_mm: Uint16Array | null;
  private readonly pictureColors: Uint8Array | null;

  constructor(
    data: ViewData,
    header: MapHeader,
    private readonly sourceColor: Color,
  ) {
    this.positions = data.positions(header.positions);
    this.surface_mm = header.surface_mm && data.shorts(header.surface_mm);
    this.voxel_mm = header.voxel_mm && data.shorts(header.voxel_mm);
    this.pictureColors = header.colors && data.raw(header.colors);
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(this.positions, 3));
    const material = new PointsMaterial({ size: dotSize(this.count) * devicePixelRatio, sizeAttenuation: false, vertexColors: true });
    this.points = new Points(geometry, material);
    this.colorBy('source', data);
  }

  get count(): number {
    return this.positions.length / 3;
  }
  hasPictureColors(): boolean {
    return this.pictureColors !== null;
  }
  surface_m(i: number): number | null {
    return metres(this.surface_mm, i);
  }
  voxel_m(i: number): number | null {
    return metres(this.voxel_mm, i);
  }

  colorBy(what: ColorBy, data: ViewData): void {
    const colors = new Uint8Array(3 * this.count);
    for (let i = 0; i < this.count; ++i) colors.set(this.colorOf(i, what, data), 3 * i);
    this.points.geometry.setAttribute('color', new BufferAttribute(colors, 3, true));
  }

  setSourceColor(color: Color): void {
    this.sourceColor.copy(color);
  }

  private colorOf(i: number, what: ColorBy, data: ViewData): ArrayLike<number> {
    if (what === 'picture' && this.pictureColors) return this.pictureColors.subarray(3 * i, 3 * i + 3);
    if (what === 'error') {
      const error_m = this.surface_m(i) ?? this.voxel_m(i);
      if (error_m === null) return [128, 128, 128];
      return errorColor(error_m / data.header.error_limit_m, data.header.error_colors);
    }
    return [255 * this.sourceColor.r, 255 * this.sourceColor.g, 255 * this.sourceColor.b];
  }
}

function metres(lengths_mm: Uint16Array | null, i: number): number | null {
  const length_mm = lengths_mm?.[i];
  return length_mm === undefined || length_mm === UNKNOWN_MM ? null : length_mm / 1000;
}

/** A path as a line of a few pixels. */
export function pathLine(path: Path, color: Color, dashed: boolean, dash_m: number): Line2 {
  const geometry = new LineGeometry();
  geometry.setPositions(path.positions());
  const material = new LineMaterial({ color, linewidth: dashed ? 2 : 3, dashed, dashSize: dash_m, gapSize: dash_m });
  const line = new Line2(geometry, material);
  line.computeLineDistances();
  return line;
}

/** Edges of a camera's pyramid, which can be moved along a path. */
export class Frustum {
  readonly lines: LineSegments<BufferGeometry, LineBasicMaterial>;

  constructor(
    private readonly path: Path,
    color: Color,
    private readonly half: { width: number; height: number },
    private readonly depth_m: number,
  ) {
    this.lines = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ color }));
    this.lines.frustumCulled = false;
    this.moveTo(0);
  }

  /** Out of the way of who looks out of this camera, whatever the layer's switch says. */
  set isSeen(seen: boolean) {
    this.lines.material.visible = seen;
  }

  moveTo(time_s: number): void {
    const edges = pyramidEdges(this.path.at(time_s), this.half.width, this.half.height, this.depth_m);
    this.lines.geometry.setAttribute('position', new BufferAttribute(new Float32Array(edges), 3));
  }
}

/** Small pyramids at even times along a path. */
export function frustaAlong(path: Path, count: number, color: Color, half: { width: number; height: number }, depth_m: number): LineSegments {
  const edges: number[] = [];
  const start_s = path.time_s(0);
  for (let i = 0; i < count; ++i) {
    const time_s = start_s + ((path.end_s - start_s) * i) / Math.max(1, count - 1);
    edges.push(...pyramidEdges(path.at(time_s), half.width, half.height, depth_m));
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(edges), 3));
  return new LineSegments(geometry, new LineBasicMaterial({ color, transparent: true, opacity: 0.55 }));
}
