// Layers of Leaflet: pictures with tiles, and drawings on a canvas.

// A picture: one file, or an overview and the tiles in view when they show more.
const Picture = L.Layer.extend({
  // `boundsOf` gives the bounds of rows and columns; a pixel of the picture is `pixel` units of the map wide.
  initialize(layer, boundsOf, pixel, pane) {
    Object.assign(this, { layer, boundsOf, pixel, pane, shown: new Map() });
  },

  onAdd(map) {
    this.map = map;
    this.show(this.layer.parts[0]);
    map.on('moveend zoomend resize', this.update, this);
    this.update();
  },

  onRemove(map) {
    map.off('moveend zoomend resize', this.update, this);
    for (const image of this.shown.values()) image.remove();
    this.shown.clear();
  },

  show(part) {
    if (this.shown.has(part.file)) return;
    const bounds = this.boundsOf(part.rows, part.columns);
    const image = L.imageOverlay(`explore/${part.file}`, bounds, { pane: this.pane, alt: '' });
    this.shown.set(part.file, image.addTo(this.map));
  },

  update() {
    const [overview, ...tiles] = this.layer.parts;
    const step = Math.max(overview.rows[1], overview.columns[1]) / 1024;
    const isFiner = 2 ** this.map.getZoom() * this.pixel * step > 1;
    const view = this.map.getBounds();
    for (const tile of tiles) {
      const isSeen = isFiner && view.intersects(this.boundsOf(tile.rows, tile.columns));
      if (isSeen) this.show(tile);
      else if (this.shown.has(tile.file)) {
        this.shown.get(tile.file).remove();
        this.shown.delete(tile.file);
      }
    }
  },
});

// A canvas over the view, drawn again when the view changes.
const Drawing = L.Layer.extend({
  initialize(draw) { this.draw = draw; },

  onAdd(map) {
    this.map = map;
    this.canvas = L.DomUtil.create('canvas', 'drawing', map.getPane('overlayPane'));
    map.on('move zoom viewreset resize', this.soon, this);
    this.soon();
  },

  onRemove(map) {
    map.off('move zoom viewreset resize', this.soon, this);
    this.canvas.remove();
  },

  soon() {
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => { this.waiting = 0; this.now(); });
  },

  now() {
    const { map, canvas } = this;
    const size = map.getSize();
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    L.DomUtil.setPosition(canvas, map.containerPointToLayerPoint([0, 0]));
    canvas.width = size.x * ratio;
    canvas.height = size.y * ratio;
    canvas.style.width = `${size.x}px`;
    canvas.style.height = `${size.y}px`;
    const context = canvas.getContext('2d');
    context.scale(ratio, ratio);
    // A place on the map as a place on the canvas: both axes are even.
    const scale = 2 ** map.getZoom();
    const origin = map.latLngToContainerPoint([0, 0]);
    const x = (east) => origin.x + scale * east;
    const y = (north) => origin.y - scale * north;
    const [west, north] = [-origin.x / scale, origin.y / scale];
    const view = { west, north, east: west + size.x / scale, south: north - size.y / scale };
    this.draw({ context, x, y, scale, size, view });
  },
});

// A map of Leaflet for even coordinates; y is latitude, x is longitude.
function evenMap(id, options) {
  const map = L.map(id, {
    crs: L.CRS.Simple,
    attributionControl: false,
    zoomAnimation: false,
    fadeAnimation: false,
    inertia: !matchMedia('(prefers-reduced-motion: reduce)').matches,
    zoomSnap: 0.25,
    zoomDelta: 1,
    wheelPxPerZoomLevel: 90,
    minZoom: -20,
    maxZoom: 6,
    ...options,
  });
  map.getContainer().tabIndex = 0;
  return map;
}

// A label that follows the pointer in a stage.
function tipIn(stage) {
  const tip = document.createElement('div');
  tip.className = 'tip';
  tip.hidden = true;
  stage.append(tip);
  return {
    show(words, { x, y }) {
      tip.textContent = words;
      tip.hidden = false;
      const [right, below] = [x + 14 + tip.offsetWidth > stage.clientWidth, y + 14 + tip.offsetHeight > stage.clientHeight];
      tip.style.left = `${Math.max(0, right ? x - 10 - tip.offsetWidth : x + 14)}px`;
      tip.style.top = `${Math.max(0, below ? y - 10 - tip.offsetHeight : y + 14)}px`;
    },
    hide() { tip.hidden = true; },
  };
}

// Marks: a ring with a light and a dark edge, seen on any ground.
function ring(context, x, y, radius, colour) {
  for (const [width, stroke] of [[5, '#fff'], [2.5, colour]]) {
    context.lineWidth = width;
    context.strokeStyle = stroke;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.stroke();
  }
}
