/** The whole view: layers on a stage, and the controls beside it. */
import { Box3, BufferAttribute, BufferGeometry, CanvasTexture, Color, type Mesh, type Object3D, Points, PointsMaterial, Vector2, Vector3 } from 'three';
import type { FlightHeader, ViewData } from './data';
import { button, checkbox, choice, make, number } from './elements';
import { cellBoxes, type ColorBy, Frustum, frustaAlong, MapLayer, pathLine, placeMesh } from './layers';
import { Path, type Pose } from './paths';
import { pickPoint } from './picking';
import { Player } from './player';
import { type Look, Stage } from './stage';

const STILL_FRUSTA = 16;

/** What one flight shows. */
interface FlightLayers {
  header: FlightHeader;
  map: MapLayer | null;
  estimate: Path | null;
  truth: Path | null;
  moving: Frustum[];
}

function pageColor(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** A ring that is seen on any ground. */
function ring(): CanvasTexture {
  const canvas = make('canvas', { width: '64', height: '64' });
  const context = canvas.getContext('2d')!;
  for (const [color, width] of [['#000000', 14], ['#ffc400', 8]] as const) {
    context.beginPath();
    context.arc(32, 32, 24, 0, 2 * Math.PI);
    context.strokeStyle = color;
    context.lineWidth = width;
    context.stroke();
  }
  return new CanvasTexture(canvas);
}

/** How much of a layer is shown, where that is not all. */
function partOf(shown: number, all: number, what: string): string {
  return shown < all ? ` (${shown.toLocaleString('en')} of ${all.toLocaleString('en')} ${what})` : '';
}

function isTyping(target: EventTarget | null): boolean {
  return target instanceof HTMLInputElement || target instanceof HTMLSelectElement;
}

export class View {
  private readonly stage: Stage;
  private readonly frame = make('div', { class: 'view-canvas' });
  private readonly layerBoxes = make('fieldset', { class: 'view-layers' }, make('legend', {}, 'Layers'));
  private readonly info = make('output', { class: 'view-info', id: 'view-info', 'aria-live': 'polite' }, 'No point selected.');
  private readonly legend = make('div', { class: 'view-legend', id: 'view-legend' });
  private readonly whereabouts = make('p', { class: 'view-where', id: 'view-where' });
  private readonly flights: FlightLayers[] = [];
  private readonly reach_m: number;
  private readonly mark: Points;
  private place: Mesh | null = null;
  private player: Player | null = null;
  private followed = 0;

  /** Throws where the browser gives no WebGL. */
  private constructor(
    private readonly data: ViewData,
    private readonly host: HTMLElement,
  ) {
    const { low_m, high_m, shown_low_m, shown_high_m } = data.header;
    this.reach_m = new Vector3(...low_m).distanceTo(new Vector3(...high_m));
    this.stage = new Stage(new Box3(new Vector3(...shown_low_m), new Vector3(...shown_high_m)));
    this.mark = this.makeMark();
    this.stage.add(this.mark);
  }

  static async show(data: ViewData, host: HTMLElement): Promise<View> {
    const view = new View(data, host);
    await view.addPlace();
    view.addCells();
    data.header.flights.forEach((flight) => view.addFlight(flight));
    view.layOut();
    return view;
  }

  private makeMark(): Points {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(new Float32Array(3), 3));
    const material = new PointsMaterial({ size: 22 * devicePixelRatio, sizeAttenuation: false, map: ring(), transparent: true, depthTest: false });
    const mark = new Points(geometry, material);
    mark.visible = false;
    mark.frustumCulled = false;
    mark.renderOrder = 1;
    return mark;
  }

  private async addPlace(): Promise<void> {
    if (!this.data.header.place) return;
    const place = await placeMesh(this.data, this.data.header.place);
    this.place = place;
    this.addLayer('place', `Place${partOf(this.data.header.place.triangles, this.data.header.place.source_triangles, 'triangles')}`, [place], true, null);
  }

  private addCells(): void {
    const header = this.data.header.cells;
    if (!header) return;
    const made: Mesh[] = [];
    // Many boxes: made when they are first shown.
    const show = (shown: boolean) => {
      if (shown && made.length === 0) {
        made.push(cellBoxes(this.data, header));
        this.stage.add(...made);
      }
      for (const boxes of made) boxes.visible = shown;
      this.stage.draw();
    };
    const isOnly = this.data.header.place === null;
    this.layerBoxes.append(checkbox('view-layer-cells', `Occupied cells, ${header.size_m} m`, isOnly, pageColor('--truth'), show));
    if (isOnly) show(true);
  }

  private addLayer(id: string, text: string, things: Object3D[], shown: boolean, swatch: string | null): void {
    const show = (wanted: boolean) => {
      for (const thing of things) thing.visible = wanted;
      this.stage.draw();
    };
    this.stage.add(...things);
    show(shown);
    this.layerBoxes.append(checkbox(`view-layer-${id}`, text, shown, swatch, show));
  }

  private addFlight(header: FlightHeader): void {
    const name = pageColor(`--${header.key}`) || '#2f6fde';
    const color = new Color(name);
    const half = { width: header.half_width, height: header.half_height };
    const path = (block: FlightHeader['estimate']) => (block ? new Path(this.data.floats(block)) : null);
    const flight: FlightLayers = { header, map: null, estimate: path(header.estimate), truth: path(header.truth), moving: [] };
    if (header.map) {
      flight.map = new MapLayer(this.data, header.map, color);
      this.addLayer(`${header.key}-map`, `${header.label} map${partOf(header.map.shown, header.map.points, 'points')}`, [flight.map.points], true, name);
    }
    const depth_m = 0.035 * this.reach_m;
    for (const [kind, words] of [['estimate', 'estimated path'], ['truth', 'true path']] as const) {
      const line = flight[kind];
      if (!line || line.length < 2) continue;
      const shade = kind === 'estimate' ? color : color.clone().lerp(new Color(1, 1, 1), 0.45);
      const moving = new Frustum(line, shade, half, kind === 'estimate' ? depth_m : 1.25 * depth_m);
      flight.moving.push(moving);
      const things: Object3D[] = [pathLine(line, shade, kind === 'truth', 0.008 * this.reach_m), moving.lines];
      if (kind === 'estimate') things.push(frustaAlong(line, STILL_FRUSTA, shade, half, 0.4 * depth_m));
      this.addLayer(`${header.key}-${kind}`, `${header.label}, ${words}`, things, true, `#${shade.getHexString()}`);
    }
    this.flights.push(flight);
  }

  private layOut(): void {
    const ends = this.flights.flatMap((f) => [f.estimate?.end_s ?? 0, f.truth?.end_s ?? 0, f.header.frames.at(-1)?.time_s ?? 0]);
    const end_s = Math.max(...ends, 0);
    const side = make('div', { class: 'view-side' }, this.layerBoxes, this.colorChoice(), this.legend, this.lookChoice(), this.pickBox());
    this.host.append(make('div', { class: 'view-body' }, this.frame, side));
    const credits = this.data.header.attribution.join(' \u00b7 ');
    if (credits) this.host.append(make('p', { class: 'view-where' }, `Place: ${credits}`));
    if (end_s > 0) {
      this.player = new Player(this.data, this.data.header.flights, end_s, (time_s) => this.moveTo(time_s));
      this.host.append(this.player.bar, this.whereabouts, this.player.pictures);
    }
    this.prepareCanvas();
    this.recolor();
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.recolor());
    this.stage.fill(this.frame);
  }

  private prepareCanvas(): void {
    const canvas = this.stage.canvas;
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'application');
    canvas.setAttribute('aria-label', 'View of the place, the maps and the paths. Arrow keys turn it, plus and minus zoom, Enter selects the point in the centre, Home resets.');
    canvas.addEventListener('keydown', (event) => this.onKey(event));
    let down = new Vector2();
    canvas.addEventListener('pointerdown', (event) => (down = new Vector2(event.clientX, event.clientY)));
    canvas.addEventListener('pointerup', (event) => {
      if (down.distanceTo(new Vector2(event.clientX, event.clientY)) < 4) this.pickAt(event.clientX, event.clientY);
    });
    canvas.addEventListener('webglcontextlost', () => (this.info.textContent = 'The browser has released the view\u2019s graphics context; reload the page.'));
  }

  private onKey(event: KeyboardEvent): void {
    if (isTyping(event.target) || event.ctrlKey || event.metaKey || event.altKey) return;
    const box = this.stage.canvas.getBoundingClientRect();
    if (event.key === 'Enter') this.pickAt(box.left + box.width / 2, box.top + box.height / 2, 0.1 * box.height);
    else if (event.key === 'Home') this.look('orbit');
    else if (!this.stage.key(event.key)) return;
    event.preventDefault();
  }

  private pickAt(x_px: number, y_px: number, radius_px = 8): void {
    const box = this.stage.canvas.getBoundingClientRect();
    const at = new Vector2((2 * (x_px - box.left)) / box.width - 1, 1 - (2 * (y_px - box.top)) / box.height);
    const maps = this.flights.flatMap((f) => (f.map ? [f.map] : []));
    const pick = pickPoint(maps, this.place, this.stage.camera, at, box, radius_px);
    this.mark.visible = pick !== null;
    this.stage.draw();
    if (!pick) {
      this.info.textContent = 'No point of a map there.';
      return;
    }
    this.mark.geometry.setAttribute('position', new BufferAttribute(new Float32Array(pick.position.toArray()), 3));
    const flight = this.flights.find((f) => f.map === pick.layer)!;
    this.info.textContent = `${flight.header.label} map: ${this.coordinates(pick.position)}; ${this.errors(pick.layer, pick.index)}.`;
  }

  private coordinates(p: Vector3): string {
    return `east ${number(p.x, 2)} m, north ${number(p.y, 2)} m, up ${number(p.z, 2)} m`;
  }

  private errors(map: MapLayer, i: number): string {
    const surface_m = map.surface_m(i);
    const voxel_m = map.voxel_m(i);
    const parts: string[] = [];
    if (surface_m !== null) parts.push(`error ${number(surface_m, 3)} m to the surface`);
    if (voxel_m !== null) parts.push(`${surface_m === null ? 'error ' : ''}${number(voxel_m, 3)} m to the nearest cell\u2019s centre`);
    return parts.join(', ') || 'error unknown';
  }

  private pickBox(): HTMLElement {
    return make('fieldset', {}, make('legend', {}, 'Selected point'), this.info);
  }

  private colorChoice(): HTMLElement {
    const options: [ColorBy, string][] = [['source', 'Flight'], ['error', 'Error']];
    if (this.flights.some((f) => f.map?.hasPictureColors())) options.push(['picture', 'Pictures']);
    return choice('view-color', 'Points\u2019 colour', options, (what) => this.colorBy(what));
  }

  private colorBy(what: ColorBy): void {
    for (const flight of this.flights) flight.map?.colorBy(what, this.data);
    this.legend.replaceChildren(...(what === 'error' ? this.errorLegend() : []));
    this.stage.draw();
  }

  private errorLegend(): HTMLElement[] {
    const limit_m = this.data.header.error_limit_m;
    const bar = make('div', { class: 'view-scale', role: 'img', 'aria-label': `Colours from blue, 0 m, to red, ${limit_m} m and more` });
    bar.style.background = `linear-gradient(to right, ${this.data.header.error_colors.map((c) => `rgb(${c.join(',')})`).join(',')})`;
    const ticks = [0, 0.25, 0.5, 0.75, 1].map((share) => make('span', {}, `${Number((share * limit_m).toPrecision(2))}${share === 1 ? '+' : ''}`));
    return [bar, make('div', { class: 'view-ticks', 'aria-hidden': 'true' }, ...ticks), make('p', {}, 'distance to the surface, m')];
  }

  private lookChoice(): HTMLElement {
    const box = make('fieldset', { class: 'view-looks' }, make('legend', {}, 'View'));
    const looks: [Look, string][] = [['orbit', 'Orbit'], ['top', 'From above']];
    if (this.flights.some((f) => f.estimate ?? f.truth)) looks.push(['follow', 'Follow'], ['camera', 'Camera view']);
    for (const [look, text] of looks) box.append(button(`view-look-${look}`, text, () => this.look(look)));
    box.append(button('view-reset', 'Reset', () => this.reset()));
    if (this.flights.length > 1) {
      const list = make('select', { id: 'view-followed' });
      this.flights.forEach((f, i) => list.append(make('option', { value: String(i) }, f.header.label)));
      list.addEventListener('change', () => {
        this.followed = Number(list.value);
        this.look(this.stage.looking);
      });
      box.append(make('label', {}, 'Flight to follow ', list));
    }
    return box;
  }

  private reset(): void {
    this.mark.visible = false;
    this.info.textContent = 'No point selected.';
    this.look('orbit');
  }

  private poseOf(flight: FlightLayers | undefined, time_s: number): Pose | undefined {
    const path = flight?.estimate ?? flight?.truth;
    return path && path.length > 0 ? path.at(time_s) : undefined;
  }

  private look(look: Look): void {
    const flight = this.flights[this.followed];
    for (const other of this.flights) for (const frustum of other.moving) frustum.isSeen = look !== 'camera' || other !== flight;
    this.stage.lookFrom(look, this.poseOf(flight, this.player?.time_s ?? 0), flight?.header.half_height);
  }

  private moveTo(time_s: number): void {
    for (const flight of this.flights) for (const frustum of flight.moving) frustum.moveTo(time_s);
    const lines = this.flights.flatMap((flight) => {
      const pose = this.poseOf(flight, time_s);
      return pose ? [`${flight.header.label} camera: ${this.coordinates(pose.position)}`] : [];
    });
    this.whereabouts.textContent = lines.join(' \u00b7 ');
    const isCarried = this.stage.looking === 'follow' || this.stage.looking === 'camera';
    if (isCarried) this.look(this.stage.looking);
    this.stage.draw();
  }

  private recolor(): void {
    this.stage.setBackground(pageColor('--panel') || '#888888');
  }
}
