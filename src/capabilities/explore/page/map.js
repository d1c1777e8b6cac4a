// The map: pictures on either side of a boundary, footprints, outlines, tie points and their residuals.
const mapBefore = '#018dff';
const mapAfter = '#ff610d';

function makeMap(choose) {
  const map = evenMap('map', {});
  const stage = map.getContainer().parentElement;
  const tip = tipIn(stage);
  const onMap = values.layers.filter((layer) => layer.edges_m);
  const layers = onMap.filter((layer) => !layer.below);
  const swipe = byId('swipe');
  const divider = document.createElement('div');
  divider.className = 'divider';
  stage.append(divider);

  // Pictures.
  const sides = ['left', 'right'].map((side) => {
    const pane = map.createPane(side);
    pane.style.zIndex = 200;
    return { side, pane, select: byId(side), shown: null };
  });
  const pictureOf = (layer, pane) => {
    const [west, south, east, north] = layer.edges_m;
    const [rows, cols] = layer.size;
    const bounds = ([top, bottom], [left, right]) => [
      [north - (bottom / rows) * (north - south), west + (left / cols) * (east - west)],
      [north - (top / rows) * (north - south), west + (right / cols) * (east - west)],
    ];
    return new Picture(layer, bounds, (east - west) / cols, pane);
  };
  const clip = () => {
    const size = map.getSize();
    const [first, second] = sides.map((of) => of.select.value);
    swipe.hidden = divider.hidden = first === second;
    // The middle of the handle, which is 32 pixels wide.
    const x = swipe.hidden ? size.x : 16 + (swipe.value / 1000) * (size.x - 32);
    divider.style.left = `${x}px`;
    const [from, to, middle] = [[0, 0], [size.x, size.y], [x, 0]].map((point) => map.containerPointToLayerPoint(point));
    sides[0].pane.style.clip = `rect(${from.y}px,${middle.x}px,${to.y}px,${from.x}px)`;
    sides[1].pane.style.clip = `rect(${from.y}px,${to.x}px,${to.y}px,${middle.x}px)`;
  };
  const dress = (of) => {
    of.shown?.remove();
    const layer = layers[of.select.value];
    of.shown = layer ? pictureOf(layer, of.side).addTo(map) : null;
  };
  // The boundary is first between the last two pictures: the ground by two images.
  const first = [layers.length - 2, layers.length - 1];
  for (const [at, of] of sides.entries()) {
    of.select.append(...layers.map((layer, index) => new Option(layer.title, index)), new Option('no picture', ''));
    of.select.value = layers[first[at]] ? first[at] : '';
    of.select.parentElement.hidden = layers.length === 0;
    of.select.addEventListener('change', () => { dress(of); clip(); });
  }

  const ground = L.layerGroup(onMap.filter((layer) => layer.below).map((layer) => pictureOf(layer, 'ground')));
  map.createPane('ground').style.zIndex = 100;
  byId('relief').addEventListener('change', (event) => (event.target.checked ? ground.addTo(map) : ground.remove()));

  // What is drawn on them.
  const toggles = Object.fromEntries(['footprints', 'outlines', 'windows', 'ties', 'residuals'].map((id) => [id, byId(id) ?? { checked: false }]));
  const state = { shot: -1, tie: -1 };
  const arrows = arrowsOf();
  const drawing = new Drawing((of) => {
    if (toggles.windows.checked) drawWindows(of);
    if (toggles.outlines.checked) drawOutlines(of);
    if (toggles.footprints.checked) drawFootprints(of);
    if (toggles.ties.checked) drawTies(of);
    if (toggles.residuals.checked) arrows.draw(of);
    const { context, x, y } = of;
    if (state.shot >= 0) ring(context, x(shots.x[state.shot]), y(shots.y[state.shot]), 8, '#c10019');
    if (state.tie >= 0) ring(context, x(ties.x[state.tie]), y(ties.y[state.tie]), 8, '#c10019');
  });
  for (const toggle of Object.values(toggles)) {
    toggle.addEventListener?.('change', () => { drawing.soon(); words(); });
  }

  // The images of the arrows, and their magnification.
  const words = () => {
    const arrowWords = byId('arrow-words');
    arrowWords.replaceChildren();
    if (!toggles.residuals.checked) return;
    arrowWords.append(arrows.times > 0 ? `residuals × ${arrows.times}: ` : 'no residuals');
    if (arrows.times > 0) for (const [index, { id }] of values.images.entries()) arrowWords.append(swatch(arrowColour(index)), `${id} `);
  };

  map.on('move zoom resize', clip);
  swipe.addEventListener('input', clip);

  const found = ({ latlng }, reach) => {
    const near = reach / 2 ** map.getZoom();
    const tie = toggles.ties.checked || toggles.residuals.checked ? ties.nearest.at(latlng.lng, latlng.lat, near) : -1;
    const shot = toggles.footprints.checked ? shots.nearest.at(latlng.lng, latlng.lat, near) : -1;
    return { tie, shot: tie >= 0 ? -1 : shot };
  };
  const point = (event, reach) => {
    const { tie, shot } = found(event, reach);
    if (tie < 0 && shot < 0) { tip.hide(); return; }
    tip.show(tie >= 0 ? tieWords(tie) : shotWords(shot), event.containerPoint);
    choose(tie >= 0 ? { tie } : { shot });
  };
  map.on('mousemove', (event) => point(event, 8));
  map.on('click', (event) => point(event, 16));
  map.on('mouseout', () => tip.hide());

  map.fitBounds(boundsOfAll(onMap), { padding: [8, 8] });
  L.control.scale({ imperial: false }).addTo(map);
  ground.addTo(map);
  sides.forEach(dress);
  drawing.addTo(map);
  clip();
  return {
    show({ shot = -1, tie = -1 }, isRemote) {
      Object.assign(state, { shot, tie });
      drawing.soon();
      const [of, at] = shot >= 0 ? [shots, shot] : [ties, tie];
      if (!isRemote || at < 0) return;
      tip.hide();
      const place = [of.y[at], of.x[at]];
      if (!map.getBounds().contains(place)) map.panTo(place, { animate: false });
    },
    redraw: () => drawing.soon(),
    map,
  };
}

// Everything that the map shows.
function boundsOfAll(layers) {
  const bounds = L.latLngBounds([]);
  const { west, south, east, north } = shots.nearest;
  if (shots.count) bounds.extend([south, west]).extend([north, east]);
  for (const image of values.images) {
    for (const corner of image.outline_deg) {
      const [x, y] = placeOf(...corner);
      bounds.extend([y, x]);
    }
  }
  if (!bounds.isValid()) for (const layer of layers) bounds.extend([layer.edges_m[1], layer.edges_m[0]]).extend([layer.edges_m[3], layer.edges_m[2]]);
  return bounds.isValid() ? bounds : L.latLngBounds([[-1000, -1000], [1000, 1000]]);
}

function drawOutlines({ context, x, y }) {
  for (const [index, { id, outline_deg: outline }] of values.images.entries()) {
    if (!outline.length) continue;
    const places = outline.map((corner) => placeOf(...corner));
    for (const [width, colour] of [[4, '#fff'], [2, '#c84a96']]) {
      context.lineWidth = width;
      context.strokeStyle = colour;
      context.beginPath();
      for (const [east, north] of places) context.lineTo(x(east), y(north));
      context.closePath();
      context.stroke();
    }
    const top = places.reduce((best, place) => (place[1] > best[1] ? place : best));
    const low = places.reduce((best, place) => (place[1] < best[1] ? place : best));
    // The images of a pair begin and end together.
    if (index % 2) label(context, id, x(low[0]) + 4, y(low[1]) + 16);
    else label(context, id, x(top[0]) + 4, y(top[1]) - 6);
  }
}

// Search windows, dashed.
function drawWindows({ context, x, y }) {
  for (const { id, ring_deg: ring } of values.windows) {
    const places = ring.map((corner) => placeOf(...corner));
    for (const [width, colour, dash] of [[4, '#fff', []], [2, '#222', [8, 5]]]) {
      context.lineWidth = width;
      context.strokeStyle = colour;
      context.setLineDash(dash);
      context.beginPath();
      for (const [east, north] of places) context.lineTo(x(east), y(north));
      context.closePath();
      context.stroke();
    }
    context.setLineDash([]);
    const low = places.reduce((best, place) => (place[1] - place[0] < best[1] - best[0] ? place : best));
    context.textAlign = 'right';
    label(context, id, x(low[0]) - 4, y(low[1]) - 6);
    context.textAlign = 'left';
  }
}

function swatch(colour) {
  const mark = document.createElement('i');
  mark.className = 'swatch';
  mark.style.background = colour;
  return mark;
}

function label(context, words, x, y) {
  context.font = '13px system-ui, sans-serif';
  context.lineWidth = 3;
  context.strokeStyle = '#fff';
  context.strokeText(words, x, y);
  context.fillStyle = '#222';
  context.fillText(words, x, y);
}

// Squares by height with a dark edge, larger where footprints are far apart.
function drawFootprints({ context, x, y, scale, view }) {
  const half = Math.min(4.5, Math.max(1.5, scale * 30));
  const steps = Array.from({ length: colourSteps }, () => []);
  shots.nearest.within(view.west, view.south, view.east, view.north, (row) => steps[shots.steps[row]].push(row));
  const squares = (rows, side) => {
    for (const row of rows) context.fillRect(x(shots.x[row]) - side, y(shots.y[row]) - side, 2 * side, 2 * side);
  };
  context.fillStyle = '#000';
  for (const rows of steps) squares(rows, half + 1);
  for (const [step, rows] of steps.entries()) {
    context.fillStyle = colours[step];
    squares(rows, half);
  }
}

function drawTies({ context, x, y, view }) {
  for (const [width, colour] of [[4, '#fff'], [2, '#222']]) {
    context.lineWidth = width;
    context.strokeStyle = colour;
    context.beginPath();
    ties.nearest.within(view.west, view.south, view.east, view.north, (tie) => {
      const [at, down] = [x(ties.x[tie]), y(ties.y[tie])];
      context.moveTo(at - 4, down); context.lineTo(at + 4, down);
      context.moveTo(at, down - 4); context.lineTo(at, down + 4);
    });
    context.stroke();
  }
}

const arrowColours = ['#018dff', '#ff610d', '#47a475', '#c84a96', '#452e00', '#c10019'];
const arrowColour = (index) => arrowColours[index % arrowColours.length];

// Residuals of tie points as arrows on the ground, by image; the longest is a thirtieth of the longest image.
function arrowsOf() {
  const { tie, image, residual_east_m: east, residual_north_m: north } = measures;
  let longest = 0;
  for (let row = 0; row < tie.length; row += 1) {
    if (east.has(row)) longest = Math.max(longest, Math.hypot(east.at(row), north.at(row)));
  }
  const length = Math.max(0, ...values.images.map(({ outline_deg: outline }) => {
    const places = outline.map((corner) => placeOf(...corner));
    return places.length ? Math.hypot(places[0][0] - places[places.length >> 1][0], places[0][1] - places[places.length >> 1][1]) : 0;
  }));
  const largest = longest > 0 ? length / 30 / longest : 0;
  const decade = 10 ** Math.floor(Math.log10(largest || 1));
  const times = largest > 0 ? [5, 2, 1].map((lead) => lead * decade).find((lead) => lead <= largest) : 0;
  const draw = ({ context, x, y, view }) => {
    for (const index of values.images.keys()) {
      context.lineWidth = 1.5;
      context.strokeStyle = arrowColour(index);
      context.beginPath();
      for (let row = 0; row < tie.length; row += 1) {
        if (image.numbers[row] !== index || !east.has(row)) continue;
        const at = tie.numbers[row];
        const [west, south] = [ties.x[at], ties.y[at]];
        if (west < view.west || west > view.east || south < view.south || south > view.north) continue;
        const [fromX, fromY] = [x(west), y(south)];
        const [toX, toY] = [x(west + times * east.at(row)), y(south + times * north.at(row))];
        const far = Math.hypot(toX - fromX, toY - fromY);
        if (far < 1) continue;
        const [right, down] = [(toX - fromX) / far, (toY - fromY) / far];
        const head = Math.min(5, far / 2);
        context.moveTo(fromX, fromY);
        context.lineTo(toX, toY);
        context.lineTo(toX - head * (right + 0.5 * down), toY - head * (down - 0.5 * right));
        context.moveTo(toX, toY);
        context.lineTo(toX - head * (right - 0.5 * down), toY - head * (down + 0.5 * right));
      }
      context.stroke();
    }
  };
  return { times, draw };
}
