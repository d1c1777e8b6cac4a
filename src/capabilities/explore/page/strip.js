// An image in lines and samples, with its footprints, tie points and the elevation profile of the footprints.

// Footprints with a pause of more seconds between them are not joined.
const pauseS = 2;
// The elevation profile takes this share of the width of the image. Of more profiles, only that of the graph is drawn.
const curveShare = 0.25;
const curvesDrawn = 3;

function makeStrip(choose) {
  const select = byId('image');
  const map = evenMap('strip', { maxZoom: 4 });
  const tip = tipIn(map.getContainer().parentElement);
  const toggles = Object.fromEntries(['before', 'after', 'curve', 'distances', 'measured'].map((id) => [id, byId(id)]));
  const state = { shot: -1, tie: -1 };
  let shown = null;
  let picture = null;

  const images = registered.map(stripOf);
  select.append(...images.map(({ id }, at) => new Option(id, at)));
  const drawing = new Drawing((of) => {
    if (!shown) return;
    drawFrame(of, shown);
    if (toggles.before.checked) drawPlaces(of, shown, shown.before, mapBefore);
    if (toggles.after?.checked) drawPlaces(of, shown, shown.after, mapAfter);
    if (toggles.curve.checked) drawCurves(of, shown);
    if (toggles.distances.checked) drawDistances(of, shown);
    if (toggles.measured.checked) drawMeasures(of, shown);
    const { context, x, y } = of;
    const at = shown.rowOf.get(state.shot);
    const place = at === undefined ? shown.measureOf(state.tie) : [shown.latest.sample[at], -shown.latest.line[at]];
    if (place) ring(context, x(place[0]), y(place[1]), 10, '#c10019');
  });
  for (const toggle of Object.values(toggles)) toggle?.addEventListener('change', () => drawing.soon());

  const view = (image, isNew) => {
    shown = image;
    picture?.remove();
    picture = null;
    const { lines, samples } = image;
    if (image.layer) {
      const times = image.layer.reduction;
      const bounds = ([top, bottom], [left, right]) => [[-bottom * times, left * times], [-top * times, right * times]];
      picture = new Picture(image.layer, bounds, times, 'tilePane').addTo(map);
    }
    if (isNew) {
      // Less than half of the stage: there is room beside the image for its profile.
      const zoom = Math.log2((0.45 * map.getSize().x) / samples);
      map.setView([-lines / 2, samples / 2], Math.round(4 * zoom) / 4, { animate: false });
      map.setMaxBounds(L.latLngBounds([-1.2 * lines, -2 * samples], [0.2 * lines, 3 * samples]));
    }
    byId('strip-words').textContent = stripWords(image);
    drawing.soon();
  };
  if (images.length) {
    view(images[0], true);
    drawing.addTo(map);
  } else {
    byId('strip-words').textContent = 'The site has no images.';
    map.setView([0, 0], 0);
  }
  select.addEventListener('change', () => view(images[select.value], true));

  const point = (event, reach) => {
    if (!shown) return;
    const [x, y, near] = [event.latlng.lng, event.latlng.lat, reach / 2 ** map.getZoom()];
    const measure = toggles.measured.checked ? shown.measures.nearest.at(x, y, near) : -1;
    const states = [toggles.after?.checked && shown.after, toggles.before.checked && shown.before].filter(Boolean);
    const row = states.map((of) => of.nearest.at(x, y, near)).find((at) => at >= 0) ?? -1;
    if (measure >= 0) {
      const at = shown.measures.rows[measure];
      tip.show(measureWords(at), event.containerPoint);
      choose({ tie: measures.tie.numbers[at] });
    } else if (row >= 0) {
      const shot = shown.footprint.numbers[row];
      tip.show(shotWords(shot), event.containerPoint);
      choose({ shot });
    } else {
      const place = x >= 0 && y <= 0 && x <= shown.samples && y >= -shown.lines;
      if (place) tip.show(`line ${(-y).toFixed(1)}, sample ${x.toFixed(1)}`, event.containerPoint);
      else tip.hide();
    }
  };
  map.on('mousemove', (event) => point(event, 8));
  map.on('click', (event) => point(event, 16));
  map.on('mouseout', () => tip.hide());

  return {
    show({ shot = -1, tie = -1 }, isRemote) {
      Object.assign(state, { shot, tie });
      drawing.soon();
      if (!isRemote || !shown) return;
      tip.hide();
      const at = shown.rowOf.get(shot);
      const place = at === undefined ? shown.measureOf(tie) : [shown.latest.sample[at], -shown.latest.line[at]];
      if (place && !map.getBounds().contains([place[1], place[0]])) map.panTo([place[1], place[0]], { animate: false });
    },
    redraw: () => drawing.soon(),
    map,
  };
}

// An image with its footprints before and after the adjustment.
function stripOf(of) {
  const { id, lines, samples } = values.images[of.image];
  const state = (line, sample, bit) => {
    const rows = [...line.numbers.keys()].filter((row) => line.has(row) && of.inside.numbers[row] & bit);
    const [x, y] = [rows.map((row) => sample.at(row)), rows.map((row) => -line.at(row))].map((all) => Float64Array.from(all));
    const nearest = new Nearest(x, y);
    // Its points are rows of the table.
    return { rows, x, y, nearest: { at: (...where) => rows[nearest.at(...where)] ?? -1 } };
  };
  const before = state(of.before_line, of.before_sample, 1);
  const after = state(of.adjusted_line, of.adjusted_sample, 2);
  const adjusted = ties.adjusted && after.rows.length > 0;
  const [line, sample] = adjusted ? [of.adjusted_line, of.adjusted_sample] : [of.before_line, of.before_sample];
  const latest = { ...(adjusted ? after : before), line: [], sample: [] };
  const rowOf = new Map();
  for (const row of latest.rows) {
    [latest.line[row], latest.sample[row]] = [line.at(row), sample.at(row)];
    rowOf.set(of.footprint.numbers[row], row);
  }
  const rows = [...measures.tie.numbers.keys()].filter((row) => measures.image.numbers[row] === of.image);
  const [x, y] = [rows.map((row) => measures.sample.at(row)), rows.map((row) => -measures.line.at(row))].map((all) => Float64Array.from(all));
  const placeOfTie = new Map(rows.map((row, at) => [measures.tie.numbers[row], [x[at], y[at]]]));
  return {
    id, lines, samples, before, after, latest, rowOf,
    ...of,
    layer: values.layers.find((layer) => layer.image === of.image),
    measures: { rows, x, y, nearest: new Nearest(x, y) },
    measureOf: (tie) => placeOfTie.get(tie),
    elevation: curvesOf(of, latest, samples),
  };
}

// The elevation profiles of the footprints of an image, beside their tracks, on one scale.
function curvesOf(of, latest, samples) {
  const shotOf = (row) => of.footprint.numbers[row];
  const ground = (row) => shots.topography_m.at(shotOf(row));
  const byProfile = new Map();
  let [low, high] = [Infinity, -Infinity];
  for (const row of latest.rows) {
    const profile = shots.profile.numbers[shotOf(row)];
    if (!byProfile.has(profile)) byProfile.set(profile, []);
    byProfile.get(profile).push(row);
    [low, high] = [Math.min(low, ground(row)), Math.max(high, ground(row))];
  }
  const curves = [...byProfile].map(([profile, rows]) => {
    const mean = rows.reduce((sum, row) => sum + latest.sample[row], 0) / rows.length;
    const away = (mean > samples / 2 ? -1 : 1) * curveShare * samples;
    const points = rows.map((row) => ({
      instant: Number(shots.instants[shotOf(row)]) / 1e6,
      shot: shotOf(row),
      track: [latest.sample[row], -latest.line[row]],
      curve: [latest.sample[row] + (away * (ground(row) - low)) / Math.max(high - low, 0.01), -latest.line[row]],
    }));
    return { profile, points };
  });
  const apart = curves.flatMap(({ points }) => points.slice(1).map(({ track }, at) => Math.abs(track[1] - points[at].track[1])));
  apart.sort((one, other) => one - other);
  return { low, high, curves, spacing: apart[apart.length >> 1] ?? Infinity };
}

function drawFrame({ context, x, y, scale }, { lines, samples }) {
  context.strokeStyle = themed('--soft');
  context.lineWidth = 1;
  context.strokeRect(x(0), y(0), scale * samples, scale * lines);
  // Lines at round intervals.
  const step = [1, 2, 5].flatMap((lead) => [1, 10, 100, 1e3, 1e4].map((decade) => lead * decade)).sort((a, b) => a - b)
    .find((length) => scale * length > 60) ?? 1e5;
  context.font = '12px system-ui, sans-serif';
  context.fillStyle = themed('--ink');
  context.textAlign = 'right';
  for (let line = 0; line <= lines; line += step) context.fillText(String(line), x(0) - 6, y(-line) + 4);
  context.textAlign = 'left';
  context.fillText('line', Math.max(x(0), 4) + 2, Math.max(y(0) - 6, 12));
}

// Rings that leave the image between footprints in sight.
function drawPlaces({ context, x, y, scale, view }, { elevation: { spacing } }, { x: samples, y: lines }, colour) {
  const radius = Math.min(9, Math.max(1.5, scale * Math.min(8, spacing / 3)));
  for (const [width, stroke] of [[3.5, '#fff'], [1.75, colour]]) {
    context.lineWidth = width;
    context.strokeStyle = stroke;
    context.beginPath();
    for (let at = 0; at < samples.length; at += 1) {
      if (lines[at] < view.south || lines[at] > view.north || samples[at] < view.west || samples[at] > view.east) continue;
      context.moveTo(x(samples[at]) + radius, y(lines[at]));
      context.arc(x(samples[at]), y(lines[at]), radius, 0, 2 * Math.PI);
    }
    context.stroke();
  }
}

const isDrawn = (profile, curves) => curves.length <= curvesDrawn || profile === current.profile;

function drawCurves({ context, x, y }, { elevation: { curves } }) {
  for (const { profile, points } of curves) {
    if (!isDrawn(profile, curves)) continue;
    for (const [width, colour, name] of [[1, '#fff', 'track'], [5, '#000', 'curve'], [2.5, '#ffe14d', 'curve']]) {
      context.lineWidth = width;
      context.strokeStyle = colour;
      context.lineJoin = 'round';
      context.beginPath();
      let last = -Infinity;
      for (const point of points) {
        const isNext = point.instant - last < pauseS;
        context[isNext ? 'lineTo' : 'moveTo'](x(point[name][0]), y(point[name][1]));
        last = point.instant;
      }
      context.stroke();
    }
  }
}

// Distances between successive footprints, where there is room for them.
function drawDistances({ context, x, y, size }, { elevation: { curves } }) {
  for (const { profile, points } of curves) {
    if (!isDrawn(profile, curves)) continue;
    for (let at = 1; at < points.length; at += 1) {
      const [from, to] = [points[at - 1], points[at]];
      const [fromY, toY] = [y(from.track[1]), y(to.track[1])];
      const middle = (fromY + toY) / 2;
      // A footprint between them may lie outside the image, or have no place among those of the page.
      if (previous[to.shot] !== from.shot || Math.abs(toY - fromY) < 18 || middle < 0 || middle > size.y) continue;
      const right = Math.max(x(from.track[0]), x(to.track[0]));
      label(context, `${apartM(from.shot, to.shot).toFixed(0)} m`, right + 12, middle + 4);
    }
  }
}

function drawMeasures({ context, x, y, view }, { measures: { x: samples, y: lines } }) {
  for (const [width, colour] of [[3.5, '#fff'], [1.75, '#c84a96']]) {
    context.lineWidth = width;
    context.strokeStyle = colour;
    context.beginPath();
    for (let at = 0; at < samples.length; at += 1) {
      if (lines[at] < view.south || lines[at] > view.north) continue;
      const [right, down] = [x(samples[at]), y(lines[at])];
      context.moveTo(right - 4, down - 4); context.lineTo(right + 4, down + 4);
      context.moveTo(right - 4, down + 4); context.lineTo(right + 4, down - 4);
    }
    context.stroke();
  }
}

function stripWords({ id, lines, samples, before, after, elevation: { low, high, curves }, layer }) {
  const parts = [`${id}: ${lines} lines of ${samples} samples`];
  parts.push(`${plural(before.rows.length, 'footprint')} inside by the kernels${ties.adjusted ? `, ${after.rows.length} after the adjustment` : ''}`);
  if (curves.length) {
    const which = curves.length > curvesDrawn ? 'of the profile in the graph' : 'along the track';
    const [from, to] = [low, high].map((height) => withMinus(height.toFixed(0)));
    parts.push(`yellow: heights ${which}, ${from} m above the ${values.areoid} on the track and ${to} m a quarter of the image beside it`);
  }
  if (!layer) parts.push('the site has no pixels of this image');
  else if (layer.reduction > 1) parts.push(`one pixel of the picture is ${layer.reduction} × ${layer.reduction} pixels of the image`);
  return `${parts.join('; ')}.`;
}
