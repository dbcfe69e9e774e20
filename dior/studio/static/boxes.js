// The page Boxes.

import { Picture } from "./picture.js";
import { $, ask, element, fill, onKeys, onUndo, remember, say, send, state, svg } from "./studio.js";
import { Writer } from "./writer.js";

const SCALE = 8; // screen pixels a pixel of the picture
const STEP = 0.25; // px
const AHEAD = 3; // pictures that are asked for before they are wanted
// a body is offered where something moves to so many px only, so that nobody accepts it as it lies
const COARSE = 4;
// body heights a second: nobody goes faster
const FAST = 2.5;
// so many boxes tell how tall the person is; one that is so many times taller, or smaller, is asked about
const [FEW, ODD] = [4, 1.6];

const picture = new Picture($("picture"), { onClick: clicked, onDrag: dragged });
let walks = [];
let recording = null;
let told = null; // what /api/boxes says
let at = 0; // which of its frames
let box = null; // the one on the picture: [u_min, v_min, u_max, v_max]
let touched = false; // whether the person has put it there
let corner = null; // the first of two clicks
let moving = []; // boxes around what moves in this picture
let movers = new Map(); // by frame, what /api/boxes/moving answers
let looking = null; // which of `moving` is looked at
let dispute = null; // two boxes of one frame: {frame, theirs, mine}
let wants = false; // whether a name is asked for, to say that nobody is in this picture
let [done, undone] = [[], []]; // what was said of frames: {frame, before, after}

const entry = () => told.frames[at];
const drawn = (one) => one.box?.length === 4;
const middle = ([a, b, c, d]) => [(a + c) / 2, (b + d) / 2];
const rounded = (edges) => edges.map((edge) => Math.round(edge * 100) / 100);
const asked = () => ({ walk: recording.walk, camera: recording.camera });

/** What moves in a frame; asked once. */
function movingIn(frame) {
  if (!movers.has(frame)) movers.set(frame, ask("/api/boxes/moving", { ...asked(), frame }).catch(() => []));
  return movers.get(frame);
}

/** Of the boxes that are drawn, the two around a frame, or the nearest. */
function neighbours(frame) {
  const some = told.frames.filter((one) => drawn(one) && one.frame !== frame);
  return [some.findLast((one) => one.frame < frame), some.find((one) => one.frame > frame)].filter(Boolean);
}

/** Where the boxes around a frame have the person: [u, v], and how far off that may be, px; null where there is none. */
function between(frame) {
  const near = neighbours(frame);
  if (!near.length) return null;
  const seconds = (one) => Math.abs(recording.seconds[one.frame] - recording.seconds[frame]);
  const total = near.reduce((sum, one) => sum + seconds(one), 0);
  const share = near.length === 1 || !total ? [1, 0] : [seconds(near[1]) / total, seconds(near[0]) / total];
  const place = [0, 1].map((axis) => near.reduce((sum, one, i) => sum + share[i] * middle(one.box)[axis], 0));
  const tall = near[0].box[3] - near[0].box[1];
  return [place, tall * (1 + FAST * Math.min(...near.map(seconds)))];
}

const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);

/** Where the person is to be looked for: what moves nearest to where the boxes around say; [u, v] or null. */
function expected(frame) {
  const found = between(frame);
  if (!found) return moving.length ? middle(moving[0]) : null;
  const [place, reach] = found;
  const off = (one) => apart(middle(one), place);
  const best = [...moving].sort((a, b) => off(a) - off(b))[0];
  return best && off(best) <= reach ? middle(best) : place;
}

const tall = ([, above, , below]) => below - above;

/** How tall the boxes of the other frames are, px, the middle one; null where they are few. A stride changes the width. */
function usual(frame) {
  const heights = told.frames.filter((one) => drawn(one) && one.frame !== frame).map((one) => tall(one.box)).sort((a, b) => a - b);
  return heights.length < FEW ? null : heights[Math.floor(heights.length / 2)];
}
const odd = (height, others) => others !== null && Math.max(height / others, others / height) > ODD;

/** Why a box may be beside the person, or "". */
function doubt(frame, edges) {
  const others = usual(frame);
  if (odd(tall(edges), others)) return `is ${tall(edges).toFixed(0)} px tall, and the others about ${others.toFixed(0)}`;
  const found = between(frame);
  if (found && apart(middle(edges), found[0]) > found[1]) return `is ${apart(middle(edges), found[0]).toFixed(0)} px from where the other boxes expect the person`;
  const [a, b, c, d] = edges;
  const moves = moving.some(([left, top, right, bottom]) => left < c && right > a && top < d && bottom > b);
  return moving.length && !moves ? "has nothing in it that moves, and something moves elsewhere" : "";
}

/** Width and height of the box that is offered: those of the one drawn nearest in time, else of a person far away. */
function size(frame) {
  const others = usual(frame);
  const near = told.frames
    .filter((one) => drawn(one) && one.frame !== frame && !odd(tall(one.box), others))
    .sort((a, b) => Math.abs(a.frame - frame) - Math.abs(b.frame - frame))[0];
  return near ? [near.box[2] - near.box[0], near.box[3] - near.box[1]] : [recording.height / 80, recording.height / 32];
}

/** Offer a box of the last one's size around a place. */
function offer(place) {
  const [wide, high] = size(entry().frame);
  const [u, v] = place.map((one) => Math.round(one / COARSE) * COARSE);
  box = [u - wide / 2, v - high / 2, u + wide / 2, v + high / 2];
  touched = false;
}

function look(u, v, scale = SCALE) {
  picture.look(u, v, scale);
  picture.drags = true;
  redraw();
}

function whole() {
  picture.whole();
  picture.drags = false;
  redraw();
}

/** Show one of the frames, with its box or one that is offered. */
async function go(index) {
  at = Math.min(Math.max(0, index), told.frames.length - 1);
  const { frame } = entry();
  if (dispute && dispute.frame !== frame) dispute = null;
  remember({ frame });
  [corner, box, moving, looking] = [null, null, [], null];
  $("picture").dataset.ready = "";
  $("whole").src = picture.address(frame, false);
  for (const one of told.frames.slice(at + 1, at + 1 + AHEAD)) {
    picture.prefetch(one.frame);
    movingIn(one.frame);
  }
  list();
  picture.shapes = [];
  await Promise.all([picture.show(frame), movingIn(frame).then((found) => { if (frame === entry().frame) moving = found; })]);
  if (frame !== entry().frame) return;
  if (drawn(entry())) {
    box = [...entry().box];
    touched = true;
    look(...middle(box));
  } else {
    const place = expected(frame);
    offer(place ?? [recording.width / 2, recording.height / 2]);
    if (place) look(...middle(box));
    else whole();
  }
  $("picture").dataset.ready = frame;
  labels();
}

/** Go on to the next that is not drawn yet after this one, or the next of all. */
function next() {
  const later = told.frames.findIndex((one, i) => i > at && one.box === null);
  if (later >= 0) return go(later);
  const left = told.frames.findIndex((one) => one.box === null);
  if (left >= 0) return go(left);
  say(`All ${told.frames.length} pictures are done.`);
  return go(at);
}

/** Write what is said of this frame, and go on meanwhile; it can be undone. */
function put(after) {
  done.push({ frame: entry().frame, before: entry().box, after });
  undone = [];
  return say_of(entry(), after);
}

/** Take the last thing that was said of a frame back, or say it again, and go there. */
function step(from, to, way) {
  const change = from.pop();
  if (!change) return;
  to.push(change);
  say("");
  const index = told.frames.findIndex((one) => one.frame === change.frame);
  say_of(told.frames[index], way === "undo" ? change.before : change.after);
  go(index);
}
const undo = () => step(done, undone, "undo");
const redo = () => step(undone, done, "redo");

/** The frames of which something is on its way into the file have what is on the page: `one` is an entry of `mine`. */
const writer = new Writer({
  write: ({ row, before, after }) => send("/api/boxes", { ...row, before, after }),
  written: () => {},
  disputed,
  name: ({ row }) => `frame ${row.frame}`,
  taken: (changes) => {
    for (const { mine, one, before } of changes) {
      one.box = before;
      done = done.filter((each) => mine !== told || each.frame !== one.frame);
      if (mine === told && one === entry()) go(at);
    }
  },
  shown: () => told && list(),
});
const idOf = (frame) => `${recording.walk} ${recording.camera} ${told.drawer} ${frame}`;

function say_of(one, after) {
  const row = { ...asked(), drawer: told.drawer, frame: one.frame };
  const change = { id: idOf(one.frame), mine: told, one, row, before: one.box, after };
  one.box = after;
  return writer.put(change);
}

/** Somebody else has changed the same frame: whose shall stay? Both are shown. */
function disputed({ conflicts: [{ theirs }] }, { mine, one, row, after }) {
  const there = theirs === null || theirs.every((cell) => cell === "") && !row.drawer ? null : theirs.filter((cell) => cell !== "").map(Number);
  // another may have been accepted meanwhile
  if (one.box === after) one.box = there;
  done = done.filter((each) => mine !== told || each.frame !== row.frame);
  if (mine === told) {
    dispute = { frame: row.frame, theirs: there, mine: after };
    go(mine.frames.indexOf(one));
  }
  const words = there === null ? "is not drawn any more" : there.length ? `has the box ${there.join(", ")} now` : "has nobody now";
  say(`Frame ${row.frame} has been changed elsewhere meanwhile: it ${words}. Nothing of yours is written.`, "error", {
    "Keep mine": () => {
      dispute = null;
      if (mine !== told) return;
      done.push({ frame: row.frame, before: there, after });
      say_of(one, after);
      next();
    },
    "Take theirs": () => { dispute = null; if (mine === told) go(mine.frames.indexOf(one)); },
  });
}

/** Whether the picture that is asked about is on the page: nothing is said of one that nobody has seen. */
const ready = () => $("picture").dataset.ready === String(entry().frame);

function accept() {
  if (corner || !ready()) return;
  if (!touched) {
    say("The dashed box is a first guess. Move it with the arrow keys, or draw one, then accept it.");
    return;
  }
  say("");
  const now = rounded(box);
  const { frame } = entry();
  const why = doubt(frame, now);
  if (!drawn(entry()) || entry().box.some((edge, i) => edge !== now[i])) put(now);
  next();
  if (why) say(`The box of frame ${frame} ${why}. Ctrl Z takes it back.`, "look", { Undo: undo, "It is right": () => {} });
}

function nobody() {
  if (!ready()) return;
  if (!told.drawer) {
    say("Fill in who draws first, a name or a letter, and press Enter: that nobody is there is written under a name.", "error");
    wants = true;
    $("drawer").focus();
    return;
  }
  say("");
  if (entry().box?.length !== 0) put([]);
  next();
}

function undraw() {
  if (entry().box !== null) put(null);
  go(at);
}

function place(edges) {
  const [a, b, c, d] = edges;
  box = [Math.min(a, c), Math.min(b, d), Math.max(a, c), Math.max(b, d)];
  touched = true;
}

function clicked(u, v) {
  if (!picture.drags) {
    offer([u, v]);
    look(u, v);
  } else if (!corner) {
    corner = [u, v];
    redraw();
  } else {
    const from = corner;
    corner = null;
    if (u !== from[0] && v !== from[1]) place([...from, u, v]);
    redraw();
  }
}

function dragged(from, to) {
  corner = null;
  if (Math.abs(from[0] - to[0]) < STEP || Math.abs(from[1] - to[1]) < STEP) return;
  place([...from, ...to]);
  redraw();
}

/** Move the box, or with Shift its right and lower edge. */
function nudge(key, event) {
  if (!box) return;
  const step = event.repeat ? 4 * STEP : STEP;
  const [du, dv] = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] }[key];
  const [a, b, c, d] = box;
  box = event.shiftKey
    ? [a, b, Math.max(c + du, a + STEP), Math.max(d + dv, b + STEP)]
    : [a + du, b + dv, c + du, d + dv];
  touched = true;
  corner = null;
  const [x, y] = picture.place_of(...middle(box));
  const inside = x > 40 && y > 40 && x < picture.place.clientWidth - 40 && y < picture.place.clientHeight - 40;
  if (picture.drags && !inside) picture.look(...middle(box));
  redraw();
}

/** Look at the next thing that moves. */
function mover() {
  if (!moving.length) return say("Nothing moves in this picture against the others.");
  looking = looking === null ? 0 : (looking + 1) % moving.length;
  offer(middle(moving[looking]));
  look(...middle(box));
}

let shapesOfLabels = [];
async function labels() {
  shapesOfLabels = [];
  const { frame } = entry();
  if ($("labels").checked) {
    const found = await ask("/api/drawn", { ...asked(), frame });
    if (frame !== entry().frame) return;
    shapesOfLabels = found.labels.map((one) => ({ kind: "dot", u: one.u, v: one.v, class: one.side }));
    if (!shapesOfLabels.length) say("The last run has no labels in this picture.");
  }
  redraw();
}

function redraw() {
  const shapes = [...shapesOfLabels];
  if (box) shapes.push({ kind: "box", u: box[0], v: box[1], to: [box[2], box[3]], class: touched ? "boxed" : "offered" });
  if (dispute?.frame === entry().frame) {
    for (const [whose, [a, b, c, d]] of [["theirs", dispute.theirs ?? []], ["mine", dispute.mine ?? []]]) {
      if (d === undefined) continue;
      shapes.push({ kind: "box", u: a, v: b, to: [c, d], class: whose === "mine" ? "boxed" : "other" });
      shapes.push({ kind: "text", u: whose === "mine" ? c : a, v: whose === "mine" ? d : b, text: whose, dx: 2, dy: whose === "mine" ? 14 : -4 });
    }
  }
  if (corner) shapes.push({ kind: "cross", u: corner[0], v: corner[1], class: "boxed" });
  picture.shapes = shapes;
  picture.redraw();
  inset();
  const one = entry();
  const numbers = box ? `${(box[2] - box[0]).toFixed(2)} × ${(box[3] - box[1]).toFixed(2)} px at (${box[0].toFixed(2)}, ${box[1].toFixed(2)})` : "";
  $("undo").disabled = !done.length;
  $("redo").disabled = !undone.length;
  const words = one.box === null ? (touched ? "not accepted yet" : "a first guess: move it, or draw one") : writer.keeps(idOf(one.frame)) ? "not saved" : one.box.length ? (same() ? "accepted" : "changed, not accepted yet") : "nobody is seen here, you said";
  $("now").textContent = `Picture ${at + 1} of ${told.frames.length}, frame ${one.frame}: ${numbers}, ${words}.`;
  Object.assign($("picture").dataset, { box: box ? box.map((edge) => edge.toFixed(3)).join(" ") : "", touched });
}

const same = () => drawn(entry()) && rounded(box).every((edge, i) => edge === entry().box[i]);

/** The enlarged part, and what moves, on the whole picture. */
function inset() {
  const { width, height } = recording;
  $("marks").setAttribute("viewBox", `0 0 ${width} ${height}`);
  const [a, b] = picture.at({ x: 0, y: 0 });
  const [c, d] = picture.at({ x: picture.place.clientWidth, y: picture.place.clientHeight });
  $("marks").replaceChildren(
    svg("rect", { x: a, y: b, width: c - a, height: d - b, class: "view" }),
    ...moving.map((one) => { const [cx, cy] = middle(one); return svg("circle", { cx, cy, r: width / 50, class: "mover" }); }),
  );
}

/** The list of the frames, and what the file says. */
function list() {
  const done = told.frames.filter((one) => one.box !== null).length;
  $("count").textContent = `${done} of ${told.frames.length} pictures are done`;
  $("frames").replaceChildren(...told.frames.map((one, i) => {
    const unsaved = writer.keeps(idOf(one.frame));
    const words = `${one.box === null ? "not drawn yet" : one.box.length ? "drawn" : "nobody"}${unsaved ? ", not saved" : ""}`;
    return element("button", {
      type: "button", class: unsaved ? "bad" : words.split(" ")[0], title: `frame ${one.frame}: ${words}`, "aria-label": `frame ${one.frame}, ${words}`,
      "aria-current": i === at && "true", onclick: () => { go(i); focus(); },
    }, one.box === null ? String(one.frame) : unsaved ? `${one.frame} !` : one.box.length ? `${one.frame} ✓` : `${one.frame} –`);
  }));
  const others = told.drawers.filter((one) => one.name !== told.drawer);
  const by = (one) => (one.name ? `by ${one.name}` : "without a name");
  const named = (one) => `${one.boxes} ${one.boxes === 1 ? "box" : "boxes"} ${by(one)}`;
  $("who").textContent = [
    told.drawer ? "" : "For Nobody (N) a name is needed.",
    others.length ? `There are ${others.map(named).join(", ")}, too: all stay. The camera is fitted to the boxes ${by(told.drawers[0])}; the others show how far two people differ.` : "",
  ].join(" ").trim();
  const from = told.labelled ? "that the last run has labelled" : "of the recording";
  $("file").replaceChildren(element("code", {}, told.file), " has a row for each picture: its four edges in px, and who drew. A row with a name and without edges: nobody was seen. "
    + `The pictures are spread over those ${from}, the same each time. Of 15 boxes or more one in five is not used to fit the camera: it judges the fit.`);
}

function focus() {
  document.activeElement?.blur();
  picture.viewer.canvas.focus({ preventScroll: true });
}

/** What the file has for this drawer, and the first picture that is not drawn, or `frame`. */
async function load(frame) {
  const drawer = $("drawer").value.trim();
  const count = Number(state().count) || 25;
  const found = await ask("/api/boxes", { ...asked(), drawer, count });
  told = { ...found, drawer };
  if (!told.frames.length) {
    say("The last run has no label in any picture of this camera, so that there is nothing to draw.");
    return;
  }
  const wanted = told.frames.findIndex((one) => one.frame === frame);
  const open = told.frames.findIndex((one) => one.box === null);
  await go(wanted >= 0 ? wanted : Math.max(open, 0));
}

async function choose(walk, camera, frame = null) {
  [done, undone] = [[], []];
  const one = walks.find((each) => each.walk === walk) ?? walks[0];
  fill($("walk"), walks.map((each) => [each.walk, each.walk]), one.walk);
  fill($("camera"), one.far.map((name) => [name, name]), camera);
  remember({ walk: one.walk, camera: $("camera").value });
  movers = new Map();
  const words = { walk: one.walk, camera: $("camera").value };
  recording = { ...await ask("/api/recording", words), ...words };
  picture.open(recording);
  await load(frame);
}

async function named() {
  if (!(await writer.done())) return void ($("drawer").value = told.drawer);
  const drawer = $("drawer").value.trim();
  [done, undone] = [[], []];
  remember({ drawer });
  localStorage.setItem("drawer", drawer);
  await load(entry()?.frame ?? null);
  if (wants && drawer) nobody();
  wants = false;
}

/** Go on to another walk or camera, unless something of this one is not written. */
async function change(walk, camera) {
  if (await writer.done()) return choose(walk, camera);
  [$("walk").value, $("camera").value] = [recording.walk, recording.camera];
}

const acts = {
  Enter: accept, Backspace: () => go(at - 1), Delete: undraw, n: nobody, m: mover, 0: whole,
  8: () => box && look(...middle(box)), "+": () => { picture.zoom(1.5); redraw(); }, "=": () => { picture.zoom(1.5); redraw(); }, "-": () => { picture.zoom(1 / 1.5); redraw(); },
  Escape: () => { corner = null; redraw(); }, l: () => { $("labels").checked = !$("labels").checked; labels(); },
};

onUndo(() => told?.frames.length && undo(), () => told?.frames.length && redo());
onKeys((key, event) => {
  // a key that is held down to move the box accepts nothing
  if (!told?.frames.length || !$("picture").dataset.frame || event.repeat && !key.startsWith("Arrow")) return false;
  if (event.target.closest("button, a, summary, input") && ["Enter", " "].includes(key)) return false;
  if (key.startsWith("Arrow")) nudge(key, event);
  else if (key.toLowerCase() in acts) acts[key.toLowerCase()]();
  else if (key in acts) acts[key]();
  else return false;
  return true;
});
for (const [id, act] of Object.entries({ accept, nobody, back: () => go(at - 1), undraw, undo, redo })) $(id).addEventListener("click", () => { act(); if (document.activeElement !== $("drawer")) focus(); });
$("labels").addEventListener("change", labels);
$("more").addEventListener("click", async () => {
  if (!(await writer.done())) return;
  remember({ count: told.frames.length + 25 });
  await load(null);
});
$("walk").addEventListener("change", () => change($("walk").value, null));
$("camera").addEventListener("change", () => change($("walk").value, $("camera").value));
$("drawer").addEventListener("change", named);
$("drawer").addEventListener("blur", () => { if (!$("drawer").value.trim()) wants = false; });
$("drawer").addEventListener("keydown", (event) => { if (event.key === "Enter") { event.preventDefault(); focus(); } });
$("whole").addEventListener("click", (event) => {
  const { width, height } = recording;
  const [u, v] = [(event.offsetX / $("whole").clientWidth) * width - 0.5, (event.offsetY / $("whole").clientHeight) * height - 0.5];
  if (!drawn(entry())) offer([u, v]);
  look(u, v);
});
picture.onShown = (frame, small, there) => { if (!there) say(`The picture of frame ${frame} cannot be read; go on to another.`, "error"); };

walks = (await ask("/api/walks"))
  .map((one) => ({ ...one, far: Object.keys(one.cameras).filter((name) => one.cameras[name] === "long_range") }))
  .filter((one) => one.far.length);
$("drawer").value = state().drawer ?? localStorage.getItem("drawer") ?? "";
if ($("drawer").value) remember({ drawer: $("drawer").value });
if (!walks.length) $("none").hidden = false;
else {
  await choose(state().walk, state().camera, state().frame ? Number(state().frame) : null);
  if (!$("drawer").value && told.named.length) {
    const take = (name) => () => { $("drawer").value = name; named(); };
    say("Who draws?", "", { ...Object.fromEntries(told.named.map((name) => [name, take(name)])), "Somebody else": () => $("drawer").focus() });
  }
}
