/** The canvas: camera, light, drawing when something has changed, and the ways to look. */
import { Box3, ColorManagement, type Object3D, PerspectiveCamera, Quaternion, Scene, Vector3, WebGLRenderer, LinearSRGBColorSpace } from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import type { Pose } from './paths';

export type Look = 'orbit' | 'top' | 'follow' | 'camera';

const FIELD_OF_VIEW_DEG = 45;
const TURN_RAD = Math.PI / 36;
const ZOOM = 1.15;
/** A camera looks along -z with y up here, along z with y down in the data. */
const T_pose_three = new Quaternion(1, 0, 0, 0);

export class Stage {
  readonly scene = new Scene();
  readonly canvas: HTMLCanvasElement;
  readonly camera: PerspectiveCamera;
  private readonly renderer: WebGLRenderer;
  private readonly controls: OrbitControls;
  private readonly middle: Vector3;
  private readonly reach_m: number;
  private look: Look = 'orbit';
  private isAsked = false;

  /** Throws where the browser gives no WebGL. */
  constructor(extent: Box3) {
    ColorManagement.enabled = false; // colours are shown as they are stored
    // What is drawn stays, so that a reader can save it as a picture.
    this.renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.canvas = this.renderer.domElement;
    // Most of a place is near its ground, whatever stands out of it.
    this.middle = extent.getCenter(new Vector3());
    this.middle.z = 0.8 * extent.min.z + 0.2 * extent.max.z;
    this.reach_m = Math.max(1, extent.getSize(new Vector3()).setZ(0).length());
    this.camera = new PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, this.reach_m / 2000, this.reach_m * 20);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener('change', () => this.draw());
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
    this.controls.enabled = look === 'orbit' || look === 'top';
    this.camera.fov = FIELD_OF_VIEW_DEG;
    this.camera.up.set(0, 0, 1);
    if (look === 'orbit') this.place(new Vector3(-0.42, -0.86, 0.66), 0.98);
    if (look === 'top') this.place(new Vector3(0, -0.001, 1), 1.0);
    if (pose && look === 'follow') this.follow(pose);
    if (pose && look === 'camera') this.enter(pose, halfHeight);
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private place(direction: Vector3, distance: number): void {
    this.controls.target.copy(this.middle);
    this.camera.position.copy(this.middle).addScaledVector(direction.normalize(), distance * this.reach_m);
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
