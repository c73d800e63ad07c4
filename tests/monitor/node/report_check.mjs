// node report_check.mjs RUN_DIR
// Opens report.html in Chromium without a network: no request but the file itself, no console error, every chart drawn,
// and zooming one chart zooms all.
import assert from 'node:assert/strict';
import { resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { chromium } from 'playwright-core';

const url = pathToFileURL(resolve(process.argv[2], 'report.html')).href;
const browser = await chromium.launch({
  executablePath: process.env.TAKT_CHROMIUM,
  args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync'],
});
try {
  const page = await browser.newPage({ viewport: { width: 1200, height: 1600 } });
  const errors = [];
  const requests = [];
  page.on('console', (message) => { if (message.type() === 'error') errors.push(message.text()); });
  page.on('pageerror', (error) => errors.push(String(error)));
  page.on('request', (request) => requests.push(request.url()));
  await page.goto(url);

  // Number of colours painted on each chart's canvases.
  const drawn = await page.evaluate(() => ['age', 'stages', 'modes', 'tracking'].map((id) => {
    const colours = new Set();
    for (const canvas of document.querySelectorAll(`#${id} canvas`)) {
      const pixels = new Uint32Array(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.buffer);
      for (const pixel of pixels) if (pixel !== 0) colours.add(pixel);
    }
    return colours.size;
  }));
  for (const colours of drawn) assert.ok(colours > 3, `charts drawn with ${drawn} colours`);
  assert.ok((await page.textContent('#text')).includes('deadline misses'));
  assert.equal(await page.locator('.verdict').count(), 2);

  const label = () => page.evaluate(() => ['age', 'tracking'].map((id) =>
    [...document.querySelectorAll(`#${id} .dygraph-axis-label-x`)].map((each) => each.textContent).join()));
  const [age, tracking] = await label();
  const box = await page.locator('#age').boundingBox();
  await page.mouse.move(box.x + 300, box.y + 100);
  await page.mouse.down();
  await page.mouse.move(box.x + 500, box.y + 105, { steps: 5 });
  await page.mouse.up();
  const [zoomedAge, zoomedTracking] = await label();
  assert.notEqual(zoomedAge, age, 'dragging zooms');
  assert.notEqual(zoomedTracking, tracking, 'and takes the other charts along');
  await page.selectOption('#joint', '1');

  assert.deepEqual(errors, []);
  assert.deepEqual(requests, [url], 'nothing is fetched');
  console.log(`charts drawn with ${drawn.join(', ')} colours; one request, no error`);
} finally {
  await browser.close();
}
