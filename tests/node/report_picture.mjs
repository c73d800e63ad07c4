// SPDX-License-Identifier: Apache-2.0
// node report_picture.mjs RUN_DIR [OUT.png]: the first screen of a run's report.html, while the policy of the recorded demo
// stalls. Default: report.png in RUN_DIR.
import { resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { inBrowser, ready } from './browser.mjs';

const [folder, out = `${folder}/report.png`] = process.argv.slice(2);
await inBrowser({ viewport: { width: 1280, height: 1010 }, colorScheme: 'light' }, async (page) => {
  await page.goto(pathToFileURL(resolve(folder, 'report.html')).href);
  await ready(page);
  await page.evaluate(() => {
    takt.page.view.setCursor(1.8);
    const subtitle = document.getElementById('subtitle');  // without the machine that drew it
    subtitle.textContent = subtitle.textContent.split(', ').slice(0, 3).join(', ');
  });
  await page.screenshot({ path: out });
});
