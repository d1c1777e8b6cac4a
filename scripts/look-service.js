// Uses the service's pages in headless Chromium; see scripts/look-service.
const fs = require('fs');
const path = require('path');
const { chromium } = require('playwright-core');

const [chromiumPath, pictures, address, token] = process.argv.slice(2);
const axe = fs.readFileSync(require.resolve('axe-core/axe.min.js'), 'utf8');
const widths = [['phone', 360], ['tablet', 800], ['desktop', 1440]];
const pages = [['sites', '/'], ['site', '/sites/alpha'], ['site-not-valid', '/sites/gamma'], ['jobs', '/jobs'], ['job', '/jobs/4'],
  ['run', '/runs/20260301_010000_j2_a1'], ['kernels', '/kernels'], ['nights', '/nights'], ['events', '/events'], ['docs', '/docs'], ['night', '/nights/1'],
  ['login', '/login'], ['missing', '/nothing']];
let failed = false;

function wrong(where, text) {
  failed = true;
  console.error(`look-service: ${where}: ${text}`);
}

async function opened(browser, width, scheme, bypassCSP) {
  const context = await browser.newContext({ viewport: { width, height: 900 }, colorScheme: scheme, bypassCSP });
  const page = await context.newPage();
  const where = () => `${page.url()} (${width}, ${scheme})`;
  page.on('console', (message) => {
    // The missing page is requested on purpose.
    if (message.type() === 'error' && !/\/nothing$/.test(message.location().url)) wrong(where(), `console: ${message.text()}`);
  });
  page.on('pageerror', (error) => wrong(where(), error.message));
  page.on('request', (request) => {
    if (!request.url().startsWith(address) && !request.url().startsWith('data:')) wrong(where(), `asks for ${request.url()}`);
  });
  return page;
}

async function logIn(page) {
  await page.goto(`${address}/login?next=/jobs/4`);
  await page.fill('#areograph-token', token);
  await page.click('main button');
  if (new URL(page.url()).pathname !== '/jobs/4') wrong(page.url(), 'logging in did not lead to the job');
}

async function look(page, name, place, width, scheme) {
  await page.goto(address + place);
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  if (wide > width) wrong(place, `scrolls sideways: ${wide} of ${width} pixels`);
  await page.screenshot({ path: path.join(pictures, `service-${name}-${width}-${scheme}.png`), fullPage: true });
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => axe.run());
  for (const { impact, id, help, nodes } of violations) {
    const text = `axe ${impact}: ${id}, ${help} (${nodes.length} times, first ${nodes[0].html.slice(0, 120)})`;
    if (impact === 'serious' || impact === 'critical') wrong(`${place} (${width}, ${scheme})`, text);
    else console.log(`look-service: note: ${place}: ${text}`);
  }
}

// With the security policy of the pages in force.
async function use(browser) {
  const page = await opened(browser, 1440, 'light', false);
  await logIn(page);
  await page.waitForFunction(() => document.getElementById('live').textContent.includes('Live'));
  await page.click('#cancel');
  await page.waitForFunction(() => document.getElementById('job').textContent.includes('cancelling'));
  await page.goto(`${address}/sites/gamma`);
  // Another window requests a run: this one shows it without reloading.
  const other = await page.context().newPage();
  await other.goto(`${address}/sites/gamma`);
  await other.fill('#reason', 'looked at');
  await other.click('main button[value=true]');
  const job = new URL(other.url()).pathname.split('/').pop();
  await page.waitForFunction((job) => document.getElementById('jobs').textContent.includes(job), job, { timeout: 10000 });
  await page.goto(`${address}/sites/alpha`);
  await page.click('text=Report');
  if (!/\/files\/report\/index\.html$/.test(page.url())) wrong(page.url(), 'the report did not open');
  await page.goto(address);
  await page.click('text=Log out');
  if (new URL(page.url()).pathname !== '/login') wrong(page.url(), 'logging out did not lead to the form');
  await page.context().close();
  // Without a script the same pages are available.
  const context = await browser.newContext({ javaScriptEnabled: false });
  const plain = await context.newPage();
  await logIn(plain);
  await plain.goto(address);
  if (!(await plain.textContent('main')).includes('alpha')) wrong(address, 'is empty without a script');
  await context.close();
}

(async () => {
  fs.mkdirSync(pictures, { recursive: true });
  const browser = await chromium.launch({
    executablePath: chromiumPath,
    args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
      '--disable-background-networking', '--disable-component-update', '--disable-sync'],
  });
  try {
    for (const [, width] of widths) {
      for (const scheme of ['light', 'dark']) {
        const page = await opened(browser, width, scheme, true);
        await logIn(page);
        for (const [name, place] of pages) await look(page, name, place, width, scheme);
        await page.context().close();
        // Sessions are opened no faster than changes are permitted.
        await new Promise((done) => setTimeout(done, 3000));
      }
    }
    await use(browser);
  } catch (error) {
    wrong('browser', error.message);
  }
  await browser.close();
  console.log(`look-service: ${pages.length} pages at ${widths.length} widths, light and dark, pictures in ${pictures}`);
  process.exit(failed ? 1 : 0);
})();
