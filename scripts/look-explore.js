// Uses report/explore.html as people do, with its own content policy: pan, zoom, boundary, values under the pointer, profile
// linked to map and image, pixels of the image, keyboard. Values are compared with the tables beside the page.
const fs = require('fs');
const path = require('path');

// The rows of a table of the products by number, or an empty list where the site does not write CSV.
function rowsOf(file) {
  if (!fs.existsSync(file)) return [];
  const [head, ...rows] = fs.readFileSync(file, 'utf8').trim().split(/\r?\n/).map((row) => row.split(','));
  return rows.map((row) => Object.fromEntries(head.map((name, at) => [name, row[at]])));
}

// Names and values that the page shows.
const shown = (page) => page.evaluate(() => ({
  title: document.querySelector('#chosen h3')?.textContent ?? '',
  values: Object.fromEntries([...document.querySelectorAll('#chosen dl > div')].map((pair) => [...pair.children].map((part) => part.textContent))),
}));

// What a canvas of a part shows, in short.
const drawn = (page, part) => page.evaluate(async (selector) => {
  await new Promise((done) => { requestAnimationFrame(() => requestAnimationFrame(done)); });
  const canvas = document.querySelector(selector);
  return canvas ? canvas.toDataURL() : '';
}, part);

// Values of a footprint against the tables: numbers within half of their last digit.
function compared({ title, values }, footprints, registered) {
  const row = Number(title.match(/^Footprint (\d+)$/)?.[1]);
  const problems = [];
  const compare = (name, text, expected) => {
    if (text === undefined || expected === undefined || expected === '') return 0;
    const decimals = text.split('.')[1]?.length ?? 0;
    const apart = Math.abs(Number(text.replace('−', '-')) - Number(expected));
    if (!(apart <= 0.5000001 * 10 ** -decimals)) problems.push(`${title}: ${name} is ${text} on the page and ${expected} in the table`);
    return 1;
  };
  let count = 0;
  const number = (text) => text?.match(/[−\d.]+/)?.[0];
  const own = footprints[row];
  if (own) {
    count += compare('longitude', number(values['east longitude']), own.longitude_deg);
    count += compare('height', number(Object.entries(values).find(([name]) => /^height above the (areoid|ellipsoid)$/.test(name))?.[1]), own.topography_m);
    if (own.utc && own.utc !== `${values.UTC}Z`) problems.push(`${title}: UTC is ${values.UTC} on the page and ${own.utc} in the table`);
  }
  for (const one of registered.filter((of) => Number(of.footprint_row) === row)) {
    for (const [name, prefix] of [['kernels', 'before'], ['adjusted', 'adjusted']]) {
      const [line, sample] = values[`${one.image}, ${name}`]?.match(/[−\d.]+/g) ?? [];
      count += compare(`${one.image} line`, line, one[`${prefix}_line`]);
      count += compare(`${one.image} sample`, sample, one[`${prefix}_sample`]);
    }
  }
  return { problems, count };
}

async function explore(browser, file, view, picture) {
  const context = await browser.newContext({
    viewport: { width: view.width, height: 900 }, colorScheme: view.scheme, hasTouch: view.width < 500,
  });
  const page = await context.newPage();
  const problems = [];
  const expect = (holds, words) => { if (!holds) problems.push(words); };
  page.on('console', (message) => { if (message.type() === 'error') problems.push(`console: ${message.text()}`); });
  page.on('pageerror', (error) => problems.push(`error: ${error.message}`));
  page.on('request', (request) => {
    if (!/^(file|data):/.test(request.url())) problems.push(`asks for ${request.url()}`);
  });
  await page.goto(`file://${path.resolve(file)}`);
  const paint = await page.waitForFunction(() => performance.getEntriesByName('first-contentful-paint')[0]?.startTime);
  console.log(`look: note: ${file} (${view.name}): first paint after ${Math.round(await paint.jsonValue())} ms`);
  const folder = path.dirname(path.dirname(path.resolve(file)));
  const [footprints, registered] = ['footprints.csv', 'registered_footprints.csv'].map((name) => rowsOf(path.join(folder, name)));

  // Every control is reached with the tabulator, in view when it has the focus.
  const controls = await page.evaluate(() => [...document.querySelectorAll('#map,#strip,#graph,select,button,input')].filter((of) => of.offsetParent).map((of) => of.id).filter(Boolean));
  const reached = new Set();
  for (let step = 0; step < 60; step += 1) {
    await page.keyboard.press('Tab');
    reached.add(await page.evaluate(() => document.activeElement.id));
  }
  expect(controls.every((id) => reached.has(id)), `not reached by keyboard: ${controls.filter((id) => !reached.has(id))}`);

  // Profile: keys choose a footprint, and map, image and values follow.
  let checked = 0;
  const check = (of) => {
    const { problems: found, count } = compared(of, footprints, registered);
    problems.push(...found);
    checked += count;
  };
  const hasProfile = await page.evaluate(() => document.getElementById('profile').options.length > 0);
  if (hasProfile) {
    await page.focus('#graph');
    await page.keyboard.press('Home');
    const first = await shown(page);
    check(first);
    const before = [await drawn(page, '#map canvas'), await drawn(page, '#strip canvas')];
    for (let step = 0; step < 5; step += 1) await page.keyboard.press('PageUp');
    const later = await shown(page);
    check(later);
    expect(first.title && first.title !== later.title, 'keys on the profile choose no footprint');
    expect(await drawn(page, '#map canvas') !== before[0], 'the map does not follow the profile');
    const spoken = await page.getAttribute('#graph', 'aria-valuetext');
    expect(spoken?.includes('above the'), 'the profile does not state its value');
    await page.hover('#graph', { position: { x: 200, y: 60 } });
    const hovered = await shown(page);
    check(hovered);
    expect(/^(Footprint|Tie point)/.test(hovered.title), 'the profile shows no value under the pointer');
    if (registered.length) {
      // A footprint of an image, by the profile: the image marks it.
      const inside = await page.evaluate(() => document.querySelectorAll('#image option').length > 0);
      expect(inside, 'no image is offered');
    }
  }

  // Map: keys pan and zoom; values appear under the pointer.
  await page.focus('#map');
  const pane = () => page.evaluate(() => document.querySelector('#map .leaflet-map-pane').style.transform);
  const scale = () => page.textContent('#map .leaflet-control-scale-line');
  const start = [await pane(), await scale()];
  await page.keyboard.press('+');
  await page.waitForFunction((words) => document.querySelector('#map .leaflet-control-scale-line').textContent !== words, start[1], { timeout: 2000 })
    .catch(() => problems.push('+ does not zoom the map'));
  const zoomed = await pane();
  await page.keyboard.press('ArrowRight');
  await page.waitForFunction((style) => document.querySelector('#map .leaflet-map-pane').style.transform !== style, zoomed, { timeout: 2000 })
    .catch(() => problems.push('arrow keys do not pan the map'));
  await page.keyboard.press('-');
  await page.waitForTimeout(400);
  const stage = await page.locator('#map').boundingBox();
  let found = { title: '' };
  if (footprints.length) {
    // Some line across the map meets a track of footprints.
    await page.locator('#map').scrollIntoViewIfNeeded();
    const box = await page.locator('#map').boundingBox();
    for (let row = 1; row < 10 && !found.seen; row += 1) {
      for (let x = 40; x < box.width - 10 && !found.seen; x += 5) {
        await page.mouse.move(box.x + x, box.y + (box.height * row) / 11);
        if (await page.isVisible('.map-part .tip:not([hidden])')) found = { ...await shown(page), seen: true };
      }
    }
    expect(found.seen, 'the map shows no value under the pointer');
    check(found);
  }

  // Boundary between two pictures.
  if (await page.isVisible('#swipe')) {
    const clip = () => page.evaluate(() => document.querySelector('.leaflet-left-pane').style.clip);
    const old = await clip();
    await page.focus('#swipe');
    await page.keyboard.press('ArrowRight');
    expect(await clip() !== old, 'the boundary between pictures does not move');
    await page.locator('#swipe').scrollIntoViewIfNeeded();
    const thumb = await page.locator('#swipe').boundingBox();
    const [x, y] = [thumb.x + thumb.width / 2, thumb.y + thumb.height / 2];
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x - stage.width / 4, y, { steps: 4 });
    await page.mouse.up();
    expect(Number(await page.inputValue('#swipe')) < 400, `the boundary cannot be dragged: ${await page.inputValue('#swipe')}`);
  }

  // Image: zoomed in, it shows the pixels of its tiles.
  const pictures = () => page.evaluate(() => [...document.querySelectorAll('#strip img')].map((of) => of.complete && of.naturalWidth > 0));
  if ((await pictures()).length) {
    await page.focus('#strip');
    for (let step = 0; step < 4; step += 1) { await page.keyboard.press('+'); await page.waitForTimeout(150); }
    await page.waitForTimeout(400);
    const all = await pictures();
    expect(all.every(Boolean), 'a picture of the image is not loaded');
    const largest = await page.evaluate(() => document.querySelectorAll('#strip img').length);
    console.log(`look: note: ${file} (${view.name}): ${largest} pictures of the image in view`);
    await page.click('#strip', { position: { x: 100, y: 100 } });
  }
  await page.screenshot({ path: picture, fullPage: true });
  const loaded = await page.evaluate(() => [...document.querySelectorAll('img')].every((of) => of.complete && of.naturalWidth > 0));
  expect(loaded, 'a picture of the map is not loaded');
  if (footprints.length) expect(checked > 0, 'no value was compared with the tables');
  console.log(`look: note: ${file} (${view.name}): ${checked} values compared with the tables`);
  await context.close();
  return problems;
}

module.exports = { explore };
