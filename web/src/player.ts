/** The bar that plays the flights, and their pictures beside the view. */
import type { FlightHeader, FrameHeader, ViewData } from './data';
import { button, make, number } from './elements';

/** The latest picture that is not after a time; the first one before that. */
export function frameAt(frames: FrameHeader[], time_s: number): number {
  let found = 0;
  frames.forEach((frame, i) => {
    if (frame.time_s <= time_s + 1e-6) found = i;
  });
  return found;
}

/** The pictures of one camera. */
class CameraPictures {
  readonly addresses: string[];

  constructor(
    data: ViewData,
    readonly name: string,
    readonly frames: FrameHeader[],
  ) {
    this.addresses = frames.map((frame) => URL.createObjectURL(new Blob([data.raw(frame)], { type: 'image/jpeg' })));
  }
}

class PictureStrip {
  readonly figure: HTMLElement;
  private readonly image = make('img', { alt: '' });
  private readonly caption = make('figcaption');
  private readonly cameras: CameraPictures[];
  private camera = 0;
  private shown = -1;
  private time_s = 0;

  constructor(
    data: ViewData,
    private readonly flight: FlightHeader,
  ) {
    const all = [{ name: flight.camera, frames: flight.frames }, ...flight.other_cameras];
    this.cameras = all.filter((c) => c.frames.length > 0).map((c) => new CameraPictures(data, c.name, c.frames));
    this.figure = make('figure', { class: `view-picture ${flight.key}` }, this.image, this.caption);
    if (this.cameras.length > 1) this.figure.prepend(this.cameraChoice());
  }

  private cameraChoice(): HTMLElement {
    const list = make('select', { id: `view-camera-${this.flight.key}` });
    this.cameras.forEach((camera, i) => list.append(make('option', { value: String(i) }, camera.name)));
    list.addEventListener('change', () => {
      this.camera = Number(list.value);
      this.shown = -1;
      this.show(this.time_s);
    });
    return make('label', {}, `Camera of the ${this.flight.label} flight `, list);
  }

  show(time_s: number): void {
    this.time_s = time_s;
    const camera = this.cameras[this.camera]!;
    const index = frameAt(camera.frames, time_s);
    if (index === this.shown) return;
    this.shown = index;
    const by = camera.name ? `, camera ${camera.name}` : '';
    const taken = `${this.flight.label} flight${by}, image at ${number(this.flight.start_s + camera.frames[index]!.time_s, 2)} s`;
    this.image.src = camera.addresses[index]!;
    this.image.alt = taken;
    this.caption.textContent = taken;
  }
}

/** Time runs from 0 at the start of the flights. */
export class Player {
  readonly bar: HTMLElement;
  readonly pictures: HTMLElement;
  private readonly slider: HTMLInputElement;
  private readonly clock = make('output', { class: 'view-clock', for: 'view-time' });
  private readonly playButton: HTMLButtonElement;
  private readonly strips: PictureStrip[];
  private speed: number;
  private isPlaying = false;
  private last_ms = 0;

  constructor(
    data: ViewData,
    flights: FlightHeader[],
    readonly end_s: number,
    private readonly moved: (time_s: number) => void,
  ) {
    this.strips = flights.filter((f) => f.frames.length > 0).map((f) => new PictureStrip(data, f));
    this.slider = make('input', { type: 'range', id: 'view-time', min: '0', max: String(end_s), step: String(end_s / 1000), value: '0', 'aria-label': 'Time in the flight' });
    this.slider.addEventListener('input', () => this.show());
    this.playButton = button('view-play', 'Play', () => this.toggle());
    // A whole flight in about half a minute, unless the reader wants it otherwise.
    this.speed = [1, 2, 5, 10, 20].find((s) => end_s / s <= 30) ?? 20;
    this.bar = make('div', { class: 'view-player' }, this.playButton, this.slider, this.clock, this.speeds());
    this.pictures = make('div', { class: 'view-pictures' }, ...this.strips.map((s) => s.figure));
    this.show();
  }

  get time_s(): number {
    return Number(this.slider.value);
  }

  private speeds(): HTMLElement {
    const list = make('select', { id: 'view-speed' });
    for (const speed of [1, 2, 5, 10, 20]) {
      const option = make('option', { value: String(speed) }, `${speed}\u00d7`);
      option.selected = speed === this.speed;
      list.append(option);
    }
    list.addEventListener('change', () => (this.speed = Number(list.value)));
    return make('label', {}, 'Speed ', list);
  }

  private toggle(): void {
    this.isPlaying = !this.isPlaying;
    this.playButton.textContent = this.isPlaying ? 'Pause' : 'Play';
    if (!this.isPlaying) return;
    if (this.time_s >= this.end_s) this.slider.value = '0';
    this.last_ms = performance.now();
    requestAnimationFrame((now_ms) => this.advance(now_ms));
  }

  private advance(now_ms: number): void {
    if (!this.isPlaying) return;
    const time_s = this.time_s + (this.speed * Math.max(0, now_ms - this.last_ms)) / 1000;
    this.last_ms = now_ms;
    this.slider.step = 'any';
    this.slider.value = String(Math.min(time_s, this.end_s));
    this.show();
    if (time_s >= this.end_s) this.toggle();
    else requestAnimationFrame((next_ms) => this.advance(next_ms));
  }

  show(): void {
    const time_s = this.time_s;
    this.clock.textContent = `${number(time_s, 1)} s of ${number(this.end_s, 1)} s`;
    this.slider.setAttribute('aria-valuetext', this.clock.textContent);
    for (const strip of this.strips) strip.show(time_s);
    this.moved(time_s);
  }
}
