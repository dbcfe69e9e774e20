// A picture of a recording that is zoomed and moved, with what is drawn on it. (u, v) are pixels as recorded: (0, 0) is
// the centre of the top-left one.

import { awaited, svg } from "./studio.js";

export class Picture {
  /** In an element. `onClick(u, v, event)`; `onDrag([u, v], [u, v], done)` where `this.drags` is true. */
  constructor(place, { onClick = null, onDrag = null } = {}) {
    this.place = place;
    this.shapes = [];
    this.drags = false;
    this.recording = null;
    this.wanted = null;
    this.shown = null;
    this.loading = false;
    this.viewer = OpenSeadragon({
      element: place, drawer: "canvas", preserveViewport: true, showNavigationControl: false, maxZoomPixelRatio: 32,
      minZoomImageRatio: 0.8, visibilityRatio: 0.3, animationTime: 0, springStiffness: 100, imageSmoothingEnabled: false, zoomPerScroll: 1.25,
      gestureSettingsMouse: { clickToZoom: false, dblClickToZoom: false, flickEnabled: false },
      gestureSettingsTouch: { clickToZoom: false, dblClickToZoom: false },
    });
    // what is shown while one moves through the recording lies over the viewer, whose own pictures take longer to appear
    this.preview = new Image();
    this.preview.className = "preview";
    this.preview.alt = "";
    this.preview.hidden = true;
    place.append(this.preview);
    this.layer = svg("svg", { "aria-hidden": "true" });
    place.append(this.layer);
    this.viewer.addHandler("update-viewport", () => this.redraw());
    this.viewer.addHandler("canvas-key", (event) => { event.preventDefaultAction = true; });
    this.viewer.addHandler("canvas-click", (event) => {
      if (event.quick && this.recording && onClick) onClick(...this.at(event.position), event.originalEvent);
    });
    this.viewer.addHandler("canvas-drag", (event) => {
      if (!this.drags || !this.recording) return;
      event.preventDefaultAction = true;
      // the first of these events comes when the pointer has moved already
      this.dragged ??= this.at(event.position.minus(event.delta));
      onDrag(this.dragged, this.at(event.position), false);
    });
    this.viewer.addHandler("canvas-drag-end", (event) => {
      if (!this.dragged) return;
      const from = this.dragged;
      this.dragged = null;
      onDrag(from, this.at(event.position), true);
    });
  }

  /** Show pictures of another camera or walk. `recording`: what /api/recording says, with walk and camera. */
  open(recording) {
    this.recording = recording;
    this.viewer.world.removeAll();
    this.preview.hidden = true;
    this.shown = null;
    this.wanted = null;
    this.fitted = false;
    delete this.place.dataset.frame;
  }

  address(frame, small) {
    const { walk, camera, version } = this.recording;
    return `/picture?${new URLSearchParams({ walk, camera, frame, small: small ? 1 : 0, v: version })}`;
  }

  /** Show a frame. While one moves through the recording (`moving`) small ones come, and the whole one when it stops. */
  show(frame, moving = false) {
    this.wanted = { frame, small: moving, recording: this.recording };
    clearTimeout(this.resting);
    if (moving) this.resting = setTimeout(() => this.show(frame), 180);
    return this.load();
  }

  // the last one that is wanted is loaded, those that were passed over meanwhile are not
  async load() {
    if (this.loading) return this.loading;
    this.loading = this.loadAll();
    await this.loading;
    this.loading = null;
  }

  async loadAll() {
    while (this.wanted && this.wanted !== this.shown) {
      const now = this.wanted;
      const image = new Image();
      image.src = this.address(now.frame, now.small);
      const there = await awaited(image.decode()).then(() => true, () => false);
      if (now.recording !== this.recording) continue;
      if (there && now.small && this.fitted) this.preview.src = image.src;
      else if (there) await this.put(image.src);
      this.preview.hidden = !(there && now.small && this.fitted);
      this.shown = now;
      this.place.dataset.frame = there ? now.frame : "none";
      this.place.dataset.small = now.small;
      this.redraw();
      this.onShown?.(now.frame, now.small, there);
    }
  }

  put(url) {
    const old = this.viewer.world.getItemAt(0);
    return new Promise((done) => {
      this.viewer.addTiledImage({
        tileSource: { type: "image", url, buildPyramid: false }, x: 0, y: 0, width: 1, index: 0, replace: Boolean(old),
        success: () => {
          if (!this.fitted) this.whole();
          this.fitted = true;
          done();
        },
        error: done,
      });
    });
  }

  /** Ask for a picture that will be shown soon. */
  prefetch(frame) {
    new Image().src = this.address(frame, false);
  }

  /** The pixel at a place of the element. */
  at(position) {
    const point = this.viewer.viewport.pointFromPixel(new OpenSeadragon.Point(position.x, position.y), true);
    return [point.x * this.recording.width - 0.5, point.y * this.recording.width - 0.5];
  }

  /** The place in the element of a pixel. */
  place_of(u, v) {
    const { width } = this.recording;
    const point = this.viewer.viewport.pixelFromPoint(new OpenSeadragon.Point((u + 0.5) / width, (v + 0.5) / width), true);
    return [point.x, point.y];
  }

  /** Pixels of the screen that a pixel of the picture is wide. */
  get scale() {
    return (this.viewer.viewport.getZoom(true) * this.place.clientWidth) / this.recording.width;
  }

  whole() {
    if (!this.recording) return;
    const { width, height } = this.recording;
    this.viewer.viewport.fitBounds(new OpenSeadragon.Rect(0, 0, 1, height / width), true);
  }

  zoom(factor) {
    if (!this.fitted) return;
    this.viewer.viewport.zoomBy(factor, null, true).applyConstraints(true);
  }

  /** Bring a pixel into the middle, at `scale` screen pixels a pixel, or as it is. */
  look(u, v, scale = null) {
    if (!this.recording) return;
    const { width } = this.recording;
    const point = new OpenSeadragon.Point((u + 0.5) / width, (v + 0.5) / width);
    if (scale) this.viewer.viewport.zoomTo((scale * width) / this.place.clientWidth, null, true);
    this.viewer.viewport.panTo(point, true).applyConstraints(true);
  }

  /** Draw `this.shapes`: {kind, ...} with kind line (u, v, to), dot (u, v, r), ring, cross, box (u, v, to), ellipse (u, v,
   * a, b, turn), text (u, v, text); `class` for its colour. Sizes of dots are the screen's, of ellipses and boxes the
   * picture's. */
  redraw() {
    if (!this.recording || !this.viewer.viewport) return;
    const scale = this.scale;
    if (!this.preview.hidden) {
      const [x, y] = this.place_of(-0.5, -0.5);
      Object.assign(this.preview.style, { left: `${x}px`, top: `${y}px`, width: `${scale * this.recording.width}px` });
    }
    this.layer.replaceChildren(...this.shapes.map((shape) => drawn(shape, (u, v) => this.place_of(u, v), scale)));
  }
}

function drawn(shape, place_of, scale) {
  const [x, y] = place_of(shape.u, shape.v);
  const kinds = {
    line: () => { const [x2, y2] = place_of(...shape.to); return ["line", { x1: x, y1: y, x2, y2 }]; },
    dot: () => ["circle", { cx: x, cy: y, r: shape.r ?? 3 }],
    ring: () => ["circle", { cx: x, cy: y, r: shape.r ?? 8, fill: "none" }],
    cross: () => { const r = shape.r ?? 6; return ["path", { d: `M${x - r} ${y}H${x + r}M${x} ${y - r}V${y + r}` }]; },
    box: () => {
      const [x2, y2] = place_of(...shape.to);
      return ["rect", { x: Math.min(x, x2), y: Math.min(y, y2), width: Math.abs(x2 - x), height: Math.abs(y2 - y), fill: "none" }];
    },
    ellipse: () => ["ellipse", { rx: shape.a * scale, ry: shape.b * scale, transform: `translate(${x} ${y}) rotate(${shape.turn})`, fill: "none" }],
    text: () => ["text", { x: x + (shape.dx ?? 8), y: y + (shape.dy ?? -6) }],
  };
  const [name, attributes] = kinds[shape.kind]();
  return svg(name, { ...attributes, class: `shape ${shape.kind} ${shape.class ?? ""}` }, shape.kind === "text" ? shape.text : null);
}
