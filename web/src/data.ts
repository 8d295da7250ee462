/** What the report's program wrote for the view (tileflight/experiments/report/view_data.h): a header in JSON and blocks of numbers. */

/** A stretch of bytes behind the header. */
export interface Block {
  at: number;
  bytes: number;
}

/** Positions as 16-bit steps from a corner, three a point. */
export interface Positions extends Block {
  low_m: [number, number, number];
  step_m: [number, number, number];
}

export interface PlaceHeader {
  triangles: number;
  source_triangles: number;
  positions: Positions;
  uv: Block;
  indices: Block;
  texture: Block;
}

export interface CellsHeader {
  size_m: number;
  origin_m: [number, number, number];
  cells: Block;
}

export interface MapHeader {
  points: number;
  shown: number;
  positions: Positions;
  surface_mm: Block | null;
  voxel_mm: Block | null;
  colors: Block | null;
}

export interface FrameHeader extends Block {
  time_s: number;
}

/** A further camera of a rig. */
export interface CameraHeader {
  name: string;
  frames: FrameHeader[];
}

export interface FlightHeader {
  key: string;
  label: string;
  start_s: number;
  map: MapHeader | null;
  estimate: Block | null;
  truth: Block | null;
  half_width: number;
  half_height: number;
  /** Of the only camera, or of a rig's first. */
  frames: FrameHeader[];
  camera: string;
  other_cameras: CameraHeader[];
  pictures: number;
}

export interface Header {
  low_m: [number, number, number];
  high_m: [number, number, number];
  /** What the first look has in its picture: the place, most of the maps and of the paths. */
  shown_low_m: [number, number, number];
  shown_high_m: [number, number, number];
  error_limit_m: number;
  error_colors: [number, number, number][];
  common_clock: boolean;
  attribution: string[];
  place: PlaceHeader | null;
  cells: CellsHeader | null;
  flights: FlightHeader[];
}

/** A length of 65535 mm stands for one that is not known. */
export const UNKNOWN_MM = 65535;

export class ViewData {
  constructor(
    readonly header: Header,
    private readonly bytes: Uint8Array<ArrayBuffer>,
  ) {}

  raw(block: Block): Uint8Array<ArrayBuffer> {
    return this.bytes.subarray(block.at, block.at + block.bytes);
  }
  shorts(block: Block): Uint16Array {
    return new Uint16Array(this.bytes.buffer, this.bytes.byteOffset + block.at, block.bytes / 2);
  }
  words(block: Block): Uint32Array {
    return new Uint32Array(this.bytes.buffer, this.bytes.byteOffset + block.at, block.bytes / 4);
  }
  floats(block: Block): Float32Array {
    return new Float32Array(this.bytes.buffer, this.bytes.byteOffset + block.at, block.bytes / 4);
  }

  /** East, north, up in metres, three a point. */
  positions(block: Positions): Float32Array {
    const steps = this.shorts(block);
    const out = new Float32Array(steps.length);
    for (let i = 0; i < steps.length; ++i) out[i] = block.low_m[i % 3]! + steps[i]! * block.step_m[i % 3]!;
    return out;
  }
}

function bytesOf(base64: string): Uint8Array<ArrayBuffer> {
  const binary = atob(base64);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

async function inflated(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array<ArrayBuffer>> {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Reads the text of the page's data element. */
export async function readViewData(base64: string): Promise<ViewData> {
  const bytes = await inflated(bytesOf(base64.trim()));
  const headerBytes = new DataView(bytes.buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + headerBytes))) as Header;
  return new ViewData(header, bytes.subarray(Math.ceil((4 + headerBytes) / 4) * 4));
}
