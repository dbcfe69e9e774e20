// Changes on their way into a file, one after the other. What cannot be written is kept, said, and tried again with the
// next change.

import { many, say } from "./studio.js";

export class Writer {
  /**
   * `write(change)`: what the server answers; `written(found, change)` then, or `disputed(found, change)` where somebody
   * else has changed the same. `name(change)`: what it is of, in words. `taken(changes)`: they are given up, and what was
   * before comes back to the page. `shown()`: what is kept has changed.
   */
  constructor(acts) {
    Object.assign(this, acts);
    this.waiting = new Map(); // id -> {id, before, after, ...}, until it is written
    this.last = Promise.resolve();
    addEventListener("beforeunload", (event) => { if (this.kept().length) event.preventDefault(); });
  }

  /** The changes that could not be written. */
  kept() {
    return [...this.waiting.values()].filter((one) => one.failed);
  }

  /** Whether what is on the page at `id` could not be written. */
  keeps(id) {
    return Boolean(this.waiting.get(id)?.failed);
  }

  /** Write `{id, before, after, ...}`, after those that wait. Of one `id` what it was at first and is at last counts. */
  put(change) {
    const there = this.waiting.get(change.id);
    this.waiting.set(change.id, there ? { ...there, ...change, before: there.before } : change);
    return this.again();
  }

  /** Try all that waits. */
  again() {
    this.last = this.last.then(() => this.round());
    return this.last;
  }

  async round() {
    let [why, late] = ["", 0];
    for (const change of [...this.waiting.values()]) {
      const failed = await this.one(change);
      if (failed) why = failed;
      else if (change.failed) late += 1;
    }
    const kept = this.kept();
    if (kept.length) this.told(kept, why || kept[0].failed);
    else if (late && !document.querySelector("#said button")) say("Nothing is left unsaved now.");
    this.shown();
  }

  /** Write one change; why it cannot be, or "". */
  async one(change) {
    let found = null;
    try {
      if (!same(change.before, change.after)) found = await this.write(change);
    } catch (error) {
      if (!error.said) throw error;
      const now = this.waiting.get(change.id);
      if (now) now.failed = error.message;
      return error.message;
    }
    const now = this.waiting.get(change.id);
    // it may have been changed again meanwhile
    if (now === change || found?.conflicts) this.waiting.delete(change.id);
    else if (now) Object.assign(now, { before: change.after, failed: "" });
    if (change.failed) say("");
    if (found?.conflicts) this.disputed(found, change);
    else if (found) this.written(found, change);
    return "";
  }

  told(kept, why) {
    const names = kept.slice(-3).map(this.name);
    if (kept.length > names.length) names.unshift(many(kept.length - names.length, "other"));
    say(`Not written: ${names.join(", ")}, because: ${why.replace(/\.$/, "")}. What is not written stays on this page, and is tried again with the next change.`, "error", {
      "Write it now": () => this.again(),
      "Take it back": () => this.takeBack(),
    });
  }

  takeBack() {
    const given = this.kept();
    for (const one of given) this.waiting.delete(one.id);
    this.taken(given);
    this.shown();
  }

  /** Whether the page may go on to another file: nothing waits for this one. Else that is said. */
  async done() {
    await this.last;
    const kept = this.kept();
    if (kept.length) this.told(kept, kept[0].failed);
    return !kept.length;
  }
}

const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);
