/** The things in the view, each made from what the page holds. */
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DoubleSide,
  LineBasicMaterial,
  LineSegments,
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

type Corner = readonly [number, number, number];

/** Sides of a cell: where its neighbour lies, how bright it is, and its corners counter-clockwise from outside. */
const SIDES: { to: Corner; light: number; corners: Corner[] }[] = [
  { to: [1, 0, 0], light: 0.82, corners: [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]] },
  { to: [-1, 0, 0], light: 0.7, corners: [[0, 1, 0], [0, 0, 0], [0, 0, 1], [0, 1, 1]] },
  { to: [0, 1, 0], light: 0.76, corners: [[1, 1, 0], [0, 1, 0], [0, 1, 1], [1, 1, 1]] },
  { to: [0, -1, 0], light: 0.64, corners: [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]] },
  { to: [0, 0, 1], light: 1, corners: [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]] },
  { to: [0, 0, -1], light: 0.5, corners: [[0, 1, 0], [1, 1, 0], [1, 0, 0], [0, 0, 0]] },
];

/** One number a cell; cells are numbered from 0 to 65535, neighbours may be one beside that. */
function cellKey(x: number, y: number, z: number): number {
  return ((x + 1) * 70000 + y + 1) * 70000 + z + 1;
}

/** Occupied cells as boxes, without the sides between two of them: dark green low, light green high, every other a little darker. */
export function cellBoxes(data: ViewData, header: CellsHeader): Mesh {
  const cells = data.shorts(header.cells);
  const occupied = new Set<number>();
  let top = 1;
  for (let i = 0; i < cells.length; i += 3) {
    occupied.add(cellKey(cells[i]!, cells[i + 1]!, cells[i + 2]!));
    top = Math.max(top, cells[i + 2]!);
  }
  const low = new Color(0.23, 0.44, 0.3);
  const high = new Color(0.83, 0.95, 0.8);
  const color = new Color();
  const positions: number[] = [];
  const colors: number[] = [];
  const corners: number[] = [];
  for (let i = 0; i < cells.length; i += 3) {
    const [x, y, z] = [cells[i]!, cells[i + 1]!, cells[i + 2]!];
    for (const side of SIDES) {
      if (occupied.has(cellKey(x + side.to[0], y + side.to[1], z + side.to[2]))) continue;
      const first = positions.length / 3;
      const light = 255 * side.light * ((x + y + z) % 2 === 0 ? 1 : 0.93);
      color.copy(low).lerp(high, z / top).multiplyScalar(light);
      for (const corner of side.corners) {
        positions.push(x + corner[0], y + corner[1], z + corner[2]);
        colors.push(color.r, color.g, color.b);
      }
      corners.push(first, first + 1, first + 2, first, first + 2, first + 3);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(positions), 3));
  geometry.setAttribute('color', new BufferAttribute(new Uint8Array(colors), 3, true));
  geometry.setIndex(new BufferAttribute(new Uint32Array(corners), 1));
  const boxes = new Mesh(geometry, new MeshBasicMaterial({ vertexColors: true }));
  boxes.position.set(...header.origin_m);
  boxes.scale.setScalar(header.size_m);
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
