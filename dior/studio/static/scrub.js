// The bar below a picture: a slider, arrows, the frame's number and time, and the keys for them.

import { onKeys, remember } from "./studio.js";

export class Scrub {
  /** For a `Picture`; `onFrame(frame, moving)` when another frame is wanted; `onKey(key, event)` gets the other keys. */
  constructor(picture, { onFrame = () => {}, onKey = () => false } = {}) {
    this.picture = picture;
    this.onFrame = onFrame;
    for (const id of ["frame", "number", "before", "after", "time"]) this[id] = document.getElementById(id);
    this.frame.addEventListener("input", () => this.go(Number(this.frame.value), true));
    this.frame.addEventListener("change", () => this.go(Number(this.frame.value)));
    this.number.addEventListener("change", () => this.go(Number(this.number.value)));
    this.before.addEventListener("click", () => this.go(this.at - 1));
    this.after.addEventListener("click", () => this.go(this.at + 1));
    onKeys((key, event) => onKey(key, event) || this.key(key, event));
    this.at = 0;
  }

  /** Begin with another recording at a frame. */
  open(recording, frame) {
    this.seconds = recording.seconds;
    this.frame.max = this.number.max = this.seconds.length - 1;
    this.picture.open(recording);
    this.go(frame);
  }

  go(frame, moving = false) {
    if (!this.seconds) return;
    this.at = Math.min(Math.max(0, Math.round(frame) || 0), this.seconds.length - 1);
    if (Number(this.frame.value) !== this.at) this.frame.value = this.at;
    this.number.value = this.at;
    this.time.textContent = `${this.seconds[this.at].toFixed(3)} s of ${this.seconds.at(-1).toFixed(1)}`;
    this.frame.setAttribute("aria-valuetext", `frame ${this.at}, ${this.seconds[this.at].toFixed(3)} s`);
    remember({ frame: this.at });
    this.picture.show(this.at, moving);
    this.onFrame(this.at, moving);
  }

  key(key, event) {
    if (!this.seconds) return false;
    const step = event.shiftKey ? 10 : 1;
    const acts = {
      ArrowLeft: () => this.go(this.at - step, event.repeat),
      ArrowRight: () => this.go(this.at + step, event.repeat),
      Home: () => this.go(0),
      End: () => this.go(this.seconds.length - 1),
      "+": () => this.picture.zoom(1.5),
      "=": () => this.picture.zoom(1.5),
      "-": () => this.picture.zoom(1 / 1.5),
      0: () => this.picture.whole(),
    };
    if (!(key in acts) || event.target === this.frame && key.startsWith("Arrow")) return false;
    acts[key]();
    return true;
  }
}
