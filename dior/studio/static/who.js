// The page Who.

import { $, ask, element, onKeys, onUndo, prose, remember, say, state, svg, write } from "./studio.js";

const STATES = {
  mocap: ["nothing to do", "Indoors the motion capture says where the subject is."],
  alone: ["nothing to do", "There is one person only in every picture."],
  told: ["nothing to do", "Several people are in the pictures, and the last run told the subject from the others."],
  look: ["have a look", "Several people are in the pictures, and at times the last run saw only somebody else. If that is the subject, click them."],
  open: ["to do", "Several people are in the pictures, and the last run could not tell who the subject is: click the subject in each camera."],
  unknown: ["not run yet", "Several people are in the pictures. The next run may tell the subject from them by itself; you can click the subject now."],
  named: ["done", "You have clicked the subject."],
};
let walks = [];
let told = null; // what /api/who says of the walk that is shown
let seconds = [];
let at = 0; // frame of the first close camera
let shown = {}; // by camera, the frame and the people in it
const undone = { undo: [], redo: [] };

const seedOf = (camera, frame) => told.seeds.findIndex((one) => one.camera === camera && one.frame === frame);
const plain = (seeds) => (seeds.length ? seeds : null);

/** Write other seeds; `past` is where what was there is kept. False where they cannot be written. */
async function put(after, past) {
  const before = told.seeds;
  const found = await write("/api/who", { walk: told.walk, before: plain(before), after: plain(after) }).catch((error) => {
    if (!error.said) throw error;
  });
  if (!found) return false;
  if (found.conflicts) {
    say("The file has been changed elsewhere meanwhile. Nothing of yours is written; what is there now is shown.", "error");
    undone.undo = [];
    undone.redo = [];
  } else {
    say("");
    past?.push(before);
  }
  await refresh();
  return true;
}

function name(camera, u, v) {
  const { frame } = shown[camera];
  const rest = told.seeds.filter((one) => one.camera !== camera || one.frame !== frame);
  undone.redo = [];
  return put([...rest, { camera, frame, u: Math.round(u * 10) / 10, v: Math.round(v * 10) / 10 }], undone.undo);
}

async function back(from, to) {
  const last = undone[from].pop();
  // what cannot be written can be tried again
  if (last && !(await put(last, undone[to]))) undone[from].push(last);
}

const undo = () => back("undo", "redo");
const redo = () => back("redo", "undo");

/** Read the file and what is said of the walk again. */
async function refresh() {
  told = await ask("/api/who", { walk: told.walk });
  const one = walks.find((each) => each.walk === told.walk);
  one.state = told.state;
  list();
  draw();
}

/** The list of the walks and what is known of the one that is shown. */
function list() {
  $("walks").replaceChildren(...walks.map((one) => {
    const [short] = STATES[one.state] ?? [one.problem ? "cannot be read" : "..."];
    return element("button", { type: "button", class: one.state ?? "", "aria-current": one.walk === told?.walk && "true", onclick: () => choose(one.walk) }, `${one.walk}: ${short}`);
  }));
  if (!told) return;
  $("title").textContent = told.walk;
  $("state").textContent = STATES[told.state][1];
  $("words").replaceChildren(...(told.words ? prose(`The last run says: ${told.words}.`) : []));
  $("problem").textContent = told.problem;
  const without = told.close.filter((camera) => !told.seeds.some((one) => one.camera === camera));
  const named = told.seeds.map((one, i) => element("li", {},
    `${one.camera}, frame ${one.frame}, at (${one.u}, ${one.v}) `,
    element("button", { type: "button", onclick: () => { undone.redo = []; put(told.seeds.filter((_, j) => j !== i), undone.undo); } }, `Remove ${one.camera}, frame ${one.frame}`)));
  if (told.seeds.length && without.length) named.push(element("li", { class: "soft" }, `Not yet in ${without.join(", ")}.`));
  $("seeds").replaceChildren(...named);
  $("file").textContent = told.state === "mocap" ? "" : `A click is written to ${told.file}; the next run follows whom you clicked.`;
  for (const id of ["undo", "redo"]) $(id).disabled = !undone[id].length;
}

/** The pictures of all close cameras with everybody in them. */
function draw() {
  $("pictures").replaceChildren(...told.close.filter((camera) => shown[camera]).map((camera) => {
    const { frame, people, width, height, src } = shown[camera];
    const seed = seedOf(camera, frame);
    const tracks = new Set(told.seeds.flatMap((one, i) => (one.camera === camera && told.tracks[i] !== undefined ? [told.tracks[i]] : [])));
    const layer = svg("svg", { viewBox: `-0.5 -0.5 ${width} ${height}`, "aria-hidden": "true" });
    for (const [i, one] of people.entries()) {
      const [a, b, c, d] = one.box;
      const kind = tracks.has(one.track) ? "subject" : "other";
      layer.append(svg("rect", { x: a, y: b, width: c - a, height: d - b, class: kind }));
      layer.append(svg("text", { x: a, y: Math.max(b - height / 90, height / 24), "font-size": height / 24 }, `${i + 1}${kind === "subject" ? " subject" : ""}`));
    }
    if (seed >= 0) layer.append(svg("circle", { cx: told.seeds[seed].u, cy: told.seeds[seed].v, r: height / 90, class: "subject" }));
    const click = (event) => {
      const image = event.currentTarget;
      name(camera, (event.offsetX / image.clientWidth) * width - 0.5, (event.offsetY / image.clientHeight) * height - 0.5);
    };
    const buttons = people.map((one, i) => element("button", { type: "button", "aria-pressed": String(tracks.has(one.track)), onclick: () => name(camera, one.u, one.v).then(() => focusAgain(camera, i)) }, people.length === 1 ? "This is the subject" : `${i + 1} is the subject`));
    return element("figure", { "data-camera": camera, "data-frame": frame },
      element("div", { class: "inset" }, element("img", { src, alt: `${camera}, frame ${frame}: ${people.length} people`, onclick: click }), layer),
      element("figcaption", {}, `${camera}, frame ${frame} `, ...(buttons.length ? buttons : ["nobody was detected"])));
  }));
}

function focusAgain(camera, i) {
  document.querySelector(`[data-camera="${camera}"]`)?.querySelectorAll("button")[i]?.focus();
}

/** Show the moment of a frame of the first close camera. */
async function go(frame) {
  const { walk, close } = told;
  at = Math.min(Math.max(0, frame), seconds.length - 1);
  const now = at;
  $("frame").value = now;
  $("time").textContent = `${seconds[now].toFixed(3)} s of ${seconds.at(-1).toFixed(1)}`;
  remember({ frame: now });
  const moment = await ask("/api/moment", { walk, camera: close[0], frame: now });
  const found = await Promise.all(close.filter((camera) => moment[camera]).map(async (camera) => {
    const number = moment[camera].frame;
    const people = await ask("/api/who/people", { walk, camera, frame: number });
    const { width, height, version } = sizes[camera];
    return [camera, { frame: number, people, width, height, src: `/picture?${new URLSearchParams({ walk, camera, frame: number, v: version })}` }];
  }));
  if (told.walk !== walk || at !== now) return;
  shown = Object.fromEntries(found);
  list();
  draw();
  $("pictures").dataset.ready = now;
}

let sizes = {};
async function choose(walk, frame = null) {
  [undone.undo, undone.redo, shown] = [[], [], {}];
  $("pictures").replaceChildren();
  $("bar").hidden = true;
  remember({ walk, frame: "" });
  told = await ask("/api/who", { walk });
  walks.find((each) => each.walk === walk).state = told.state;
  list();
  if (!told.start) return;
  const found = await Promise.all(told.close.map((camera) => ask("/api/recording", { walk, camera })));
  sizes = Object.fromEntries(told.close.map((camera, i) => [camera, found[i]]));
  seconds = found[0].seconds;
  $("frame").max = seconds.length - 1;
  $("bar").hidden = false;
  await go(frame ?? told.start.frame);
}

const step = (event) => (event.shiftKey ? 10 : 1);
onKeys((key, event) => {
  if (!told?.start || event.target === $("frame") && key.startsWith("Arrow")) return false;
  const acts = {
    arrowleft: () => go(at - step(event)), arrowright: () => go(at + step(event)),
    z: undo, y: redo,
  };
  if (!(key.toLowerCase() in acts)) return false;
  acts[key.toLowerCase()]();
  return true;
});
$("frame").addEventListener("change", () => go(Number($("frame").value)));
$("before").addEventListener("click", () => go(at - 1));
$("after").addEventListener("click", () => go(at + 1));
$("undo").addEventListener("click", undo);
$("redo").addEventListener("click", redo);
onUndo(() => told && undo(), () => told && redo());

walks = (await ask("/api/walks")).map((one) => ({ walk: one.walk, indoor: one.indoor, state: one.indoor ? "mocap" : null }));
const first = walks.find((one) => one.walk === state().walk) ?? walks.find((one) => !one.indoor) ?? walks[0];
if (first) {
  list();
  await choose(first.walk, state().walk && state().frame ? Number(state().frame) : null).catch((error) => { if (!error.said) throw error; });
  // what is known of the others, one after the other: their detections are read for that
  for (const one of walks.filter((each) => !each.state)) {
    const answer = await fetch(`/api/who?${new URLSearchParams({ walk: one.walk })}`);
    const found = await answer.json();
    if (answer.ok) one.state = found.state;
    else one.problem = found.error;
    list();
  }
}
