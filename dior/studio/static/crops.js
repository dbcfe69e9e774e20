// Enlarged pieces of several pictures at once, with a skeleton over each. Pixels are as recorded: (0, 0) is the centre of
// the top-left one.

import { svg } from "./studio.js";

const FEWEST_PX = 24; // of a piece
const AROUND = 1.3; // a piece is that much larger than the person

export class Crops {
  /** In an element. `onPick(picture)` when a piece is clicked or pressed, if it is given. */
  constructor(place, { onPick = null } = {}) {
    Object.assign(this, { place, onPick, factor: 1, pieces: [] });
  }

  /** `pictures`: {walk, camera, frame, version, crop, box?}, their size in pixels; `name(picture)` is written on each. */
  open(pictures, { width, height }, name) {
    this.pieces = pictures.map((picture) => {
      const query = new URLSearchParams({ walk: picture.walk, camera: picture.camera, frame: picture.frame, v: picture.version });
      const layer = svg("svg", { "aria-hidden": "true" });
      const layers = Object.fromEntries(["middle", "left", "right"].map((side) => [side, svg("path", { class: `shape crop ${side}` })]));
      layer.append(svg("image", { href: `/picture?${query}`, x: -0.5, y: -0.5, width, height }));
      if (picture.box) {
        const [u, v, right, below] = picture.box;
        layer.append(svg("rect", { x: u, y: v, width: right - u, height: below - v, class: "shape crop boxed" }));
      }
      layer.append(...Object.values(layers));
      return { picture, layer, layers };
    });
    this.place.replaceChildren(...this.pieces.map(({ picture, layer }) => {
      const words = document.createElement("span");
      words.textContent = name(picture);
      const piece = document.createElement(this.onPick ? "button" : "div");
      piece.className = "piece";
      piece.append(layer, words);
      if (this.onPick) Object.assign(piece, { type: "button", onclick: () => this.onPick(picture) });
      return piece;
    }));
    this.zoom(1);
  }

  zoom(factor) {
    this.factor = Math.min(16, Math.max(0.1, this.factor * factor));
    for (const { picture, layer } of this.pieces) {
      const [u, v, right, below] = picture.crop;
      const side = Math.max(FEWEST_PX, AROUND * Math.max(right - u, below - v)) / this.factor;
      layer.setAttribute("viewBox", `${(u + right - side) / 2} ${(v + below - side) / 2} ${side} ${side}`);
    }
  }

  /** `skeletons`: of each picture {left, right, middle}, each a list of bones (u, v, u, v). */
  draw(skeletons) {
    this.pieces.forEach(({ layers }, i) => {
      for (const [side, path] of Object.entries(layers)) {
        path.setAttribute("d", (skeletons[i]?.[side] ?? []).map(([a, b, c, d]) => `M${a} ${b}L${c} ${d}`).join(""));
      }
    });
  }
}

/** Calls `ask(wanted)` and then `use(answer, wanted)`, one at a time; of what is wanted meanwhile only the last. */
export function latest(ask, use) {
  let next = null;
  let busy = false;
  return async (wanted) => {
    next = { wanted };
    if (busy) return;
    busy = true;
    try {
      while (next) {
        const { wanted: one } = next;
        next = null;
        use(await ask(one), one);
      }
    } finally {
      busy = false;
    }
  };
}

/** While the button or the key is held, `act(true)`, then `act(false)`. `key` is upper or lower case. */
export function whileHeld(button, key, act) {
  let held = false;
  const set = (to) => {
    if (held === to) return;
    held = to;
    button.setAttribute("aria-pressed", String(to));
    act(to);
  };
  button.setAttribute("aria-pressed", "false");
  button.addEventListener("pointerdown", () => set(true));
  for (const end of ["pointerup", "pointerleave", "pointercancel", "blur"]) button.addEventListener(end, () => set(false));
  button.addEventListener("keydown", (event) => { if (event.key === " " || event.key === "Enter") { event.preventDefault(); set(true); } });
  document.addEventListener("keyup", (event) => { if ([key, " ", "enter"].includes(event.key.toLowerCase())) set(false); });
  window.addEventListener("blur", () => set(false));
  return () => set(true);
}
