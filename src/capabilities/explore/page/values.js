// Values of the page: columns of whole numbers, decoded on first use.
const values = JSON.parse(document.getElementById('values').textContent);
const missing = -2147483648;
const byId = (id) => document.getElementById(id);
const withMinus = (text) => text.replace('-', '−');
const plural = (count, what) => `${count} ${what}${count === 1 ? '' : 's'}`;
// The profile of the graph, which other parts also mark.
const current = { profile: -1 };

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let at = 0; at < text.length; at += 1) bytes[at] = text.charCodeAt(at);
  return bytes.buffer;
}

// A column: whole numbers of the last decimal.
class Column {
  constructor({ decimals, base64 }) {
    this.decimals = decimals;
    this.numbers = new Int32Array(bytesOf(base64));
    this.scale = 10 ** decimals;
  }

  get length() { return this.numbers.length; }

  // A column without any value is empty.
  has(row) { return row < this.numbers.length && this.numbers[row] !== missing; }

  // NaN where the value is missing.
  at(row) { return this.has(row) ? this.numbers[row] / this.scale : NaN; }

  // The value with all its decimals, without another rounding.
  text(row) { return this.has(row) ? decimal(this.numbers[row], this.decimals) : '–'; }
}

function decimal(whole, decimals) {
  const digits = String(Math.abs(whole)).padStart(decimals + 1, '0');
  const sign = whole < 0 ? '−' : '';
  const split = digits.length - decimals;
  return sign + digits.slice(0, split) + (decimals ? `.${digits.slice(split)}` : '');
}

const isColumn = (value) => value && typeof value === 'object' && 'base64' in value;
function columns(of) {
  const made = {};
  for (const [name, value] of Object.entries(of)) {
    if (isColumn(value)) made[name] = new Column(value);
    else if (Array.isArray(value) && value.length && value.every(isColumn)) made[name] = value.map((one) => new Column(one));
    else made[name] = value;
  }
  return made;
}

const shots = columns(values.footprints);
shots.instants = new BigInt64Array(bytesOf(values.footprints.utc));
const ties = columns(values.ties);
const measures = columns(values.measures);
const registered = values.registered.map(columns);
const terrain = values.terrain.map(columns);

// UTC to the microsecond, as in the tables.
function utcOf(row) {
  const instant = shots.instants[row];
  const millisecond = instant / 1000n - (instant % 1000n < 0n ? 1n : 0n);
  const text = new Date(Number(millisecond)).toISOString().slice(0, -1);
  return text + String(instant - millisecond * 1000n).padStart(3, '0');
}

// East and north of the middle of the map in metres; see frame.rs.
const degree = Math.PI / 180;
const wrapped = (degrees) => degrees - 360 * Math.round(degrees / 360);
function placeOf(longitudeDeg, latitudeDeg) {
  const { middle_deg: middle, parallel_deg: parallel, radius_m: radius, polar } = values.map;
  const east = wrapped(longitudeDeg - middle[0]) * degree;
  if (polar) {
    const far = radius * (90 - Math.abs(latitudeDeg)) * degree;
    return [far * Math.sin(east), -Math.sign(middle[1]) * far * Math.cos(east)];
  }
  return [radius * Math.cos(parallel * degree) * east, radius * (latitudeDeg - middle[1]) * degree];
}
function placesOf(longitude, latitude) {
  const [x, y] = [new Float64Array(longitude.length), new Float64Array(longitude.length)];
  for (let row = 0; row < x.length; row += 1) [x[row], y[row]] = placeOf(longitude.at(row), latitude.at(row));
  return { x, y };
}

// Places of points in cells of an even grid: the nearest one is found among few.
class Nearest {
  constructor(x, y) {
    Object.assign(this, { x, y });
    let [west, east, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
    for (let at = 0; at < x.length; at += 1) {
      west = Math.min(west, x[at]); east = Math.max(east, x[at]);
      south = Math.min(south, y[at]); north = Math.max(north, y[at]);
    }
    Object.assign(this, { west, south, east, north });
    const across = Math.max(1, Math.ceil(Math.sqrt(x.length)));
    this.across = across;
    this.cell = Math.max((east - west) / across, (north - south) / across, 1e-6);
    this.starts = new Int32Array(across * across + 1);
    this.points = new Int32Array(x.length);
    const cells = new Int32Array(x.length);
    for (let at = 0; at < x.length; at += 1) {
      cells[at] = this.row(y[at]) * across + this.column(x[at]);
      this.starts[cells[at] + 1] += 1;
    }
    for (let cell = 0; cell < across * across; cell += 1) this.starts[cell + 1] += this.starts[cell];
    const next = this.starts.slice();
    for (let at = 0; at < x.length; at += 1) this.points[next[cells[at]]++] = at;
  }

  held(cell) { return Math.min(this.across - 1, Math.max(0, Math.floor(cell))); }

  column(x) { return this.held((x - this.west) / this.cell); }

  row(y) { return this.held((y - this.south) / this.cell); }

  // Calls `visit` for the points of all cells that a rectangle touches.
  within(west, south, east, north, visit) {
    if (!this.points.length) return;
    for (let row = this.row(south); row <= this.row(north); row += 1) {
      const from = this.starts[row * this.across + this.column(west)];
      const to = this.starts[row * this.across + this.column(east) + 1];
      for (let at = from; at < to; at += 1) visit(this.points[at]);
    }
  }

  // The nearest point within `reach`, or −1.
  at(x, y, reach) {
    let [found, least] = [-1, reach * reach];
    this.within(x - reach, y - reach, x + reach, y + reach, (point) => {
      const apart = (this.x[point] - x) ** 2 + (this.y[point] - y) ** 2;
      if (apart <= least) [found, least] = [point, apart];
    });
    return found;
  }
}

Object.assign(shots, placesOf(shots.longitude_deg, shots.latitude_deg));
Object.assign(ties, placesOf(ties.longitude_deg, ties.latitude_deg));
shots.nearest = new Nearest(shots.x, shots.y);
ties.nearest = new Nearest(ties.x, ties.y);

// Footprints of every profile, in order.
const profileRows = values.profiles.map(() => []);
for (let row = 0; row < shots.count; row += 1) profileRows[shots.profile.numbers[row]]?.push(row);

// The footprint before each one in its profile, or −1, and the distance from it, metres.
const previous = new Int32Array(shots.count).fill(-1);
// Large sites show every n-th footprint: then the one before is not on the page.
for (const rows of profileRows) rows.forEach((row, at) => {
  if (at && shots.row.numbers[row] - shots.row.numbers[rows[at - 1]] === 1) previous[row] = rows[at - 1];
});
function pointOf(row) {
  const [longitude, latitude] = [shots.longitude_deg.at(row) * degree, shots.latitude_deg.at(row) * degree];
  const radius = shots.ground_radius_m.at(row);
  return [Math.cos(latitude) * Math.cos(longitude), Math.cos(latitude) * Math.sin(longitude), Math.sin(latitude)].map((part) => radius * part);
}
function apartM(from, to) {
  const [one, other] = [pointOf(from), pointOf(to)];
  return Math.hypot(...one.map((part, axis) => part - other[axis]));
}

// Colours of heights in steps; the ends leave out one footprint in fifty on either side.
const colourSteps = 48;
const heights = (() => {
  const sorted = shots.topography_m.numbers.filter((height) => height !== missing).sort();
  if (!sorted.length) return { low: 0, high: 1 };
  const clipped = Math.floor(sorted.length / 50);
  const [low, high] = [sorted[clipped], sorted[sorted.length - 1 - clipped]].map((height) => height / shots.topography_m.scale);
  return { low, high: Math.max(high, low + 0.01) };
})();
function colourOf(share) {
  const ramp = values.colours;
  const place = Math.min(1, Math.max(0, share)) * (ramp.length - 1);
  const below = Math.min(ramp.length - 2, Math.floor(place));
  const mixed = ramp[below].map((from, channel) => Math.round(from + (place - below) * (ramp[below + 1][channel] - from)));
  return `rgb(${mixed.join()})`;
}
const colours = Array.from({ length: colourSteps }, (_, step) => colourOf(step / (colourSteps - 1)));
const stepOf = (row) => {
  const share = (shots.topography_m.at(row) - heights.low) / (heights.high - heights.low);
  return Math.round(Math.min(1, Math.max(0, share)) * (colourSteps - 1));
};
shots.steps = Uint8Array.from({ length: shots.count }, (_, row) => stepOf(row));

// A colour of the style sheet, which follows light and dark.
const themed = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
