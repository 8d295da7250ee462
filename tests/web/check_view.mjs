// Opens a report in headless Chromium and uses its view as a reader would: mouse, keyboard, without WebGL, on a phone.
// Usage: node check_view.mjs REPORT.html CHROMIUM GOLDEN.png FOLDER [--write-golden]; pictures of what was seen go to FOLDER.
import { readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { pathToFileURL } from 'node:url';
import { HtmlValidate } from 'html-validate';
import { chromium } from 'playwright-core';

const [report, executablePath, golden, folder, mode] = process.argv.slice(2);
const address = pathToFileURL(report).href;
const SOFTWARE_GL = ['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];
const NO_GL = ['--disable-gpu', '--disable-3d-apis', '--disable-software-rasterizer'];
const faults = [];

function expect(condition, what) {
  if (!condition) faults.push(what);
}

async function browser(flags) {
  return chromium.launch({ executablePath, args: ['--no-sandbox', '--disable-dev-shm-usage', ...flags] });
}

/** A page that notes what must not be: messages, errors, requests for anything but the page itself. */
async function open(instance, options = {}) {
  const page = await instance.newPage({ viewport: { width: 1280, height: 900 }, ...options });
  page.setDefaultTimeout(60000); // a machine may be busy with other tests
  page.on('console', (message) => {
    if (['error', 'warning'].includes(message.type()) && !/GPU stall|swiftshader/i.test(message.text())) faults.push(`console: ${message.text()}`);
  });
  page.on('pageerror', (error) => faults.push(`error on the page: ${error.message}`));
  page.on('request', (request) => {
    if (request.url() !== address && !/^(data|blob):/.test(request.url())) faults.push(`request for ${request.url().slice(0, 100)}`);
  });
  await page.goto(address);
  return page;
}

async function settled(page) {
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
}

/** What the canvas shows. */
async function picture(page) {
  await settled(page);
  return page.evaluate(() => document.querySelector('#view canvas').toDataURL('image/png').split(',')[1]);
}

/** How two pictures differ when both are 160 wide: the mean over pixels and channels, from 0 to 255; colours of the first. */
async function compared(page, first, second) {
  return page.evaluate(
    async ([a, b]) => {
      const pixels = async (base64) => {
        const image = new Image();
        image.src = `data:image/png;base64,${base64}`;
        await image.decode();
        const canvas = document.createElement('canvas');
        [canvas.width, canvas.height] = [160, 100];
        const context = canvas.getContext('2d');
        context.drawImage(image, 0, 0, 160, 100);
        return { data: context.getImageData(0, 0, 160, 100).data, url: canvas.toDataURL('image/png') };
      };
      const [p, q] = [await pixels(a), await pixels(b)];
      let sum = 0;
      const colors = new Set();
      for (let i = 0; i < p.data.length; i += 4) {
        for (let c = 0; c < 3; ++c) sum += Math.abs(p.data[i + c] - q.data[i + c]);
        colors.add((p.data[i] << 16) | (p.data[i + 1] << 8) | p.data[i + 2]);
      }
      return { difference: sum / (0.75 * p.data.length), colors: colors.size, small: p.url };
    },
    [first, second],
  );
}

async function changes(page, before, action, what) {
  await action();
  const after = await picture(page);
  const { difference } = await compared(page, before, after);
  expect(difference > 0.02, `${what}: the picture stayed the same`);
  return after;
}

async function checkGolden(page, seen) {
  const { small, colors } = await compared(page, seen, seen);
  expect(colors > 500, `the view is as good as blank: ${colors} colours`);
  if (mode === '--write-golden') writeFileSync(golden, Buffer.from(small.split(',')[1], 'base64'));
  const { difference } = await compared(page, seen, readFileSync(golden).toString('base64'));
  expect(difference < 8, `the view differs from the golden picture by ${difference.toFixed(1)} of 255`);
}

/** Everything is in the picture at first: its rim is empty, and what is shown takes up most of it. */
async function checkFit(page, seen, where) {
  const found = await page.evaluate(async (base64) => {
    const image = new Image();
    image.src = `data:image/png;base64,${base64}`;
    await image.decode();
    const canvas = document.createElement('canvas');
    const [width, height] = [(canvas.width = image.width), (canvas.height = image.height)];
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, width, height);
    const corner = [data[0], data[1], data[2]];
    const isDrawn = (x, y) => corner.some((value, c) => Math.abs(data[4 * (y * width + x) + c] - value) > 12);
    const drawn = { left: width, right: -1, top: height, bottom: -1 };
    for (let y = 0; y < height; ++y) {
      for (let x = 0; x < width; ++x) {
        if (!isDrawn(x, y)) continue;
        drawn.left = Math.min(drawn.left, x);
        drawn.right = Math.max(drawn.right, x);
        drawn.top = Math.min(drawn.top, y);
        drawn.bottom = Math.max(drawn.bottom, y);
      }
    }
    const isFree = drawn.left > 0 && drawn.top > 0 && drawn.right < width - 1 && drawn.bottom < height - 1;
    return { isFree, filled: Math.max((drawn.right - drawn.left) / width, (drawn.bottom - drawn.top) / height) };
  }, seen);
  expect(found.isFree, `${where}: something reaches beyond the picture at first`);
  expect(found.filled > 0.6, `${where}: what is shown takes up ${(100 * found.filled).toFixed(0)} % of the picture's width or height only`);
}

async function checkLayers(page, seen) {
  const boxes = page.locator('#view .view-layers input');
  const count = await boxes.count();
  expect(count >= 6, `only ${count} layers`);
  for (let i = 0; i < count; ++i) {
    const box = boxes.nth(i);
    const name = await box.getAttribute('id');
    const wasOn = await box.isChecked();
    await changes(page, seen, () => box.setChecked(!wasOn), name);
    await box.setChecked(wasOn);
  }
  const { difference } = await compared(page, seen, await picture(page));
  expect(difference < 0.5, `layers off and on again do not give the same picture (${difference})`);
}

async function checkColors(page, seen) {
  await changes(page, seen, () => page.locator('#view-color-error').check(), 'colours by error');
  expect(await page.locator('.view-scale').isVisible(), 'colours by error have no legend');
  await page.locator('#view-color-source').check();
  expect((await page.locator('.view-scale').count()) === 0, 'the legend stays when colours tell the flight');
}

async function checkPicking(page) {
  await page.locator('#view-look-top').click();
  const box = await page.locator('#view canvas').boundingBox();
  await page.mouse.click(box.x + 0.5 * box.width, box.y + 0.6 * box.height);
  const said = await page.locator('#view-info').textContent();
  expect(/map: east −?\d+\.\d\d m, north .*; error \d+\.\d{3} m to the surface/.test(said), `a click says: ${said}`);
  await page.locator('#view-reset').click();
  await page.locator('#view canvas').focus();
  await page.keyboard.press('Enter');
  expect(/error \d/.test(await page.locator('#view-info').textContent()), 'Enter chooses no point');
  await page.locator('#view-reset').click();
}

async function checkLooks(page) {
  let before = await picture(page);
  for (const look of ['top', 'follow', 'camera', 'orbit']) {
    before = await changes(page, before, () => page.locator(`#view-look-${look}`).click(), `view ${look}`);
  }
  await page.locator('#view canvas').focus();
  await changes(page, before, () => page.keyboard.press('ArrowLeft'), 'arrow key');
  await page.keyboard.press('Home');
}

async function checkPlaying(page) {
  const where = () => page.locator('#view-where').textContent();
  const shown = () => page.locator('.view-picture figcaption').first().textContent();
  const before = { where: await where(), shown: await shown(), picture: await picture(page) };
  expect(/camera: east .* m, north .* m, up .* m/.test(before.where), `whereabouts: ${before.where}`);
  await page.locator('#view-play').focus();
  await page.keyboard.press('Space');
  await page.waitForFunction((text) => document.querySelector('.view-picture figcaption').textContent !== text, before.shown, { timeout: 60000 });
  await page.keyboard.press('Space');
  const paused = await where();
  expect(paused !== before.where, 'playing does not move the cameras');
  const { difference } = await compared(page, before.picture, await picture(page));
  expect(difference > 0.02, 'playing does not change the picture');
  expect((await where()) === paused, 'Pause does not stop');
  await page.locator('#view-time').focus();
  await page.keyboard.press('End');
  expect((await where()) !== paused, 'the slider does not follow the keyboard');
  await page.keyboard.press('Home');
}

/** A rig's flight has a camera to choose, and the page without the view one to unfold. */
async function checkCameras(page) {
  const list = page.locator('#view-camera-simulated');
  expect((await list.locator('option').allTextContents()).join() === 'left,right,down', `cameras: ${await list.textContent()}`);
  expect((await page.locator('#view-camera-real').count()) === 0, 'a single camera can be chosen');
  const shown = page.locator('.view-picture.simulated');
  const seen = new Set();
  for (const name of ['left', 'right', 'down']) {
    await list.selectOption({ label: name });
    const said = await shown.locator('figcaption').textContent();
    expect(said === `Simulated flight, camera ${name}, image at 0.00 s`, `the chosen camera's picture says: ${said}`);
    seen.add(await shown.locator('img').evaluate(async (image) => {
      await image.decode();
      const canvas = document.createElement('canvas');
      [canvas.width, canvas.height] = [1, 1];
      canvas.getContext('2d').drawImage(image, 0, 0, 1, 1);
      return canvas.getContext('2d').getImageData(0, 0, 1, 1).data.slice(0, 3).join();
    }));
  }
  expect(seen.size === 3, `the cameras' pictures are the same: ${[...seen]}`);
  const folded = page.locator('figure.frames details.camera');
  expect((await folded.count()) === 2, `${await folded.count()} cameras to unfold`);
  await folded.first().locator('summary').click();
  expect(await folded.first().locator('img').first().isVisible(), 'an unfolded camera shows nothing');
  await page.locator('#view').scrollIntoViewIfNeeded();
  await page.locator('.view-pictures').screenshot({ path: `${folder}/cameras.png` });
}

async function checkKeyboard(page) {
  await page.evaluate(() => {
    document.activeElement.blur();
    scrollTo(0, 0);
  });
  const reached = new Set();
  for (let i = 0; i < 90; ++i) {
    await page.keyboard.press('Tab');
    reached.add(await page.evaluate(() => document.activeElement.id || document.activeElement.tagName));
  }
  for (const wanted of ['CANVAS', 'view-layer-place', 'view-color-source', 'view-look-top', 'view-play', 'view-time', 'view-speed', 'view-camera-simulated']) {
    expect(reached.has(wanted), `Tab does not reach ${wanted}`);
  }
}

async function checkAccessibility(page, name) {
  const axe = createRequire(import.meta.url)('axe-core');
  await page.evaluate(axe.source);
  const { violations } = await page.evaluate(() => window.axe.run(document, { resultTypes: ['violations'] }));
  for (const v of violations) faults.push(`axe (${name}): ${v.id}: ${v.help}: ${v.nodes.map((n) => n.html.slice(0, 120)).slice(0, 3).join(' | ')}`);
}

async function checkMarkup() {
  const validator = new HtmlValidate({
    extends: ['html-validate:recommended'],
    rules: {
      // The page is well-formed XML too, and written on one line.
      'void-style': ['error', { style: 'selfclose' }],
      'attribute-boolean-style': ['error', { style: 'name' }],
      'long-title': 'off',
      'no-inline-style': 'off',
      'no-trailing-whitespace': 'off',
    },
  });
  const result = await validator.validateString(readFileSync(report, 'utf8'), report);
  for (const file of result.results) for (const m of file.messages.slice(0, 10)) faults.push(`html-validate: ${m.ruleId}: ${m.message} (column ${m.column})`);
}

async function ready(page) {
  await page.locator('#view').scrollIntoViewIfNeeded();
  await page.locator('#view-host[data-state=ready]').waitFor();
}

async function checkView() {
  const instance = await browser(SOFTWARE_GL);
  const page = await open(instance);
  await ready(page);
  const seen = await picture(page);
  writeFileSync(`${folder}/view.png`, Buffer.from(seen, 'base64'));
  await checkGolden(page, seen);
  await checkFit(page, seen, 'the view');
  await checkLayers(page, seen);
  await checkColors(page, seen);
  await checkPicking(page);
  await checkLooks(page);
  await checkPlaying(page);
  await checkCameras(page);
  await checkKeyboard(page);
  await checkAccessibility(page, 'light');
  await page.screenshot({ path: `${folder}/page-light.png`, fullPage: true });
  writeFileSync(`${folder}/page.pdf`, await page.pdf({ format: 'A4', printBackground: true }));
  await page.emulateMedia({ colorScheme: 'dark' });
  await checkAccessibility(page, 'dark');
  await page.screenshot({ path: `${folder}/page-dark.png`, fullPage: true });
  await page.close();
  await checkPhone(instance);
  await instance.close();
}

async function checkPhone(instance) {
  const page = await open(instance, { viewport: { width: 360, height: 740 }, deviceScaleFactor: 2 });
  await ready(page);
  const width = await page.evaluate(() => document.documentElement.scrollWidth);
  expect(width <= 360, `with the view the page is ${width} pixels wide on a phone of 360`);
  await checkFit(page, await picture(page), 'on a phone');
  await page.screenshot({ path: `${folder}/page-phone.png`, fullPage: true });
  await page.close();
}

async function checkWithoutWebGl() {
  const instance = await browser(NO_GL);
  const page = await open(instance);
  await page.locator('#view').scrollIntoViewIfNeeded();
  await page.locator('#view-host[data-state=pictures]').waitFor();
  expect(/no WebGL/.test(await page.locator('#view-note').textContent()), 'without WebGL the page does not say so');
  expect((await page.locator('#view canvas').count()) === 0, 'without WebGL there is a canvas');
  expect(await page.locator('.maps svg').isVisible(), 'without WebGL there are no pictures');
  await instance.close();
}

await checkMarkup();
await checkView();
await checkWithoutWebGl();
for (const fault of faults) console.log(`check_view: ${fault}`);
if (faults.length > 0) process.exit(1);
console.log('check_view: the view does what it should');
