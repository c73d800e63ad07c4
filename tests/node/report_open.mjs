// SPDX-License-Identifier: Apache-2.0
// node report_open.mjs REPORT.html
// How long a browser takes, medians of five openings: from navigation until every chart is drawn, for a jump to a
// violation, and back to the whole run. Prints one line of JSON. Each opening has a browser of its own.
import { resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { inBrowser, ready } from './browser.mjs';

process.env.TAKT_CHROMIUM ??= '/usr/bin/chromium';
const url = pathToFileURL(resolve(process.argv[2])).href;
const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];

async function open() {
  return inBrowser({}, async (page, { errors, requests }) => {
    await page.goto(url);
    const open_ms = await ready(page);
    const [jump_ms, whole_ms] = await page.evaluate(() => {
      const timed = (act) => {
        const begin = performance.now();
        act();
        return performance.now() - begin;
      };
      const { violations, view } = takt.page;
      return [timed(() => violations.next()), timed(() => view.whole())];
    });
    if (errors.length || requests.length !== 1) throw new Error(`${errors} ${requests}`);
    return { open_ms, jump_ms, whole_ms };
  });
}

const openings = [];
for (let repetition = 0; repetition < 5; ++repetition) openings.push(await open());
const result = {};
for (const name of Object.keys(openings[0])) result[name] = median(openings.map((opening) => opening[name]));
console.log(JSON.stringify(result));
