// The page Long range: the skeleton in a dozen enlarged pictures follows the nudge.

import { Crops, latest, whileHeld } from "./crops.js";
import { $, ask, element, fill, onKeys, onUndo, prose, remember, say, send, state, write } from "./studio.js";

const NAMES = ["azimuth_deg", "elevation_deg", "distance_m", "roll_deg"];
const crops = new Crops($("crops"));
const dials = Object.fromEntries([...document.querySelectorAll(".dial")].map((one) => [one.dataset.of, one]));
let told = null; // what the server says of the camera
let now = {}; // the nudge that is shown
let shown = null; // what is drawn with it
let before = null; // the same of the pose before
let past = [];
let future = [];

const whose = () => ({ session: told.session, camera: told.camera });
const pose = () => document.querySelector("[name=pose]:checked").value;
const percent = (share) => (share === null || share === undefined ? "–" : `${(100 * share).toFixed(1)} %`);

/** What the file says, as numbers. */
function inFile() {
  const nudge = told.nudge ?? {};
  return Object.fromEntries(NAMES.map((name) => [name, (name === "roll_deg" ? told.tape.roll_deg : nudge[name]) ?? 0]));
}

const redraw = latest(
  async (wanted) => ({ answer: await ask("/api/long-range/drawn", wanted.params), begun: wanted.begun }),
  ({ answer, begun }, wanted) => {
    shown = { ...answer, params: wanted.params };
    crops.draw(answer.pictures);
    figures();
    $("crops").dataset.redraw = (performance.now() - begun).toFixed(1);
    $("crops").dataset.count = Number($("crops").dataset.count ?? 0) + 1;
  },
);

const draw = () => redraw({ params: { ...whose(), pose: pose(), ...now }, begun: performance.now() });

function figures() {
  const [was, is] = [before?.figures ?? {}, shown?.figures ?? {}];
  $("figures").hidden = !is.walks;
  $("onto").disabled = !Object.keys(is.onto ?? {}).length;
  $("words").textContent = is.words ?? (is.walks ? "" : "No boxes of this camera are drawn, so nothing but your eye tells how the labels lie.");
  if (!is.walks) return;
  const off = (one) => (one.off ? `${one.off[0].toFixed(1)}, ${one.off[1].toFixed(1)}` : "–");
  const rows = [
    ["labels inside", percent(was.inside), percent(is.inside)],
    ["perfect labels would be", percent(was.expected), percent(is.expected)],
    ["right, below the boxes, px", off(was), off(is)],
  ];
  if (is.held_back !== null) rows.splice(1, 0, ["of boxes kept from fits", percent(was.held_back), percent(is.held_back)]);
  if (is.walks.length > 1) rows.push(...is.walks.map((one, i) => [`inside in ${one.walk}`, percent(was.walks?.[i]?.inside), percent(one.inside)]));
  const count = is.walks.reduce((sum, one) => sum + one.boxes, 0);
  $("figures").caption.textContent = `${count} boxes; before is ${told.run ? "the last run" : "what the file said when this page was opened"}`;
  $("figures").tBodies[0].replaceChildren(...rows.map(([name, ...values]) =>
    element("tr", {}, element("th", { scope: "row" }, name), ...values.map((value) => element("td", { class: "number" }, value)))));
}

/** Show a nudge. `step` is whether it can be undone. */
function set(values, step = true) {
  if (step) {
    past.push(now);
    future = [];
  }
  now = Object.fromEntries(NAMES.map((name) => [name, Number((values[name] ?? now[name]).toFixed(3))]));
  for (const name of NAMES) {
    const dial = dials[name];
    dial.min = Math.min(dial.min, now[name]);
    dial.max = Math.max(dial.max, now[name]);
    dial.value = $(name).value = now[name];
  }
  const saved = inFile();
  const same = NAMES.every((name) => Math.abs(saved[name] - now[name]) < 5e-4);
  $("save").disabled = $("back").disabled = same;
  $("undo").disabled = !past.length;
  $("redo").disabled = !future.length;
  if (step && pose() !== "eye") {
    say(`A nudge is from what the file says by eye, not from the pose ${pose() === "run" ? "of the last run" : "that was fitted"}: the skeleton is drawn with that now.`, "look");
    document.querySelector("[name=pose][value=eye]").checked = true;
  }
  draw();
}

const move = (name, by) => set({ [name]: now[name] + by });

function undo(from, to) {
  if (!from.length) return;
  to.push(now);
  set(from.pop(), false);
}

async function save() {
  if ($("save").disabled) return;
  const saved = inFile();
  const { roll_deg: roll, ...nudge } = now;
  const changes = [];
  if (Object.entries(nudge).some(([name, value]) => value !== saved[name])) {
    changes.push({ key: "nudge", before: told.nudge, after: { ...told.nudge, ...nudge } });
  }
  if (roll !== saved.roll_deg) changes.push({ key: "tape", before: told.tape, after: { ...told.tape, roll_deg: roll } });
  await put(changes);
}

/** Write changes of keys of the camera's file, and show what it says then. */
async function put(changes) {
  const answer = await write("/api/long-range/save", { ...whose(), changes });
  if (answer.conflicts) {
    const [{ key: [key], theirs, mine }] = answer.conflicts;
    say(`${answer.error}. There is ${key}: ${JSON.stringify(theirs)}; here it is ${JSON.stringify(mine)}.`, "error", {
      "Write what is here": () => put(changes.map((one) => (one.key === key ? { ...one, before: theirs } : one))),
      "Take what is there": () => open(told.session, told.camera),
    });
    return;
  }
  say(`Written to ${answer.file}. The labels have it after the next run.`);
  const kept = { now, before };
  await open(told.session, told.camera, kept);
}

async function fit() {
  $("fit").disabled = true;
  $("fitted").textContent = `The camera is being fitted to the ${told.proposed.from}. This takes some seconds.`;
  try {
    const found = await send("/api/long-range/fit", { ...whose(), ...now });
    document.querySelector("[name=pose][value=fit]").disabled = false;
    document.querySelector("[name=pose][value=fit]").checked = true;
    told.proposed = found.align;
    await draw();
    $("fitted").replaceChildren(
      element("strong", {}, `It moves the labels by ${found.moves_px.toFixed(1)} px at the person, from the nudge above. `),
      ...found.said.filter((one) => one.severity !== "info").map((one) => element("span", { class: "look" }, `${one.text}. `)),
      element("details", {}, element("summary", {}, "What the fit found"), ...found.said.filter((one) => one.severity === "info").map((one) => element("p", {}, `${one.text}.`))),
    );
    writable();
  } catch (error) {
    $("fitted").textContent = error.said ? "" : String(error);
    if (!error.said) throw error;
  } finally {
    $("fit").disabled = !told.proposed;
  }
}

/** The button that puts `align:` into the file, or takes it out. */
function writable() {
  const ready = !document.querySelector("[name=pose][value=fit]").disabled;
  $("write").hidden = !told.align && !ready;
  $("write").textContent = told.align ? "Take align: out of the file" : "Write align: into the file";
}

async function open(session, camera, kept = null) {
  const found = await ask("/api/long-range", { session, camera });
  if (found.lacks) return lacking(found.lacks);
  told = { ...found, session, camera };
  remember({ session, camera });
  const { nudge, tape } = told;
  const limit = { azimuth_deg: 5, elevation_deg: 5, distance_m: Math.max(2, 0.1 * told.range_m), roll_deg: 10 };
  for (const name of NAMES) {
    const middle = name === "roll_deg" ? tape.roll_deg ?? 0 : 0;
    Object.assign(dials[name], { min: middle - limit[name], max: middle + limit[name] });
  }
  $("none").hidden = true;
  $("tools").hidden = false;
  $("says").replaceChildren(...prose(told.says));
  $("clocks").replaceChildren(...[...told.clocks.map((text) => `Clock of ${text}.`), ...told.without].map((text) => element("li", {}, text)));
  document.querySelector("[name=pose][value=run]").disabled = !told.run;
  $("fit").disabled = !told.proposed;
  $("fit").textContent = `Align by ${told.proposed?.from ?? "boxes"}`;
  if (!told.proposed) $("fitted").textContent = "There are not enough boxes of this camera yet: four pictures at least, thirty are good.";
  if (JSON.stringify(told.pictures) !== JSON.stringify(crops.pieces.map((one) => one.picture))) {
    crops.open(told.pictures, told, (one) => `${one.walk}, frame ${one.frame}`);
  }
  if (!kept) {
    document.querySelector("[name=pose][value=fit]").disabled = true;
    document.querySelector(`[name=pose][value=${told.align && told.run ? "run" : "eye"}]`).checked = true;
    $("fitted").textContent = told.proposed ? "" : $("fitted").textContent;
    [past, future, shown] = [[], [], null];
    now = inFile();
    before = await ask("/api/long-range/drawn", { session, camera, pose: told.run ? "run" : "eye", ...now });
  }
  writable();
  set(kept?.now ?? now, false);
}

/** Show nothing but why. */
function lacking(why) {
  $("none").hidden = false;
  $("none").replaceChildren(...prose(why && `Nothing can be shown yet: ${why}.`));
  $("tools").hidden = true;
  crops.open([], { width: 1, height: 1 }, String);
}

async function choose(session, camera) {
  try {
    await open(session, camera);
  } catch (error) {
    if (!error.said) throw error;
    lacking("");
  }
}

function key(name, event) {
  if (!told || $("tools").hidden) return false;
  if (event.target.type === "range" && /^Arrow|^Page|^Home|^End/.test(name)) return false;
  const turn = event.shiftKey ? 0.1 : 0.01;
  const acts = {
    ArrowLeft: () => move("azimuth_deg", -turn),
    ArrowRight: () => move("azimuth_deg", turn),
    ArrowUp: () => move("elevation_deg", -turn),
    ArrowDown: () => move("elevation_deg", turn),
    "[": () => move("distance_m", -0.1), "{": () => move("distance_m", -1),
    "]": () => move("distance_m", 0.1), "}": () => move("distance_m", 1),
    ",": () => move("roll_deg", -0.1), "<": () => move("roll_deg", -1),
    ".": () => move("roll_deg", 0.1), ">": () => move("roll_deg", 1),
    b: holdBefore, h: holdHidden, m: onto, s: save,
    z: () => undo(past, future), y: () => undo(future, past),
    "+": () => crops.zoom(1.25), "=": () => crops.zoom(1.25), "-": () => crops.zoom(0.8),
  };
  const act = acts[name] ?? acts[name.toLowerCase()];
  if (!act) return false;
  act();
  return true;
}

function onto() {
  const by = shown?.figures.onto ?? {};
  if (pose() === "eye" && Object.keys(by).length) set(Object.fromEntries(Object.entries(by).map(([name, value]) => [name, now[name] + value])));
}

const holdBefore = whileHeld($("before"), "b", (held) => crops.draw((held ? before : shown)?.pictures ?? []));
const holdHidden = whileHeld(element("button"), "h", (held) => crops.draw(held ? [] : shown?.pictures ?? []));
for (const name of NAMES) {
  let begun = null;
  dials[name].addEventListener("input", () => {
    // one step to undo for each time that it is taken
    begun ??= past.push(now);
    future = [];
    document.querySelector("[name=pose][value=eye]").checked = true;
    set({ [name]: Number(dials[name].value) }, false);
  });
  dials[name].addEventListener("change", () => { begun = null; });
  $(name).addEventListener("change", () => Number.isFinite($(name).valueAsNumber) && set({ [name]: $(name).valueAsNumber }));
}
for (const one of document.querySelectorAll("[name=pose]")) one.addEventListener("change", draw);
$("save").addEventListener("click", save);
$("onto").addEventListener("click", onto);
$("undo").addEventListener("click", () => undo(past, future));
$("redo").addEventListener("click", () => undo(future, past));
$("back").addEventListener("click", () => set(inFile()));
$("fit").addEventListener("click", fit);
$("write").addEventListener("click", () => put([{ key: "align", before: told.align, after: told.align ? null : told.proposed }]));
$("camera").addEventListener("change", () => choose(...$("camera").value.split("/")));
onKeys(key);
onUndo(() => told && undo(past, future), () => told && undo(future, past));

const cameras = await ask("/api/long-range/cameras");
fill($("camera"), cameras.map((one) => [`${one.session}/${one.camera}`, `${one.camera} of ${one.session}`]), `${state().session}/${state().camera}`);
if (cameras.length) await choose(...$("camera").value.split("/"));
else lacking("this project has no long-range camera; role: long_range and locate: align in a camera's file make one");
