// The page Hand checks: one point of the sample at a time, its label hidden.

import { Picture } from "./picture.js";
import { $, ask, element, many, onKeys, onUndo, say, send } from "./studio.js";
import { Writer } from "./writer.js";

const STEP = 0.25; // px that an arrow moves the point by
const picture = new Picture($("picture"), { onClick: (u, v) => put([u, v]) });
const recordings = new Map(); // "walk camera" -> what /api/recording says
let points = [];
let at = 0;
let uv = null; // the point as it is on the page
let look = null; // the first view of this picture
let [done, undone] = [[], []]; // what was decided of points: {point, before, after}
// each point is a row of its own
const writer = new Writer({
  write: ({ point: { walk, camera, frame, joint }, before, after }) => send("/api/checks/change", { walk, camera, frame, joint, before, after }),
  written: () => { $("picture").dataset.saved = Number($("picture").dataset.saved ?? 0) + 1; },
  disputed,
  name: ({ point: { walk, camera, frame, joint } }) => `${joint} on frame ${frame} of ${camera} in ${walk}`,
  taken: (changes) => {
    for (const { point, before } of changes) {
      point.clicked = before;
      done = done.filter((one) => one.point !== point);
    }
  },
  shown: () => show(),
});
window.dior = { picture }; // for tests, which look for a pixel's place on the screen

const open = () => points[at];

function put(to) {
  if (!open()) return;
  const { width, height } = picture.recording;
  uv = [Math.min(Math.max(to[0], -0.5), width - 0.51), Math.min(Math.max(to[1], -0.5), height - 0.51)];
  uv = uv.map((one) => Math.round(one * 100) / 100);
  show();
}

/** Write a point and go on. `after`: [u, v], or [] where it cannot be seen. */
function decide(after) {
  const point = open();
  if (!point) return;
  done.push({ point, before: point.clicked, after });
  undone = [];
  decided(point, after);
  go(at + 1);
}

function decided(point, after) {
  const before = point.clicked;
  point.clicked = after;
  writer.put({ id: points.indexOf(point), point, before, after });
}

/** Take the last decision back, or make it again, and go to its point. */
function step(from, to, way) {
  const change = from.pop();
  if (!change) return;
  to.push(change);
  say("");
  decided(change.point, way === "undo" ? change.before : change.after);
  go(points.indexOf(change.point) + (way === "undo" ? 0 : 1));
}
const undo = () => step(done, undone, "undo");
const redo = () => step(undone, done, "redo");

/** Somebody else has written the same point: whose shall stay? */
function disputed({ error, conflicts: [{ theirs, mine }] }, { point }) {
  const words = (one) => (!one ? "no row" : one[0] ? one.join(", ") : "cannot be seen");
  const numbers = (one) => one && (one[0] ? one.map(Number) : []);
  point.clicked = numbers(theirs);
  done = done.filter((one) => one.point !== point);
  say(`${error}. ${point.joint} on frame ${point.frame}: theirs ${words(theirs)}, mine ${words(mine)}.`, "error", {
    "Keep mine": () => { at = points.indexOf(point); decide(numbers(mine)); },
    "Take theirs": () => go(points.indexOf(point)),
  });
}

async function go(to) {
  at = Math.min(Math.max(to, 0), points.length);
  const point = open();
  uv = point?.clicked?.length ? point.clicked : null;
  show();
  if (!point) return;
  const { walk, camera, frame, joint } = point;
  const own = `${walk} ${camera}`;
  if (!recordings.has(own)) recordings.set(own, { ...(await ask("/api/recording", { walk, camera })), walk, camera });
  const view = await ask("/api/checks/view", { walk, camera, frame, joint });
  if (point !== open()) return;
  if (picture.recording !== recordings.get(own)) picture.open(recordings.get(own));
  look = view;
  $("picture").dataset.point = "none";
  await picture.show(frame);
  if (point !== open()) return;
  first();
  show();
  $("picture").dataset.point = at;
  const next = points[at + 1];
  if (next && next.walk === walk && next.camera === camera) picture.prefetch(next.frame);
}

function first() {
  if (look?.height) picture.look(look.u, look.v, picture.place.clientHeight / look.height);
  else picture.whole();
}

function show() {
  const point = open();
  const words = point && (point.words.toLowerCase() === point.joint.toLowerCase() ? "" : `, the ${point.words}`);
  $("prompt").replaceChildren(...(point
    ? ["Click ", element("strong", {}, point.joint), `${words}. ${point.camera}, frame ${point.frame} of ${point.walk}.`]
    : [points.length ? "That was the last one. The report of the next run uses them." : ""]));
  const done = points.filter((one) => one.clicked !== null).length;
  const seen = points.filter((one) => one.clicked?.length).length;
  $("progress").textContent = point
    ? `Point ${at + 1} of ${points.length}: ${seen} clicked, ${done - seen} not seen so far.`
    : `${seen} clicked, ${done - seen} not seen, of ${points.length}.`;
  const kept = writer.kept().length;
  if (kept) $("progress").append(" ", element("span", { class: "bad" }, `${many(kept, "point")} not saved.`));
  for (const dot of document.querySelectorAll(".body circle")) {
    dot.setAttribute("class", dot.dataset.marker === point?.joint ? "asked" : "");
  }
  $("accept").disabled = !uv;
  $("unseen").disabled = !point;
  $("back").disabled = !at;
  $("undo").disabled = !done.length;
  $("redo").disabled = !undone.length;
  picture.shapes = uv ? [{ kind: "cross", u: uv[0], v: uv[1], r: 9, class: "mark" }, { kind: "ring", u: uv[0], v: uv[1], r: 12, class: "mark" }] : [];
  picture.redraw();
}

onKeys((name, event) => {
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  if (name in arrows) {
    const by = event.shiftKey ? 4 * STEP : STEP;
    if (picture.recording && open()) put((uv ?? middle()).map((one, i) => one + by * arrows[name][i]));
    return true;
  }
  if (name === "Enter" && event.target.closest("summary, a, button:not(#accept)")) return false;
  const acts = {
    Enter: () => uv && decide(uv), Backspace: () => go(at - 1), x: () => decide([]), z: first,
    "+": () => picture.zoom(1.5), "=": () => picture.zoom(1.5), "-": () => picture.zoom(1 / 1.5), 0: () => picture.whole(),
  };
  const act = acts[name] ?? acts[name.toLowerCase()];
  if (!act) return false;
  act();
  return true;
});

function middle() {
  return picture.at({ x: picture.place.clientWidth / 2, y: picture.place.clientHeight / 2 });
}

$("accept").addEventListener("click", () => uv && decide(uv));
$("unseen").addEventListener("click", () => decide([]));
$("back").addEventListener("click", () => go(at - 1));
$("undo").addEventListener("click", undo);
$("redo").addEventListener("click", redo);
onUndo(undo, redo);
try {
  const found = await ask("/api/checks");
  points = found.points ?? [];
  if (found.lacks) say(found.lacks);
  else await go(found.at);
} catch (error) {
  if (!error.said) throw error;
}
