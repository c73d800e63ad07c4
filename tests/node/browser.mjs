// SPDX-License-Identifier: Apache-2.0
// Chromium without a network, and what it complained about.
import { chromium } from 'playwright-core';

const switches = ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
  '--disable-component-update', '--disable-sync'];

// Opens `url` and calls look(page, {errors, requests}); the browser is closed afterwards.
export async function inBrowser(options, look) {
  // A browser that is read from a cold disk takes its time; what is tested begins afterwards.
  const browser = await chromium.launch({ timeout: 120_000, executablePath: process.env.TAKT_CHROMIUM, args: switches });
  try {
    const page = await browser.newPage({ viewport: { width: 1500, height: 1900 }, ...options });
    const errors = [];
    const requests = [];
    page.on('console', (message) => { if (message.type() === 'error') errors.push(message.text()); });
    page.on('pageerror', (error) => errors.push(String(error)));
    page.on('request', (request) => requests.push(request.url()));
    return await look(page, { errors, requests });
  } finally {
    await browser.close();
  }
}

// ms from the start of navigation until every chart was drawn.
export async function ready(page) {
  await page.waitForFunction(() => document.documentElement.dataset.ready, null, { timeout: 60000 });
  return Number(await page.evaluate(() => document.documentElement.dataset.ready));
}
