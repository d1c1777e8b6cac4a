// The graph of a profile: footprints, the terrain model and tie points beside the track, by distance along the track.

// Tie points up to this distance from a footprint of the profile are drawn, metres.
const corridorM = 500;
const margins = { left: 62, right: 12, top: 12, bottom: 40 };

function makeGraph(choose, onProfile) {
  const canvas = byId('graph');
  const select = byId('profile');
  const tip = tipIn(canvas.parentElement);
  canvas.parentElement.style.position = 'relative';
  const state = { profile: -1, at: -1, tie: -1, from: 0, to: 1 };
  let shown = null;

  const withFootprints = profileRows.map((rows, profile) => ({ rows, profile })).filter(({ rows }) => rows.length);
  select.append(...withFootprints.map(({ profile }) => new Option(values.profiles[profile], profile)));

  const frame = () => {
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const [right, bottom] = [width - margins.right, height - margins.bottom];
    const { from, to } = state;
    const [low, high] = shown.range(from, to);
    return {
      width, height, right, bottom, low, high,
      x: (km) => margins.left + ((km - from) / (to - from)) * (right - margins.left),
      y: (metres) => bottom - ((metres - low) / (high - low)) * (bottom - margins.top),
      km: (x) => from + ((x - margins.left) / (right - margins.left)) * (to - from),
    };
  };

  const draw = () => {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    canvas.width = canvas.clientWidth * ratio;
    canvas.height = canvas.clientHeight * ratio;
    if (!shown) return;
    const context = canvas.getContext('2d');
    context.scale(ratio, ratio);
    const of = { context, ...frame() };
    drawAxes(of, state);
    context.save();
    context.beginPath();
    context.rect(margins.left, margins.top - 6, of.right - margins.left + 6, of.bottom - margins.top + 12);
    context.clip();
    drawSeries(of, shown, state);
    context.restore();
  };
  let waiting = 0;
  const soon = () => {
    waiting ||= requestAnimationFrame(() => { waiting = 0; draw(); });
  };

  const view = (profile) => {
    Object.assign(state, { profile, at: -1 });
    shown = profileOf(profile);
    [state.from, state.to] = [0, Math.max(shown.km.at(-1), 0.1)];
    select.value = profile;
    current.profile = profile;
    onProfile();
    canvas.setAttribute('aria-valuemax', shown.rows.length);
    byId('profile-words').textContent = shown.words;
    soon();
  };

  // Keeps the chosen footprint in view.
  const follow = () => {
    const km = shown.km[state.at];
    const length = state.to - state.from;
    if (km < state.from || km > state.to) [state.from, state.to] = [km - length / 2, km + length / 2];
  };
  const announce = () => {
    const row = shown.rows[state.at];
    canvas.setAttribute('aria-valuenow', state.at + 1);
    canvas.setAttribute('aria-valuetext', shotWords(row));
  };
  const go = (at) => {
    if (!shown) return;
    state.at = Math.min(shown.rows.length - 1, Math.max(0, at));
    follow();
    choose({ shot: shown.rows[state.at] });
  };
  const zoom = (times, middle) => {
    if (!shown) return;
    const whole = Math.max(shown.km.at(-1), 0.1);
    const length = Math.min(whole, Math.max(0.5, (state.to - state.from) / times));
    const about = middle ?? (state.at >= 0 ? shown.km[state.at] : (state.from + state.to) / 2);
    const share = (about - state.from) / (state.to - state.from);
    const from = Math.min(whole - length, Math.max(0, about - share * length));
    [state.from, state.to] = [from, from + length];
    soon();
  };

  const keys = {
    ArrowLeft: () => go(state.at - 1), ArrowRight: () => go(state.at + 1),
    ArrowDown: () => go(state.at - 1), ArrowUp: () => go(state.at + 1),
    PageDown: () => go(state.at - 10), PageUp: () => go(state.at + 10),
    Home: () => go(0), End: () => go(Infinity),
    '+': () => zoom(2), '=': () => zoom(2), '-': () => zoom(0.5),
  };
  canvas.addEventListener('keydown', (event) => {
    const act = !event.ctrlKey && !event.metaKey && !event.altKey && keys[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
  canvas.addEventListener('wheel', (event) => {
    // Only after the graph was entered: the page scrolls otherwise.
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    zoom(event.deltaY < 0 ? 1.25 : 0.8, frame().km(event.offsetX));
  }, { passive: false });
  canvas.addEventListener('pointermove', (event) => {
    if (!shown) return;
    const of = frame();
    const tie = shown.tieAt(of, event.offsetX, event.offsetY);
    const at = shown.at(of.km(event.offsetX));
    if (at < 0) return;
    const words = tie >= 0 ? tieWords(tie) : shotWords(shown.rows[at]);
    if (tie < 0) state.at = at;
    tip.show(words, { x: canvas.offsetLeft + event.offsetX, y: canvas.offsetTop + event.offsetY });
    choose(tie >= 0 ? { tie } : { shot: shown.rows[at] });
  });
  canvas.addEventListener('pointerleave', () => tip.hide());
  select.addEventListener('change', () => view(Number(select.value)));
  byId('nearer').addEventListener('click', () => zoom(2));
  byId('farther').addEventListener('click', () => zoom(0.5));
  addEventListener('resize', soon);

  if (withFootprints.length) {
    // A profile on the terrain model where there is one, with the most footprints in the first image; the longest of these.
    const [image] = registered;
    const inImage = new Map();
    image?.footprint.numbers.forEach((shot, at) => {
      const profile = shots.profile.numbers[shot];
      if (image.inside.numbers[at]) inImage.set(profile, (inImage.get(profile) ?? 0) + 1);
    });
    const onTerrain = withFootprints.filter(({ profile }) => terrain.some((line) => line.profile === profile));
    const worth = ({ rows, profile }) => 1e6 * (inImage.get(profile) ?? 0) + rows.length;
    const first = (onTerrain.length ? onTerrain : withFootprints).reduce((best, of) => (worth(of) > worth(best) ? of : best));
    view(first.profile);
  } else byId('profile-words').textContent = 'The site has no footprints.';
  return {
    show({ shot = -1, tie = -1 }, isRemote) {
      state.tie = tie;
      if (isRemote) tip.hide();
      if (shot >= 0) {
        const profile = shots.profile.numbers[shot];
        if (isRemote && profile !== state.profile && profileRows[profile]) view(profile);
        state.at = profile === state.profile ? shown.rows.indexOf(shot) : -1;
        if (state.at >= 0) { follow(); announce(); }
      }
      soon();
    },
    redraw: soon,
  };
}

// A profile with its terrain line and the tie points beside it.
function profileOf(profile) {
  const rows = profileRows[profile];
  const km = [0];
  const radius = values.map.radius_m;
  for (let at = 1; at < rows.length; at += 1) {
    const [from, to] = [rows[at - 1], rows[at]];
    const latitude = shots.latitude_deg.at(to) * degree;
    const east = wrapped(shots.longitude_deg.at(to) - shots.longitude_deg.at(from)) * degree * Math.cos(latitude);
    const north = (shots.latitude_deg.at(to) - shots.latitude_deg.at(from)) * degree;
    km.push(km[at - 1] + (radius * Math.hypot(east, north)) / 1000);
  }
  const line = terrain.find((of) => of.profile === profile);
  const model = [];
  for (let at = 0; line && at < line.heights_m.length; at += 1) {
    const [first, share] = [line.first + Math.floor(at / line.steps), (at % line.steps) / line.steps];
    const along = km[first] + share * ((km[first + 1] ?? km[first]) - km[first]);
    model.push([along, line.heights_m.at(at)]);
  }
  const beside = tiesBeside(rows, km);
  const words = [
    `Heights above the ${values.areoid}. Dots: ${values.altimeter} footprints (${rows.length})`,
    model.length ? 'line: terrain model' : '',
    beside.length ? `crosses: ${beside.length} tie points up to ${corridorM} m from a footprint` : '',
  ].filter(Boolean).join('; ');
  const all = [...rows.map((row, at) => [km[at], shots.topography_m.at(row)]), ...model, ...beside.map((tie) => [tie.km, tie.height])];
  return {
    rows, km, model, beside, words: `${words}.`,
    // The footprint nearest to a distance.
    at(where) {
      let [low, high] = [0, km.length - 1];
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (km[middle] > where) high = middle; else low = middle;
      }
      return km.length && Math.abs(km[low] - where) < Math.abs(km[high] - where) ? low : high;
    },
    tieAt({ x, y }, right, down) {
      const found = beside.find((tie) => Math.hypot(x(tie.km) - right, y(tie.height) - down) < 6);
      return found ? found.tie : -1;
    },
    range(from, to) {
      let [low, high] = [Infinity, -Infinity];
      for (const [where, height] of all) {
        if (where < from || where > to || Number.isNaN(height)) continue;
        low = Math.min(low, height);
        high = Math.max(high, height);
      }
      if (low > high) return [0, 1];
      const room = Math.max(0.08 * (high - low), 1);
      return [low - room, high + room];
    },
  };
}

// Tie points near footprints, with distance along the track and height above the areoid between two footprints.
function tiesBeside(rows, km) {
  const at = (column) => Float64Array.from(rows, (row) => column[row]);
  const nearest = new Nearest(at(shots.x), at(shots.y));
  const beside = [];
  for (let tie = 0; tie < ties.ids.length; tie += 1) {
    const place = nearest.at(ties.x[tie], ties.y[tie], corridorM);
    if (place < 0) continue;
    const [from, to] = place + 1 < rows.length ? [place, place + 1] : [Math.max(0, place - 1), place];
    const [start, end] = [rows[from], rows[to]];
    const [east, north] = [shots.x[end] - shots.x[start], shots.y[end] - shots.y[start]];
    const along = (ties.x[tie] - shots.x[start]) * east + (ties.y[tie] - shots.y[start]) * north;
    const share = along / Math.max(east * east + north * north, 1e-9);
    const areoid = [start, end].map((row) => shots.areoid_radius_m.at(row));
    const height = ties.radius_m.at(tie) - areoid[0] - share * (areoid[1] - areoid[0]);
    beside.push({ tie, km: km[from] + share * (km[to] - km[from]), height });
  }
  return beside;
}

function roundSteps(low, high, most) {
  const rough = (high - low) / most;
  const decade = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((lead) => lead * decade).find((lead) => lead >= rough);
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const steps = [];
  for (let at = Math.ceil(low / step); at * step <= high; at += 1) steps.push([at * step, withMinus((at * step).toFixed(decimals))]);
  return steps;
}

function drawAxes({ context, x, y, right, bottom, low, high, height }, { from, to }) {
  context.font = '12px system-ui, sans-serif';
  context.strokeStyle = themed('--grid');
  context.fillStyle = themed('--ink');
  context.lineWidth = 1;
  context.beginPath();
  context.textAlign = 'right';
  for (const [value, words] of roundSteps(low, high, 6)) {
    context.moveTo(margins.left, y(value));
    context.lineTo(right, y(value));
    context.fillText(words, margins.left - 6, y(value) + 4);
  }
  context.textAlign = 'center';
  for (const [value, words] of roundSteps(from, to, Math.max(2, right / 90))) {
    context.moveTo(x(value), margins.top);
    context.lineTo(x(value), bottom);
    context.fillText(words, x(value), bottom + 16);
  }
  context.stroke();
  context.fillText('distance along the profile, km', (margins.left + right) / 2, height - 6);
  context.save();
  context.translate(14, (margins.top + bottom) / 2);
  context.rotate(-Math.PI / 2);
  context.fillText(`above the ${values.areoid}, m`, 0, 0);
  context.restore();
  context.textAlign = 'left';
}

function drawSeries({ context, x, y, low, high }, { rows, km, model, beside }, { at, tie }) {
  context.lineWidth = 1.5;
  context.strokeStyle = themed('--c2');
  context.beginPath();
  let isOn = false;
  for (const [along, height] of model) {
    if (Number.isNaN(height)) { isOn = false; continue; }
    context[isOn ? 'lineTo' : 'moveTo'](x(along), y(height));
    isOn = true;
  }
  context.stroke();
  context.strokeStyle = themed('--c1');
  context.beginPath();
  for (const of of beside) {
    const [right, down] = [x(of.km), y(of.height)];
    context.moveTo(right - 3.5, down - 3.5); context.lineTo(right + 3.5, down + 3.5);
    context.moveTo(right - 3.5, down + 3.5); context.lineTo(right + 3.5, down - 3.5);
  }
  context.stroke();
  context.fillStyle = themed('--c0');
  for (let place = 0; place < rows.length; place += 1) {
    context.fillRect(x(km[place]) - 2, y(shots.topography_m.at(rows[place])) - 2, 4, 4);
  }
  if (at >= 0) {
    context.strokeStyle = themed('--soft');
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(x(km[at]), y(low));
    context.lineTo(x(km[at]), y(high));
    context.stroke();
    ring(context, x(km[at]), y(shots.topography_m.at(rows[at])), 6, '#c10019');
  }
  const chosen = beside.find((of) => of.tie === tie);
  if (chosen) ring(context, x(chosen.km), y(chosen.height), 6, '#c10019');
}
