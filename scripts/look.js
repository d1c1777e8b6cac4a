// Opens pages in headless Chromium; see scripts/look.
const fs = require('fs');
const path = require('path');
const { chromium } = require('playwright-core');
const { explore } = require('./look-explore.js');

const [chromiumPath, pictures, ...pages] = process.argv.slice(2);
const axe = fs.readFileSync(require.resolve('axe-core/axe.min.js'), 'utf8');
const views = [
  { name: 'phone', width: 360, scheme: 'light' },
  { name: 'phone-dark', width: 390, scheme: 'dark' },
  { name: 'tablet', width: 800, scheme: 'dark' },
  { name: 'desktop', width: 1440, scheme: 'light' },
  { name: 'desktop-dark', width: 1440, scheme: 'dark' },
];

// Pairs of words in a figure whose letters overlap; a fifth of their height above and below is spacing, not letters.
function overprints() {
  const pairs = [];
  for (const svg of document.querySelectorAll('svg')) {
    const boxes = [...svg.querySelectorAll('text')].map((text) => {
      const box = text.getBoundingClientRect();
      const room = box.height / 5;
      return { words: text.textContent.trim(), left: box.left + 1, right: box.right - 1, top: box.top + room, bottom: box.bottom - room };
    }).filter((box) => box.words);
    boxes.forEach((one, place) => boxes.slice(0, place).forEach((other) => {
      const overlap = one.left < other.right && other.left < one.right && one.top < other.bottom && other.top < one.bottom;
      if (overlap) pairs.push(`${other.words} and ${one.words}`);
    }));
  }
  return pairs;
}

// The limits of a report as it opens: its height, and what its first screen shows: half of the picture at least.
function sizes() {
  const problems = [];
  const high = document.documentElement.scrollHeight;
  if (high > 6000) problems.push(`${high} pixels high; expected at most 6000`);
  const seen = (what, selector, share) => {
    const box = document.querySelector(selector)?.getBoundingClientRect();
    const down = box ? Math.round(box.top + share * box.height) : 0;
    if (down > innerHeight) problems.push(`${what}: ${down} pixels from the top; the first screen has ${innerHeight}`);
  };
  seen('the middle of the picture', '.first figure svg', 0.5);
  seen('the end of the key numbers', '.numbers', 1);
  seen('the end of the downloads', '.downloads', 1);
  return problems;
}

const nameOf = (file) => path.resolve(file).split(path.sep).slice(-3).filter(Boolean).join('-').replace(/\.html$/, '');

async function look(browser, file, view) {
  const context = await browser.newContext({
    viewport: { width: view.width, height: 900 },
    colorScheme: view.scheme,
    bypassCSP: true,
  });
  const page = await context.newPage();
  const problems = [];
  page.on('console', (message) => {
    if (message.type() === 'error') problems.push(`console: ${message.text()}`);
  });
  page.on('pageerror', (error) => problems.push(`error: ${error.message}`));
  page.on('request', (request) => {
    if (!/^(file|data):/.test(request.url())) problems.push(`asks for ${request.url()}`);
  });
  await page.goto('file://' + path.resolve(file));
  if (view.width === 1440 && /report\/index\.html$/.test(file)) problems.push(...await page.evaluate(sizes));
  // Folded content is checked too.
  await page.evaluate(() => document.querySelectorAll('details').forEach((folded) => { folded.open = true; }));
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  if (wide > view.width) problems.push(`scrolls sideways: ${wide} of ${view.width} pixels`);
  const overprinted = await page.evaluate(overprints);
  for (const pair of overprinted) problems.push(`labels lie on each other: ${pair}`);
  const name = nameOf(file);
  await page.screenshot({ path: path.join(pictures, `${name}-${view.name}.png`), fullPage: true });
  // Paper, once a page.
  if (view.scheme === 'light' && view.width > 1000) {
    await page.pdf({ path: path.join(pictures, `${name}.pdf`), format: 'A4', preferCSSPageSize: true });
  }
  await page.addScriptTag({ content: axe });
  const { violations } = await page.evaluate(() => axe.run());
  for (const { impact, id, help, nodes } of violations) {
    const text = `axe ${impact}: ${id}, ${help} (${nodes.length} times, first ${nodes[0].html.slice(0, 120)})`;
    if (impact === 'serious' || impact === 'critical') problems.push(text);
    else console.log(`look: note: ${file}: ${text}`);
  }
  await context.close();
  return problems;
}

(async () => {
  fs.mkdirSync(pictures, { recursive: true });
  const browser = await chromium.launch({
    executablePath: chromiumPath,
    args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
      '--disable-background-networking', '--disable-component-update', '--disable-sync'],
  });
  let failed = false;
  for (const file of pages) {
    for (const view of views) {
      // A page that crashes the browser is a problem of that page.
      const problems = await look(browser, file, view).catch((error) => [error.message]);
      if (path.basename(file) === 'explore.html') {
        const picture = path.join(pictures, `${nameOf(file)}-${view.name}-used.png`);
        problems.push(...await explore(browser, file, view, picture).catch((error) => [error.message]));
      }
      for (const problem of problems) {
        failed = true;
        console.error(`look: ${file} (${view.name}): ${problem}`);
      }
    }
  }
  await browser.close();
  console.log(`look: ${pages.length} pages at ${views.length} widths, pictures in ${pictures}`);
  process.exit(failed ? 1 : 0);
})();
