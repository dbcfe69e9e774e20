// The page Time: the skeleton in the pictures at the times that a clock gives them.

import { Crops, latest, whileHeld } from "./crops.js";
import { Picture } from "./picture.js";
import { Scrub } from "./scrub.js";
import { $, ask, element, fill, prose, remember, say, state, svg, write } from "./studio.js";

const NEAR_MS = 250; // of the curve and the dial, either way
const [WIDE, HIGH, LEFT, BELOW] = [280, 150, 34, 18];
const picture = new Picture($("picture"));
const scrub = new Scrub(picture, { onFrame: () => told && draw(), onKey: key });
const crops = new Crops($("crops"), { onPick: (one) => { scrub.go(one.frame); look(one); } });
let walks = [];
let told = null; // what the server says of the camera in the walk
let offset = 0; // ms, at the beginning of the walk
let shown = null; // what is drawn with it
let wide = false;
let span = [0, 1]; // of the curve, ms

const ms = (seconds) => Math.round(1e4 * seconds) / 10;
const signed = (value) => `${value > 0 ? "+" : ""}${value.toFixed(1)} ms`;
/** The clock's drift: that of a clock by hand, or else of the estimate. */
const drift = () => (told.given ? told.given.drift_ppm ?? 0 : told.estimate?.drift_ppm ?? 0);
/** Where an offset is on the curve, which is about the middle of the walk. */
const late = (value) => value + 1e-3 * drift() * told.middle_s;

const redraw = latest(
  ({ params }) => ask("/api/time/drawn", params),
  (answer, { begun, frame }) => {
    shown = { ...answer, number: frame };
    show(shown);
    $("crops").dataset.redraw = (performance.now() - begun).toFixed(1);
    $("crops").dataset.count = Number($("crops").dataset.count ?? 0) + 1;
  },
);

function show(what) {
  crops.draw(what?.pictures ?? []);
  picture.shapes = Object.entries(what?.frame ?? {}).flatMap(([side, bones]) =>
    bones.map(([u, v, u2, v2]) => ({ kind: "line", u, v, to: [u2, v2], class: side })));
  picture.redraw();
}

function draw() {
  const params = { walk: told.walk, camera: told.camera, offset_s: (offset / 1e3).toFixed(6), drift_ppm: drift(), frame: scrub.at };
  redraw({ params, frame: scrub.at, begun: performance.now() });
}

function set(value) {
  offset = Math.round(10 * value) / 10;
  $("dial").min = Math.min($("dial").min, offset);
  $("dial").max = Math.max($("dial").max, offset);
  $("dial").value = $("offset").value = offset;
  const given = told.given && ms(told.given.offset_s);
  $("override").disabled = told.reference || given === offset;
  $("accept").disabled = !told.given && (!told.estimate || ms(told.estimate.offset_s) === offset);
  draw();
  curve();
}

function counts() {
  if (told.reference) return `This camera's clock is the time of the walk: the others are compared with it, and it is 0.`;
  if (told.given) return `By hand, ${signed(ms(told.given.offset_s))} counts (${told.file}).`;
  if (!told.words) return "No run has looked for this clock yet.";
  if (told.words.offset === "0") return "The clock is not known: the pictures are taken at their stamps.";
  return `The estimate counts: ${signed(ms(told.used.offset_s))}.`;
}

function words() {
  $("counts").textContent = counts();
  const said = told.words;
  $("words").textContent = said && !told.reference
    ? `Against ${told.axis}, in the middle of the walk: ${said.offset} ms, 95 % interval ${said.interval}, drift ${said.drift} ppm, from ${said.source}. Residual without it and with it: ${said.residual} px. The skeleton is ${told.source}.`
    : `The skeleton is ${told.source}.`;
  if (told.outdoors) $("words").textContent += " It was made with the clocks of that run.";
  if (told.given && told.estimate) $("words").textContent += ` Without the one by hand the offset would be about ${signed(ms(told.estimate.offset_s))}.`;
  $("findings").replaceChildren(...told.findings.map((one) => element("li", { class: one.severity === "info" ? "" : one.severity === "error" ? "bad" : "look" }, `${one.text}.`)));
}

/** The costs over the lag: the curve, the interval, the estimate, and where the offset is. */
function curve() {
  const found = told.curve;
  $("wide").disabled = !found;
  if (!found || !found.lag_ms.length) {
    $("curve").replaceChildren();
    $("hover").textContent = "The last run has not tried other offsets of this clock.";
    return;
  }
  const all = found.lag_ms.map((x, i) => [x, found.cost_px[i]]).filter(([, y]) => y !== null);
  const middle = told.estimate ? late(ms(told.estimate.offset_s)) : late(offset);
  span = wide ? [all[0][0], all.at(-1)[0]] : [Math.min(middle, late(offset)) - NEAR_MS, Math.max(middle, late(offset)) + NEAR_MS];
  const seen = all.filter(([x]) => x >= span[0] && x <= span[1]);
  const [low, high] = [Math.min(...seen.map(([, y]) => y)), Math.max(...seen.map(([, y]) => y))];
  const px = (x) => LEFT + ((x - span[0]) / (span[1] - span[0])) * (WIDE - LEFT - 6);
  const py = (y) => 8 + ((high - y) / (high - low || 1)) * (HIGH - BELOW - 14);
  const line = (x, name) => svg("line", { x1: px(x), x2: px(x), y1: 4, y2: HIGH - BELOW, class: name });
  const label = (x, y, text, anchor) => svg("text", { x, y, "text-anchor": anchor, class: "tick" }, text);
  const parts = [];
  if (told.interval) {
    const [from, to] = told.interval.map(px);
    parts.push(svg("rect", { x: from, y: 4, width: Math.max(3, to - from), height: HIGH - BELOW - 4, class: "interval" }));
  }
  parts.push(svg("path", { d: seen.map(([x, y], i) => `${i ? "L" : "M"}${px(x).toFixed(1)} ${py(y).toFixed(1)}`).join(""), class: "cost" }));
  if (told.estimate) parts.push(line(middle, "estimate"));
  parts.push(line(late(offset), "offset"));
  parts.push(label(LEFT - 4, py(low) + 4, low.toFixed(low < 10 ? 1 : 0), "end"), label(LEFT - 4, py(high) + 4, high.toFixed(high < 10 ? 1 : 0), "end"));
  parts.push(label(LEFT, HIGH - 4, `${span[0].toFixed(0)} ms`, "start"), label(WIDE - 4, HIGH - 4, `${span[1].toFixed(0)} ms`, "end"));
  $("curve").replaceChildren(...parts);
  $("hover").textContent = `${said(late(offset))} The cost is the mean residual, px.`;
}

/** The cost nearest to a lag, in words. */
function said(lag) {
  const { lag_ms: lags, cost_px: costs } = told.curve;
  const i = lags.reduce((best, x, at) => (Math.abs(x - lag) < Math.abs(lags[best] - lag) ? at : best), 0);
  return `At ${signed(lags[i])} it costs ${costs[i] === null ? "an unknown amount" : `${costs[i].toFixed(2)} px`}.`;
}

/** The lag under the pointer. */
function under(event) {
  const box = $("curve").getBoundingClientRect();
  const x = ((event.clientX - box.left) / box.width) * WIDE;
  return span[0] + ((x - LEFT) / (WIDE - LEFT - 6)) * (span[1] - span[0]);
}

function look(one) {
  const [u, v, right, below] = one.crop;
  picture.look((u + right) / 2, (v + below) / 2, Math.min(8, 0.25 * $("picture").clientHeight / Math.max(20, below - v, right - u)));
}

async function put(after) {
  const { walk, camera, given } = told;
  const answer = await write("/api/time/save", { walk, camera, before: given, after });
  if (answer.conflicts) {
    const [{ theirs }] = answer.conflicts;
    say(`${answer.error}. There is ${JSON.stringify(theirs)}.`, "error", {
      "Write what is here": () => { told.given = theirs; put(after); },
      "Take what is there": () => open(walk, camera, scrub.at),
    });
    return;
  }
  say(after ? `Written to ${answer.file}. The labels have it after the next run.`
    : `${camera} is taken out of ${answer.file}: the next run takes what the recording tells.`);
  told.given = answer.given;
  words();
  set(offset);
}

function override() {
  if ($("override").disabled) return;
  const sigma = $("sigma").valueAsNumber;
  if (!Number.isFinite(sigma)) return say("Not written: how sure you are (± ms) is no number; 0 counts as exact.", "error");
  put({ offset_s: Number((offset / 1e3).toFixed(4)), drift_ppm: Number(drift().toFixed(1)), sigma_s: sigma / 1e3 }).catch((error) => { if (!error.said) throw error; });
}

async function accept() {
  if ($("accept").disabled) return;
  if (told.given) await put(null);
  if (told.estimate) set(ms(told.estimate.offset_s));
}

async function open(walk, camera, frame) {
  const params = { walk, camera };
  const [found, recording] = await Promise.all([ask("/api/time", params), ask("/api/recording", params)]);
  if (found.lacks) {
    lacking(found.lacks);
    scrub.open({ ...recording, walk, camera }, frame ?? 0);
    return;
  }
  told = { ...found, walk, camera };
  $("none").hidden = true;
  $("tools").hidden = false;
  const start = ms(told.used.offset_s);
  Object.assign($("dial"), { min: Math.round(start) - NEAR_MS, max: Math.round(start) + NEAR_MS, disabled: told.reference });
  $("offset").disabled = told.reference;
  if (told.given?.sigma_s !== undefined) $("sigma").value = 1e3 * told.given.sigma_s;
  crops.open(told.pictures, told, (one) => `frame ${one.frame}`);
  words();
  const at = told.pictures.find((one) => one.frame === frame) ?? told.pictures[0];
  scrub.open({ ...recording, walk, camera }, frame ?? at?.frame ?? 0);
  set(start);
  await picture.loading;
  if (at) look(at);
}

/** Show the picture alone, and why. */
function lacking(why) {
  told = null;
  $("tools").hidden = true;
  $("none").hidden = false;
  $("none").replaceChildren(...prose(why && `The clock cannot be shown yet: ${why}.`));
  crops.open([], { width: 1, height: 1 }, String);
  show(null);
}

async function choose(walk, camera, frame) {
  const one = walks.find((each) => each.walk === walk) ?? walks[0];
  fill($("walk"), walks.map((each) => [each.walk, `${each.walk} (${each.session})`]), one.walk);
  fill($("camera"), Object.entries(one.cameras).map(([name, role]) => [name, `${name}, ${role.replace("_", " ")}`]), camera);
  remember({ walk: one.walk, camera: $("camera").value });
  try {
    await open(one.walk, $("camera").value, frame);
  } catch (error) {
    if (!error.said) throw error;
    lacking("");
  }
}

function key(name) {
  if (!told || told.reference) return false;
  const acts = {
    ",": () => set(offset - 1), ".": () => set(offset + 1), "<": () => set(offset - 10), ">": () => set(offset + 10),
    e: () => told.estimate && set(ms(told.estimate.offset_s)), b: holdBefore, h: holdHidden, o: override, a: accept,
  };
  const act = acts[name] ?? acts[name.toLowerCase()];
  if (!act) return false;
  act();
  return true;
}

const holdBefore = whileHeld($("before"), "b", async (held) => {
  if (!held) return show(shown);
  const { walk, camera, used } = told;
  show(await ask("/api/time/drawn", { walk, camera, ...used, frame: scrub.at }));
  if ($("before").getAttribute("aria-pressed") === "false") show(shown);
});
const holdHidden = whileHeld(element("button"), "h", (held) => show(held ? null : shown));
$("dial").addEventListener("input", () => set($("dial").valueAsNumber));
$("offset").addEventListener("change", () => Number.isFinite($("offset").valueAsNumber) && set($("offset").valueAsNumber));
$("override").addEventListener("click", override);
$("accept").addEventListener("click", accept);
$("wide").addEventListener("click", () => { wide = !wide; $("wide").setAttribute("aria-pressed", String(wide)); curve(); });
$("curve").addEventListener("pointermove", (event) => { if (told?.curve) $("hover").textContent = said(under(event)); });
$("curve").addEventListener("pointerleave", () => told && curve());
$("curve").addEventListener("click", (event) => { if (told?.curve && !told.reference) set(under(event) - late(0)); });
$("walk").addEventListener("change", () => choose($("walk").value, $("camera").value));
$("camera").addEventListener("change", () => choose($("walk").value, $("camera").value));
walks = await ask("/api/walks");
const begun = state();
if (walks.length) await choose(begun.walk, begun.camera, begun.frame === undefined ? undefined : Number(begun.frame));
