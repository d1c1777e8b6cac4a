// The parts of the page, and what is chosen in one of them and shown in all.

function shotWords(row) {
  const profile = values.profiles[shots.profile.numbers[row]] ?? 'no profile';
  return `${profile}, record ${shots.record.text(row)}, shot ${shots.shot.text(row)}: ${shots.topography_m.text(row)} m above the ${values.areoid}`;
}

function tieWords(tie) {
  const above = decimal(ties.radius_m.numbers[tie] - Math.round(values.sphere_m * ties.radius_m.scale), 2);
  return `tie point ${ties.ids[tie]}: ${above} m above the sphere of ${values.sphere_m / 1000} km`;
}

function measureWords(row) {
  const { tie, line, sample, residual_line: along, residual_sample: across } = measures;
  const residual = along.has(row) ? `; residual ${along.text(row)} lines, ${across.text(row)} samples` : '';
  return `tie point ${ties.ids[tie.numbers[row]]}: line ${line.text(row)}, sample ${sample.text(row)}${residual}`;
}

// Names and values of a footprint, as in footprints and registered_footprints.
function shotValues(row) {
  const above = decimal(shots.ground_radius_m.numbers[row] - Math.round(values.sphere_m * shots.ground_radius_m.scale), 2);
  const list = [
    ['profile', values.profiles[shots.profile.numbers[row]] ?? 'none'],
    ['record, shot', `${shots.record.text(row)}, ${shots.shot.text(row)}`],
    ['row in footprints', shots.row.text(row)],
    ['UTC', utcOf(row)],
    ['east longitude', `${shots.longitude_deg.text(row)}°`],
    [`${values.latitude} latitude`, `${shots.latitude_deg.text(row)}°`],
    [`height above the ${values.areoid}`, `${shots.topography_m.text(row)} m`],
    [`height above the sphere of ${values.sphere_m / 1000} km`, `${above} m`],
  ];
  if (previous[row] >= 0) list.push(['distance from the previous footprint', `${apartM(previous[row], row).toFixed(0)} m`]);
  for (const of of registered) {
    const at = of.rowByShot.get(row);
    if (at === undefined) continue;
    const { id } = values.images[of.image];
    const state = (line, sample, bit) => `line ${line.text(at)}, sample ${sample.text(at)}${of.inside.numbers[at] & bit ? '' : ' (outside)'}`;
    list.push([`${id}, kernels`, state(of.before_line, of.before_sample, 1)]);
    if (of.adjusted_line.has(at)) {
      list.push([`${id}, adjusted`, state(of.adjusted_line, of.adjusted_sample, 2)]);
      list.push([`${id}, moved`, `${of.moved_px.text(at)} pixels`]);
    }
    const [east, north, up] = of.sigma_m.map((column) => column.text(at));
    if (of.sigma_m[0].has(at)) list.push([`${id}, σ east, north, height`, `${east}, ${north}, ${up} m`]);
  }
  return { title: `Footprint ${shots.row.text(row)}`, list };
}

function tieValues(tie) {
  const above = decimal(ties.radius_m.numbers[tie] - Math.round(values.sphere_m * ties.radius_m.scale), 2);
  const list = [
    ['east longitude', `${ties.longitude_deg.text(tie)}°`],
    [`${values.latitude} latitude`, `${ties.latitude_deg.text(tie)}°`],
    [`height above the sphere of ${values.sphere_m / 1000} km`, `${above} m`],
  ];
  if (ties.sigma_m[0].has(tie)) list.push(['σ east, north, height', `${ties.sigma_m.map((column) => column.text(tie)).join(', ')} m`]);
  for (let row = 0; row < measures.tie.length; row += 1) {
    if (measures.tie.numbers[row] !== tie) continue;
    const { id } = values.images[measures.image.numbers[row]];
    list.push([`${id}, measured`, `line ${measures.line.text(row)}, sample ${measures.sample.text(row)}`]);
    if (!measures.residual_line.has(row)) continue;
    list.push([`${id}, residual`, `${measures.residual_line.text(row)} lines, ${measures.residual_sample.text(row)} samples`]);
    if (!measures.residual_east_m.has(row)) continue;
    list.push([`${id}, residual on the ground`, `${measures.residual_east_m.text(row)} m east, ${measures.residual_north_m.text(row)} m north`]);
  }
  const state = ties.adjusted ? 'adjusted' : 'intersected with the orientation from the kernels';
  return { title: `Tie point ${ties.ids[tie]}, ${state}`, list };
}

for (const of of registered) of.rowByShot = new Map([...of.footprint.numbers].map((shot, at) => [shot, at]));

const parts = {};
let last = '';
function choose(source, chosen) {
  const key = `${chosen.shot}/${chosen.tie}`;
  if (key === last) return;
  last = key;
  for (const [name, part] of Object.entries(parts)) part.show(chosen, name !== source);
  const { title, list } = chosen.shot >= 0 ? shotValues(chosen.shot) : tieValues(chosen.tie);
  const heading = document.createElement('h3');
  heading.textContent = title;
  const all = document.createElement('dl');
  for (const [name, value] of list) {
    const pair = document.createElement('div');
    const [term, description] = ['dt', 'dd'].map((tag) => document.createElement(tag));
    [term.textContent, description.textContent] = [name, value];
    pair.append(term, description);
    all.append(pair);
  }
  byId('chosen').replaceChildren(heading, all);
}

byId('ramp').style.background = `linear-gradient(to right,${colours.join()})`;
byId('ramp-low').textContent = `${withMinus(heights.low.toFixed(0))} m`;
byId('ramp-high').textContent = `${withMinus(heights.high.toFixed(0))} m above the ${values.areoid}; ${
  shots.count < shots.of ? `${shots.count} of ${plural(shots.of, 'footprint')}` : plural(shots.count, 'footprint')}`;
for (const [id, colour] of [['before', mapBefore], ['after', mapAfter], ['curve', '#ffe14d'], ['measured', '#c84a96'], ['outlines', '#c84a96'], ['windows', '#222'], ['ties', '#222']]) {
  const mark = byId(id)?.parentElement.querySelector('.swatch');
  if (mark) mark.style.background = colour;
}
parts.map = makeMap((chosen) => choose('map', chosen));
parts.strip = makeStrip((chosen) => choose('strip', chosen));
parts.graph = makeGraph((chosen) => choose('graph', chosen), () => parts.strip.redraw());
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => Object.values(parts).forEach((part) => part.redraw()));
