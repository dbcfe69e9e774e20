// The page Marks.

import { Picture } from "./picture.js";
import { Scrub } from "./scrub.js";
import { $, ask, element, fill, many, onUndo, prose, remember, say, send, state } from "./studio.js";
import { Writer } from "./writer.js";

const picture = new Picture($("picture"), { onClick: (u, v) => place(u, v) });
const scrub = new Scrub(picture, { onFrame: (frame, moving) => moving || arrived(), onKey: key });

window.dior = { picture }; // for tests, which look for a pixel's place on the screen
const STEP = 0.25; // px that an arrow moves a mark by
const SURE = 6; // px, expected error of where markers are, for the view to go there
const MANY = 10; // residuals are drawn so many times as long as they are
// a click that is further from where its marker is expected may be a slip: px at least, and times the expected error
const [FAR, TIMES] = [30, 10];
let walks = [];
let walk, camera, told; // `told`: what /api/marks says
let marks = new Map(); // "walk frame joint" -> [u, v], of all walks
let residuals = new Map(); // the same -> [px, whether it is used]
let answer = {};
let errors = null; // as the last search of the clocks has them
let chosen = null; // the marker that the next click places
let byHand = false; // whether the person chose it
let aimed = false; // whether the pointer or the crosshair has moved since it is asked for
let selected = null; // the mark of this frame that the arrows move
let cursor = null; // the crosshair, where the keyboard has moved it
let pointer = null; // where the mouse is on the picture
const placing = new Set(); // marks whose click the server still looks at
let unseen = new Set(); // marks that the person cannot see
let [done, undone] = [[], []]; // changes of marks, and markers that were said not to be visible
// changes of this camera's file on their way into it
const writer = new Writer({
  write: ({ key, before, after }) => send("/api/marks/change", { walk, camera, changes: [{ key, before, after }] }),
  written, disputed, taken,
  name: ({ key: [, frame, joint] }) => `${joint} on frame ${frame}`,
  shown: () => { say_answer(); show(); },
});
let asking = null;
let first = Promise.resolve(); // until the marks as they are have been answered once

const NONE_LEFT = "Nothing is left on this frame: every marker is marked, hidden, or not visible to you.";
const idOf = (joint, frame = scrub.at, on = walk) => `${on} ${frame} ${joint}`;
const markOf = (joint) => marks.get(idOf(joint));

// changes

/** Put [u, v] or null at a mark, and remember how to undo it. */
function put(joint, after, frame = scrub.at) {
  const change = { key: [walk, frame, joint], before: marks.get(idOf(joint, frame)) ?? null, after };
  set(change);
  done.push(change);
  undone = [];
  save([change]);
}

function set({ key: [on, frame, joint], after }) {
  if (after) marks.set(idOf(joint, frame, on), after);
  else marks.delete(idOf(joint, frame, on));
  show();
}

function save(changes) {
  for (const { key, before, after } of changes) writer.put({ id: key.join(" "), key, before, after });
  return writer.last;
}

function written(found) {
  $("picture").dataset.sent = Number($("picture").dataset.sent ?? 0) + 1;
  took(found.rows);
  solve();
}

/** The marks of the file, with what is on its way there. */
function took(rows) {
  marks = new Map(rows.map(([on, frame, joint, u, v]) => [idOf(joint, frame, on), [u, v]]));
  for (const { id, after } of writer.waiting.values()) {
    if (after) marks.set(id, after);
    else marks.delete(id);
  }
  $("picture").dataset.saved = rows.length;
  show();
}

/** What could not be written is given up: the marks are again as they were. */
function taken(changes) {
  for (const { key, before } of changes) set({ key, after: before });
  const ids = new Set(changes.map((one) => one.id));
  done = done.filter((one) => one.unseen || !ids.has(one.key.join(" ")));
}

/** Somebody else has changed the same mark: whose shall stay? */
function disputed({ error, conflicts }) {
  $("picture").dataset.sent = Number($("picture").dataset.sent ?? 0) + 1;
  const words = (one) => (one ? `at ${one.map(Number).join(", ")}` : "removed");
  const each = conflicts.map(({ key: [, frame, joint], theirs, mine }) => `${joint} on frame ${frame}: theirs ${words(theirs)}, mine ${words(mine)}.`);
  const of = new Set(conflicts.map(({ key }) => key.join(" ")));
  done = done.filter((one) => one.unseen || !of.has(one.key.join(" ")));
  say(`${error}. ${each.join(" ")}`, "error", {
    "Keep mine": () => {
      const again = conflicts.map(({ key: [on, frame, joint], theirs, mine }) => ({
        key: [on, Number(frame), joint], before: theirs && theirs.map(Number), after: mine && mine.map(Number),
      }));
      done.push(...again);
      again.forEach(set);
      save(again);
    },
    "Take theirs": reload,
  });
}

async function reload() {
  took((await ask("/api/marks", { walk, camera })).rows);
  solve();
}

function step(from, to, way) {
  const change = from.pop();
  if (!change) return;
  if (document.querySelector("#said .look")) say("");
  to.push(change);
  const [on, frame, joint] = change.key;
  if (change.unseen) {
    if (frame !== scrub.at) scrub.go(frame);
    if (way === "undo") unseen.delete(idOf(joint));
    else unseen.add(idOf(joint));
    return choose(way === "undo" ? joint : following(joint));
  }
  const wanted = way === "undo" ? { key: change.key, before: change.after, after: change.before } : change;
  set(wanted);
  if (on === walk && frame !== scrub.at) scrub.go(frame);
  if (on === walk) choose(joint);
  save([wanted]);
}

// marking

async function place(u, v) {
  zoomed = null;
  if (!chosen) return say(`${NONE_LEFT} F goes to the frame that helps most.`);
  say("");
  const [joint, frame, at] = [chosen, scrub.at, picture.recording];
  const { width, height } = at;
  if (!(u >= -0.5 && v >= -0.5 && u < width - 0.5 && v < height - 0.5)) return say("That is outside of the picture: nothing is marked.");
  const [expected, id] = [predictedAt(joint), idOf(joint)];
  placing.add(id);
  // the next click may come before the answer
  ask_for(following(joint));
  show();
  const rounded = [u, v].map((one) => Math.round(one * 100) / 100);
  let found = { u: rounded[0], v: rounded[1] };
  if ($("snaps").checked) {
    found = await ask("/api/marks/snap", { walk, camera, frame, u: rounded[0], v: rounded[1] }).catch((error) => {
      if (!error.said) throw error;
      say(`Not marked: ${error.message}`, "error");
    });
  }
  placing.delete(id);
  if (!found) return ask_for(joint, true);
  if (at !== picture.recording) return;
  if (frame === scrub.at) {
    selected = joint;
    // an answer that came meanwhile may have asked for it again
    if (!chosen || chosen === joint) ask_for(following(joint));
  }
  put(joint, [found.u, found.v], frame);
  await writer.last;
  // that it is not written is said already
  if (document.querySelector("#said .error")) return;
  const [why, buttons] = doubt(joint, found, expected);
  if (why) say(`${why} Ctrl Z takes it back.`, "look", { Undo: undo, ...buttons, "It is right": () => {} });
}

/** Why a mark that was placed may be a slip, or "", and buttons for that. `expected`: where the pose has it, if there is
 * one. */
function doubt(joint, { u, v, found }, expected) {
  if (expected) {
    const off = Math.hypot(u - expected[0], v - expected[1]);
    if (off > Math.max(FAR, TIMES * (answer.best?.before ?? 0))) return [`${joint} is ${off.toFixed(0)} px from where the other marks expect it.`, {}];
  }
  if (found !== false) return ["", {}];
  return [`There is no bright marker within 5 px of the click: ${joint} is where you clicked.`, { "Do not snap (S)": () => toggle("snaps") }];
}

/** The marker to ask for, on this frame and not marked: what helps most, or else what is easy to tell. */
function following(after = null) {
  const free = (joint) => !markOf(joint) && joint !== after && !unseen.has(idOf(joint)) && !placing.has(idOf(joint));
  const hidden = new Set((answer.predicted ?? []).filter((one) => one.hidden).map((one) => one.joint));
  const rest = told.markers.map((one) => one.name).filter((joint) => !hidden.has(joint));
  // before clock and pose are found, what seems hidden may be seen: it is asked for last
  return [...(answer.order ?? told.easy), ...rest, ...(answer.errors ? [] : hidden)].find(free) ?? null;
}

function ask_for(joint, own = false) {
  [chosen, byHand, aimed] = [joint, own, false];
}

function choose(joint, own = true) {
  ask_for(joint, own);
  selected = markOf(joint) ? joint : null;
  show();
  const at = markOf(joint) ?? predictedAt(joint);
  if (at && !inView(at)) picture.look(...at);
  $("markers").querySelector("[aria-pressed=true]")?.scrollIntoView({ block: "nearest" });
}

/** Whether the body hides a marker of this frame, as far as the pose tells. */
function hides(joint) {
  return (answer.predicted ?? []).some((one) => one.joint === joint && one.hidden);
}

function predictedAt(joint) {
  const one = (answer.predicted ?? []).find((each) => each.joint === joint);
  return one && [one.u, one.v];
}

function inView([u, v]) {
  const [x, y] = picture.place_of(u, v);
  return x > 20 && y > 20 && x < picture.place.clientWidth - 20 && y < picture.place.clientHeight - 20;
}

function beside(way) {
  const names = told.markers.map((one) => one.name);
  const at = names.indexOf(chosen ?? selected);
  choose(names[(at + way + names.length) % names.length]);
}

function notVisible() {
  if (!chosen || markOf(chosen)) return;
  done.push({ key: [walk, scrub.at, chosen], unseen: true });
  undone = [];
  unseen.add(idOf(chosen));
  choose(following(), false);
}

const undo = () => step(done, undone, "undo");
const redo = () => step(undone, done, "redo");

async function nextMark() {
  const best = answer.best;
  const there = following();
  // of this frame if there is one left, or else of the frame where one helps most
  if (there || !best) return there ? choose(there, false) : nextFrame();
  if (best.walk === walk) {
    scrub.go(best.frame);
    choose(best.joint);
  }
}

async function nextFrame() {
  await writer.last;
  await first;
  if (answer.frame) return goTo(answer.frame.frame);
  const found = await ask("/api/marks/first", { walk, camera });
  if (found.frame === scrub.at && answer.why) say("Before the marks tell a pose no other frame is known to be better.");
  goTo(found.frame, found.box);
}

let zoomed = null; // the frame whose person is brought into view when it is known where it is

function goTo(frame, box = null) {
  zoomed = frame;
  scrub.go(frame);
  if (box) frameBox(box);
}

function frameBox([left, top, right, bottom]) {
  const { clientWidth, clientHeight } = picture.place;
  const scale = Math.min(clientWidth / (right - left + 40), clientHeight / (bottom - top + 60), 8);
  picture.look((left + right) / 2, (top + bottom) / 2, scale);
}

/** Zoom to the person, where its markers are known. */
function person() {
  const known = (answer.predicted ?? []).map((one) => [one.u, one.v]);
  const points = known.length ? known : told.markers.map((one) => markOf(one.name)).filter(Boolean);
  if (points.length < 2) return;
  const [us, vs] = [points.map(([u]) => u), points.map(([, v]) => v)];
  frameBox([Math.min(...us), Math.min(...vs), Math.max(...us), Math.max(...vs)]);
}

// what the server says of the marks

async function solve() {
  asking?.abort();
  const mine = (asking = new AbortController());
  const where = { walk, camera, frame: scrub.at };
  $("answer").dataset.busy = true;
  let once;
  first = new Promise((done) => { once = done; });
  try {
    for (const full of [0, 1]) {
      const found = await ask("/api/marks/pose", { ...where, full }, { signal: mine.signal });
      if (mine !== asking) return;
      if (found.void) return;
      answered(found);
      once();
      if (!found.unfinished) break;
    }
    $("answer").dataset.busy = false;
  } catch (error) {
    if (error.name !== "AbortError" && !error.said) throw error;
  } finally {
    once();
  }
}

function answered(found) {
  answer = found;
  errors = found.errors ?? (found.unfinished ? errors : null);
  residuals = new Map((found.residuals ?? []).map(([on, frame, joint, px, used]) => [idOf(joint, frame, on), [px, used]]));
  if (chosen && markOf(chosen) && chosen !== selected) chosen = null;
  // who aims at a marker is not asked for another one meanwhile: the click would be saved under its name
  if (chosen && !byHand && !aimed && hides(chosen)) chosen = null;
  if (!chosen) ask_for(following());
  if (zoomed === scrub.at && found.predicted) {
    zoomed = null;
    // a pose that is hardly known puts the person beside where it is
    if ((found.best?.before ?? 0) < SURE) person();
    else picture.whole();
  }
  say_answer();
  show();
}

function say_answer() {
  const lines = [];
  const line = (text, kind, ...buttons) => lines.push(element("p", { class: kind }, ...prose(text), ...buttons));
  const button = (name, act) => element("button", { type: "button", onclick: act }, name);
  const { wrong = [], best, frame } = answer;
  const kept = writer.kept();
  if (kept.length) line(`${many(kept.length, "change")} of marks ${kept.length === 1 ? "is" : "are"} not saved.`, "bad", button("Write now", () => writer.again()));
  if (answer.why) line(answer.why, answer.residuals ? "look" : "");
  if (errors) {
    const clock = errors.clocks[walk];
    const parts = [`Camera to ${errors.pose_mm ?? "?"} mm and ${errors.pose_deg ?? "?"}°`];
    if (clock) parts.push(`clock ${clock.late_s >= 0 ? "+" : "−"}${Math.abs(clock.late_s).toFixed(4)} s to ${clock.half_ms ?? "?"} ms (95 %)`);
    if (errors.label_px !== null) parts.push(`its share of a label is ${errors.label_px} px`);
    const enough = answer.enough ? " This is enough for this camera." : "";
    line(`${parts.join("; ")}.`, answer.errors ? (enough ? "good" : "") : "older", enough);
  } else if (answer.residuals && answer.frames === 1) {
    line("The pose is a first guess: one frame does not tell the clock. After six marks or more, mark a second frame (F).", "look");
  } else if (answer.residuals && !answer.why) {
    line("The clock is being searched …");
  }
  for (const one of wrong) line(one.text, "bad", button("Show it", () => { scrub.go(one.frame); choose(one.joint); }));
  for (const text of answer.notes ?? []) line(text, "look");
  if (chosen && hides(chosen) && !markOf(chosen)) {
    line(`The body should hide ${chosen} here. Where you do not see it: X, and the next one is asked for.`, "look");
  }
  if (best && best.walk === walk && best.after < 0.99 * best.before && !unseen.has(idOf(best.joint, best.frame))) {
    const text = `Of all markers ${best.joint} on frame ${best.frame} helps most (N): labels from ${best.before} to ${best.after} px.`;
    line(text, "", best.frame === scrub.at ? "" : button("Go there", () => { scrub.go(best.frame); choose(best.joint); }));
  }
  if (frame) line(frame.text, "", button("Go there (F)", () => goTo(frame.frame)));
  else if (!answer.residuals) line("Begin where the person is whole and large.", "", button("Find a frame (F)", nextFrame));
  $("answer").replaceChildren(...lines);
}

// what is shown

function show() {
  if (!told) return;
  const wrong = new Set((answer.wrong ?? []).filter((one) => one.walk === walk && one.frame === scrub.at).map((one) => one.joint));
  const predicted = new Map((answer.predicted ?? []).map((one) => [one.joint, one]));
  shapes(wrong, predicted);
  list(wrong, predicted);
  for (const dot of document.querySelectorAll(".body circle")) {
    const joint = dot.dataset.marker;
    dot.setAttribute("class", joint === chosen ? "asked" : wrong.has(joint) ? "bad" : markOf(joint) ? "done" : "");
  }
  const words = told.markers.find((one) => one.name === chosen)?.words;
  const name = element("strong", {}, chosen ?? "");
  $("prompt").replaceChildren(...(chosen
    ? [markOf(chosen) ? "Move " : "Click ", name, words ? `, the ${words}.` : "."]
    : [NONE_LEFT]));
  $("undo").disabled = !done.length;
  $("redo").disabled = !undone.length;
  $("unseen").disabled = !chosen || Boolean(markOf(chosen));
}

function shapes(wrong, predicted) {
  const drawn = [];
  if ($("predicts").checked) {
    for (const [joint, { u, v, hidden }] of predicted) {
      if (markOf(joint)) continue;
      const kind = `predicted ${hidden ? "hidden" : ""} ${joint === chosen ? "asked" : ""}`;
      drawn.push({ kind: "ring", u, v, r: joint === chosen ? 9 : 4, class: kind });
      if (joint === chosen) drawn.push({ kind: "text", u, v, text: joint, dx: 12 });
    }
  }
  const near = picture.viewer.viewport && picture.recording && picture.scale > 2;
  for (const { name } of told.markers) {
    const at = markOf(name);
    if (!at) continue;
    const [u, v] = at;
    const to = predicted.get(name);
    const residual = residuals.get(idOf(name));
    if (to) drawn.push({ kind: "line", u, v, to: [u + MANY * (to.u - u), v + MANY * (to.v - v)], class: "residual" });
    drawn.push({ kind: "cross", u, v, r: 7, class: `mark ${wrong.has(name) ? "wrong" : ""}` });
    if (name === selected) drawn.push({ kind: "ring", u, v, r: 11, class: "chosen" });
    const px = residual?.[0]?.toFixed(1);
    if (near || wrong.has(name) || name === selected) drawn.push({ kind: "text", u, v, text: px ? `${name} ${px}` : name });
    else if (px) drawn.push({ kind: "text", u, v, text: px });
  }
  if (cursor) drawn.push({ kind: "cross", u: cursor[0], v: cursor[1], r: 16, class: "cursor" });
  picture.shapes = drawn;
  picture.redraw();
}

function list(wrong, predicted) {
  const place = $("markers");
  if (place.children.length !== told.markers.length) {
    place.replaceChildren(...told.markers.map(({ name, words }) => element("li", {},
      element("button", { type: "button", "data-joint": name, title: words, onclick: () => choose(name) }, name, element("span")))));
  }
  for (const one of place.querySelectorAll("button")) {
    const joint = one.dataset.joint;
    const [px, used] = residuals.get(idOf(joint)) ?? [null, true];
    const yours = unseen.has(idOf(joint));
    const unwritten = writer.keeps(idOf(joint));
    const text = unwritten ? "not saved" : markOf(joint) ? (px === null ? "marked" : `${px.toFixed(2)} px${used ? "" : ", not used"}`)
      : yours ? "you: not visible" : predicted.get(joint)?.hidden ? "hidden, it seems" : "";
    one.lastElementChild.textContent = text;
    one.setAttribute("aria-pressed", joint === chosen);
    one.className = unwritten || wrong.has(joint) ? "bad" : markOf(joint) ? "" : yours ? "unseen" : predicted.get(joint)?.hidden ? "hidden" : "";
  }
}

function arrived() {
  const own = `${walk} ${camera} ${scrub.at}`;
  if (arrived.last === own) return;
  arrived.last = own;
  // what is known of another frame is not true here
  answer = { ...answer, predicted: [], order: undefined };
  selected = null;
  ask_for(told ? following() : null);
  show();
  solve();
}

// keys

function key(name, event) {
  if (!told || !picture.recording) return false;
  if (event.target === $("frame") && name.startsWith("Arrow")) return false;
  // Enter presses the button that has the focus
  if (name === "Enter" && event.target.closest("button, summary, a")) return false;
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  if (name in arrows) return move(arrows[name], event.shiftKey);
  const acts = {
    Enter: () => place(...(cursor ?? pointer ?? centre())),
    Escape: () => { selected = null; cursor ??= centre(); show(); },
    Delete: remove, Backspace: remove,
    ",": () => scrub.go(scrub.at - 1), ".": () => scrub.go(scrub.at + 1),
    "<": () => scrub.go(scrub.at - 10), ">": () => scrub.go(scrub.at + 10),
    j: () => beside(1), k: () => beside(-1), n: nextMark, f: nextFrame, x: notVisible, z: person,
    s: () => toggle("snaps"), p: () => toggle("predicts"),
  };
  const act = acts[name] ?? acts[name.toLowerCase()];
  if (!act) return false;
  act();
  return true;
}

function move([right, down], far) {
  if (selected && markOf(selected)) {
    const [u, v] = markOf(selected);
    const by = far ? 4 * STEP : STEP;
    const { width, height } = picture.recording;
    put(selected, within([u + by * right, v + by * down], width, height).map((one) => Math.round(one * 100) / 100));
    return true;
  }
  const by = (far ? 80 : 8) / picture.scale;
  const { width, height } = picture.recording;
  const [u, v] = cursor ?? centre();
  aimed = true;
  cursor = within([u + by * right, v + by * down], width, height);
  if (!inView(cursor)) picture.look(...cursor);
  show();
  return true;
}

const within = ([u, v], width, height) => [Math.min(Math.max(u, 0), width - 1), Math.min(Math.max(v, 0), height - 1)];

function centre() {
  return picture.at({ x: picture.place.clientWidth / 2, y: picture.place.clientHeight / 2 });
}

function remove() {
  if (!selected) return;
  const joint = selected;
  selected = null;
  put(joint, null);
  choose(joint);
}

function toggle(id) {
  $(id).checked = !$(id).checked;
  show();
}

onUndo(undo, redo);
picture.place.addEventListener("pointermove", (event) => {
  if (!picture.recording) return;
  const box = picture.place.getBoundingClientRect();
  pointer = picture.at({ x: event.clientX - box.left, y: event.clientY - box.top });
  aimed = true;
  if (cursor) { cursor = null; show(); }
});
picture.place.addEventListener("pointerleave", () => { pointer = null; });
for (const dot of document.querySelectorAll(".body circle")) {
  dot.addEventListener("click", () => told?.markers.some((one) => one.name === dot.dataset.marker) && choose(dot.dataset.marker));
}
$("undo").addEventListener("click", undo);
$("redo").addEventListener("click", redo);
$("unseen").addEventListener("click", notVisible);
$("predicts").addEventListener("change", show);
picture.viewer.addHandler("zoom", () => show());
window.addEventListener("focus", () => told && writer.again().then(reload));

// which camera

async function open(wanted, name, frame) {
  const one = walks.find((each) => each.walk === wanted) ?? walks.find((each) => each.session === state().session) ?? walks[0];
  fill($("walk"), walks.map((each) => [each.walk, each.walk]), one.walk);
  fill($("camera"), Object.keys(one.cameras).map((each) => [each, each]), name);
  [told, answer, errors, chosen, selected, cursor, done, undone, unseen] = [null, {}, null, null, null, null, [], [], new Set()];
  residuals = new Map();
  $("markers").replaceChildren();
  [walk, camera] = [one.walk, $("camera").value];
  remember({ walk, camera });
  const where = { walk, camera };
  const [found, recording] = await Promise.all([ask("/api/marks", where), ask("/api/recording", where)]);
  if (where.walk !== walk || where.camera !== camera) return;
  told = found;
  $("note").hidden = !found.note;
  $("note").replaceChildren(...prose(found.note));
  arrived.last = null;
  took(found.rows);
  scrub.open({ ...recording, ...where }, frame);
  ask_for(following());
  say_answer();
  show();
}

/** Go on to another walk or camera, unless something of this one is not written. */
async function change(wanted, name, frame) {
  if (await writer.done()) return open(wanted, name, frame);
  [$("walk").value, $("camera").value] = [walk, camera];
}

$("walk").addEventListener("change", () => change($("walk").value, camera, 0));
$("camera").addEventListener("change", () => change(walk, $("camera").value, scrub.at));
walks = (await ask("/api/walks")).filter((one) => one.indoor);
if (walks.length) await open(state().walk, state().camera, Number(state().frame) || 0);
else say("The project has no walk with motion capture, whose markers could be marked.");
