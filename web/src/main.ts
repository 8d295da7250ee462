/** Begins the view when the reader comes near it, and says so where the browser cannot show it. */
import { readViewData } from './data';
import { View } from './view';

const WITH_A_MOUSE = 'Drag to turn, drag with the right button to move, click into the view and use the wheel to zoom; click a point of a map for its error.';
const WITH_FINGERS = 'Drag to turn, use two fingers to move and to zoom; tap a point of a map for its error.';

/** A screen's height before it is seen. */
const NEAR = '600px';

function hasWebGl(): boolean {
  return document.createElement('canvas').getContext('webgl2') !== null;
}

function say(host: HTMLElement, state: string, words: string): void {
  host.dataset['state'] = state;
  const note = document.getElementById('view-note');
  if (note) note.textContent = words;
}

async function begin(host: HTMLElement): Promise<void> {
  const store = document.getElementById('view-data');
  if (!store) return;
  if (!hasWebGl()) {
    say(host, 'pictures', 'The interactive view needs WebGL 2, and there is no WebGL 2 in this browser; the figures above and below show the same place, maps and paths.');
    return;
  }
  say(host, 'loading', 'Loading the view\u2026');
  try {
    await View.show(await readViewData(store.textContent ?? ''), host);
    store.remove();
    say(host, 'ready', matchMedia('(pointer: coarse)').matches ? WITH_FINGERS : WITH_A_MOUSE);
  } catch (error) {
    host.replaceChildren();
    say(host, 'pictures', `The interactive view could not be created (${error instanceof Error ? error.message : String(error)}); the figures above and below show the same place, maps and paths.`);
  }
}

const host = document.getElementById('view-host');
if (host) {
  const observer = new IntersectionObserver(
    (entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      observer.disconnect();
      void begin(host);
    },
    { rootMargin: NEAR },
  );
  observer.observe(host);
}
