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

// The middle of the ring that marks what is chosen, or null where the part does not show it.
const marked = (page, part) => page.evaluate((selector) => {
  const canvas = document.querySelector(`${selector} canvas`);
  const { width, height } = canvas;
  const pixels = canvas.getContext('2d').getImageData(0, 0, width, height).data;
  let [left, right, top, bottom] = [Infinity, -Infinity, Infinity, -Infinity];
  for (let at = 0; at < pixels.length; at += 4) {
    if (pixels[at] !== 193 || pixels[at + 1] !== 0 || pixels[at + 2] !== 25) continue;
    const [x, y] = [(at / 4) % width, Math.floor(at / 4 / width)];
    [left, right, top, bottom] = [Math.min(left, x), Math.max(right, x), Math.min(top, y), Math.max(bottom, y)];
  }
  const ratio = width / canvas.clientWidth;
  return left > right ? null : { x: (left + right) / 2 / ratio, y: (top + bottom) / 2 / ratio };
}, part);

// Points at what is marked: the value there.
async function pointed(page, part, section) {
  await page.locator(part).scrollIntoViewIfNeeded();
  await drawn(page, `${part} canvas`);
  const place = await marked(page, part);
  if (!place) return null;
  const box = await page.locator(part).boundingBox();
  await page.mouse.move(box.x + place.x, box.y + place.y);
  return await page.isVisible(`${section} .tip:not([hidden])`) ? shown(page) : { title: '', values: {} };
}

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

  // What is drawn on the map can be switched.
  for (const id of ['footprints', 'outlines', 'windows']) {
    const toggle = page.locator(`#${id}`);
    if (!await toggle.count()) continue;
    const on = await drawn(page, '#map canvas');
    await toggle.uncheck();
    const off = await drawn(page, '#map canvas');
    await toggle.check();
    expect(on !== off && on === await drawn(page, '#map canvas'), `the switch ${id} has no effect on the map`);
  }

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
    const onMap = await pointed(page, '#map', '.map-part');
    expect(/^(Footprint|Tie point)/.test(onMap?.title), 'the map shows no value under the pointer');
    if (onMap) check(onMap);
    // A footprint of the first image: the image marks it, and has its values under the pointer.
    const image = await page.evaluate(() => document.querySelector('#image option')?.textContent);
    const inside = registered.find((of) => of.image === image && (of.adjusted_inside === 'true' || !of.adjusted_line));
    if (inside) {
      await page.evaluate((id) => {
        const select = document.getElementById('profile');
        select.value = [...select.options].find((option) => option.textContent === id).value;
        select.dispatchEvent(new Event('change'));
      }, inside.profile);
      await page.focus('#graph');
      await page.keyboard.press('Home');
      // One that is inside before and after the adjustment.
      const isInside = ({ values }) => {
        const places = Object.entries(values).filter(([name]) => name.startsWith(image)).map(([, place]) => place);
        return places.length > 0 && !places.some((place) => place.includes('(outside)'));
      };
      for (let step = 0; step < 500 && !isInside(await shown(page)); step += 1) {
        await page.keyboard.press('ArrowRight');
      }
      const onImage = await pointed(page, '#strip', '.image-part');
      expect(/^(Footprint|Tie point)/.test(onImage?.title), 'the image does not mark the footprint of the profile');
      if (onImage) check(onImage);
      // Zoomed in about it, distances to its neighbours have room.
      let differs = false;
      for (let level = 0; level < 4 && !differs; level += 1) {
        await pointed(page, '#strip', '.image-part');
        await page.mouse.wheel(0, -300);
        await page.waitForTimeout(500);
        const without = await drawn(page, '#strip canvas');
        await page.check('#distances');
        differs = await drawn(page, '#strip canvas') !== without;
        await page.uncheck('#distances');
      }
      expect(differs, 'the image shows no distances between footprints');
    }
  }

  // Map: keys pan and zoom.
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
