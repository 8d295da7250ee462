/** The canvas: camera, light, drawing when something has changed, and the ways to look. */
import { Box3, ColorManagement, type Object3D, PerspectiveCamera, Quaternion, Scene, Vector3, WebGLRenderer, LinearSRGBColorSpace } from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import type { Pose } from './paths';

export type Look = 'orbit' | 'top' | 'follow' | 'camera';

const FIELD_OF_VIEW_DEG = 45;
/** What is left free around what is shown, a share of the picture. */
const MARGIN = 0.04;
/** Where the first look comes from: the south, a little west and well above. */
const ORBIT_FROM = new Vector3(-0.42, -0.86, 0.66).normalize();
const TOP_FROM = new Vector3(0, -0.001, 1).normalize();
const TURN_RAD = Math.PI / 36;
const ZOOM = 1.15;
/** A camera looks along -z with y up here, along z with y down in the data. */
const T_pose_three = new Quaternion(1, 0, 0, 0);

/** Of points (across, towards the camera): the least distance at which all are between two sides, and the camera's place across. */
function sides(points: [number, number][], tangent: number): { distance: number; place: number } {
  const right = Math.max(...points.map(([x, z]) => x + tangent * z));
  const left = Math.min(...points.map(([x, z]) => x - tangent * z));
  return { distance: (right - left) / (2 * tangent), place: (right + left) / 2 };
}

export class Stage {
  readonly scene = new Scene();
  readonly canvas: HTMLCanvasElement;
  readonly camera: PerspectiveCamera;
  private readonly renderer: WebGLRenderer;
  private readonly controls: OrbitControls;
  private readonly reach_m: number;
  private look: Look = 'orbit';
  private isMoved = false; // by the reader, since the last look was chosen
  private isAsked = false;

  /** `shown`: what is in the picture at first. Throws where the browser gives no WebGL. */
  constructor(private readonly shown: Box3) {
    ColorManagement.enabled = false; // colours are shown as they are stored
    // What is drawn stays, so that a reader can save it as a picture.
    this.renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.canvas = this.renderer.domElement;
    this.reach_m = Math.max(1, shown.getSize(new Vector3()).length());
    this.camera = new PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, this.reach_m / 2000, this.reach_m * 20);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener('change', () => this.draw());
    this.controls.addEventListener('start', () => (this.isMoved = true));
    this.controls.enableZoom = false; // until the canvas is touched: the wheel scrolls the page
    this.canvas.addEventListener('pointerdown', () => (this.controls.enableZoom = true));
    this.canvas.addEventListener('pointerleave', () => (this.controls.enableZoom = false));
    this.lookFrom('orbit');
  }

  add(...things: Object3D[]): void {
    this.scene.add(...things);
    this.draw();
  }

  setBackground(color: string): void {
    this.renderer.setClearColor(color);
    this.draw();
  }

  /** Fills the frame with the canvas, now and whenever its size changes. */
  fill(frame: HTMLElement): void {
    frame.append(this.canvas);
    new ResizeObserver(() => this.fit(frame)).observe(frame);
    this.fit(frame);
  }

  private fit(frame: HTMLElement): void {
    if (frame.clientWidth === 0 || frame.clientHeight === 0) return;
    this.renderer.setSize(frame.clientWidth, frame.clientHeight);
    this.camera.aspect = frame.clientWidth / frame.clientHeight;
    this.camera.updateProjectionMatrix();
    if (!this.isMoved) this.fitLook();
    this.draw();
  }

  /** Draws once before the browser shows its next picture. */
  draw(): void {
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame(() => {
      this.isAsked = false;
      this.renderer.render(this.scene, this.camera);
      this.canvas.dataset['drawn'] = String(Number(this.canvas.dataset['drawn'] ?? 0) + 1);
    });
  }

  get looking(): Look {
    return this.look;
  }

  /** Goes to one of the views; `pose` is where the camera of the flight is. */
  lookFrom(look: Look, pose?: Pose, halfHeight = 1): void {
    this.look = look;
    this.isMoved = false;
    this.controls.enabled = look === 'orbit' || look === 'top';
    this.camera.fov = FIELD_OF_VIEW_DEG;
    this.camera.up.set(0, 0, 1);
    this.fitLook();
    if (pose && look === 'follow') this.follow(pose);
    if (pose && look === 'camera') this.enter(pose, halfHeight);
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private fitLook(): void {
    if (this.look === 'orbit') this.fitFrom(ORBIT_FROM);
    if (this.look === 'top') this.fitFrom(TOP_FROM);
  }

  /**
   * Puts the camera, seen along `from` from the middle, as near as it may come with all of the box in the picture. With
   * (x, y, z) a corner by the camera's right, up and backward axes, and the camera at (a, b, d), it is in the picture if
   * |x - a| <= k (d - z) and |y - b| <= l (d - z) for the tangents k, l of half the picture's angles: each side bounds d,
   * and what one side leaves free is shared out between the two.
   */
  private fitFrom(from: Vector3): void {
    const middle = this.shown.getCenter(new Vector3());
    this.camera.position.copy(middle).add(from);
    this.camera.lookAt(middle);
    const [right, up, backward] = [new Vector3(), new Vector3(), new Vector3()];
    this.camera.updateMatrix();
    this.camera.matrix.extractBasis(right, up, backward);
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => {
      const { min, max } = this.shown;
      const corner = new Vector3(i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z).sub(middle);
      return new Vector3(corner.dot(right), corner.dot(up), corner.dot(backward));
    });
    const upright = (1 - MARGIN) * Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360);
    const across = sides(
      corners.map((c) => [c.x, c.z]),
      upright * this.camera.aspect,
    );
    const along = sides(
      corners.map((c) => [c.y, c.z]),
      upright,
    );
    const distance = Math.max(across.distance, along.distance, this.reach_m / 1000);
    this.controls.target.copy(middle).addScaledVector(right, across.place).addScaledVector(up, along.place);
    this.camera.position.copy(this.controls.target).addScaledVector(backward, distance);
    this.controls.update();
  }

  /** Behind and above the flight's camera, in the direction in which it looks over the ground. */
  private follow(pose: Pose): void {
    const ahead = new Vector3(0, 0, 1).applyQuaternion(pose.rotation).setZ(0);
    if (ahead.length() < 1e-3) ahead.set(0, 1, 0);
    ahead.normalize();
    const step_m = 0.12 * this.reach_m;
    this.camera.position.copy(pose.position).addScaledVector(ahead, -step_m).add(new Vector3(0, 0, 0.6 * step_m));
    this.camera.lookAt(pose.position.clone().addScaledVector(ahead, step_m));
  }

  private enter(pose: Pose, halfHeight: number): void {
    this.camera.position.copy(pose.position);
    this.camera.quaternion.copy(pose.rotation).multiply(T_pose_three);
    this.camera.fov = (2 * Math.atan(halfHeight) * 180) / Math.PI;
  }

  /** Turns, nears or leaves the middle by one key; false: the key is not one of these. */
  key(name: string): boolean {
    if (!this.controls.enabled) return false;
    const turns: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const turn = turns[name];
    const zoom = name === '+' || name === '=' ? 1 / ZOOM : name === '-' ? ZOOM : 1;
    if (!turn && zoom === 1) return false;
    const arm = this.camera.position.clone().sub(this.controls.target);
    if (turn) this.turn(arm, turn[0] * TURN_RAD, turn[1] * TURN_RAD);
    this.camera.position.copy(this.controls.target).addScaledVector(arm, zoom);
    this.isMoved = true;
    this.controls.update();
    return true;
  }

  private turn(arm: Vector3, around_rad: number, down_rad: number): void {
    arm.applyAxisAngle(this.camera.up, around_rad);
    const steep = Math.acos(arm.z / arm.length());
    const wanted = Math.min(Math.PI - 0.01, Math.max(0.01, steep + down_rad));
    const side = this.camera.up.clone().cross(arm).normalize();
    if (side.length() > 0) arm.applyAxisAngle(side, wanted - steep);
  }
}
