// The page Frames.

import { Picture } from "./picture.js";
import { Scrub } from "./scrub.js";
import { $, ask, element, fill, remember, state } from "./studio.js";

const picture = new Picture($("picture"));
const scrub = new Scrub(picture, { onFrame: (frame, moving) => moving || later(frame), onKey: key });
let walks = [];

/** Half axes, px, and turn, degrees, of the 95 % ellipse of a label. */
function ellipse({ sigma_u, sigma_v, rho_uv }) {
  const [a, b, c] = [sigma_u ** 2, sigma_v ** 2, rho_uv * sigma_u * sigma_v];
  const [middle, half] = [(a + b) / 2, Math.hypot((a - b) / 2, c)];
  const turn = (Math.atan2(2 * c, a - b) / 2) * (180 / Math.PI);
  return { a: 2.4477 * Math.sqrt(middle + half), b: 2.4477 * Math.sqrt(Math.max(middle - half, 0)), turn };
}

async function draw(frame) {
  const { walk, camera } = picture.recording;
  $("none").hidden = true;
  picture.shapes = [];
  if ($("labels").checked || $("detections").checked) {
    const found = await ask("/api/drawn", { walk, camera, frame });
    if (frame !== scrub.at) return;
    const place = Object.fromEntries(found.labels.map((one) => [one.joint, one]));
    if ($("labels").checked) {
      const bones = found.bones.map(([a, b]) => ({ kind: "line", u: place[a].u, v: place[a].v, to: [place[b].u, place[b].v], class: "bone" }));
      const sure = found.labels.filter((one) => one.sigma_u !== null);
      const around = sure.map((one) => ({ kind: "ellipse", u: one.u, v: one.v, ...ellipse(one), class: one.side }));
      picture.shapes.push(...bones, ...around, ...found.labels.map((one) => ({ kind: "dot", u: one.u, v: one.v, class: one.side })));
    }
    if ($("detections").checked) {
      picture.shapes.push(...found.detections.map((one) => ({ kind: "cross", u: one.u, v: one.v, r: 4, class: "detection" })));
    }
    const lacks = [["labels", found.labels], ["detections", found.detections]].filter(([id, all]) => $(id).checked && !all.length);
    $("none").hidden = !lacks.length;
    $("none").textContent = `The last run has no ${lacks.map(([id]) => id).join(" and no ")} for this picture.`;
  }
  picture.redraw();
}

async function moment(frame) {
  const { walk, camera } = picture.recording;
  const found = await ask("/api/moment", { walk, camera, frame });
  if (frame !== scrub.at || camera !== picture.recording.camera) return;
  $("moment").replaceChildren(...Object.entries(found).map(([name, one]) => {
    const src = `/picture?${new URLSearchParams({ walk, camera: name, frame: one.frame, small: 1, v: picture.recording.version })}`;
    const words = `${name}, frame ${one.frame}${name === camera ? "" : `, ${one.later_ms > 0 ? "+" : ""}${one.later_ms} ms`}`;
    return element("button", { type: "button", "aria-current": name === camera && "true", onclick: () => choose(walk, name, one.frame) },
      element("img", { src, alt: "" }), words);
  }));
}

function later(frame) {
  const { walk, camera } = picture.recording;
  $("png").href = `/picture.png?${new URLSearchParams({ walk, camera, frame })}`;
  clearTimeout(later.timer);
  draw(frame);
  later.timer = setTimeout(() => moment(frame), 250);
}

async function choose(walk, camera, frame) {
  const one = walks.find((each) => each.walk === walk) ?? walks[0];
  fill($("walk"), walks.map((each) => [each.walk, `${each.walk} (${each.session})`]), one.walk);
  fill($("camera"), Object.entries(one.cameras).map(([name, role]) => [name, `${name}, ${role.replace("_", " ")}`]), camera);
  remember({ walk: one.walk, camera: $("camera").value });
  const found = await ask("/api/recording", { walk: one.walk, camera: $("camera").value });
  scrub.open({ ...found, walk: one.walk, camera: $("camera").value }, frame);
}

function key(name) {
  const box = { l: "labels", d: "detections" }[name.toLowerCase()];
  if (!box) return false;
  $(box).checked = !$(box).checked;
  if (picture.recording) draw(scrub.at);
  return true;
}

for (const id of ["labels", "detections"]) $(id).addEventListener("change", () => picture.recording && draw(scrub.at));
$("walk").addEventListener("change", () => choose($("walk").value, $("camera").value, 0));
$("camera").addEventListener("change", () => choose($("walk").value, $("camera").value, scrub.at));
walks = await ask("/api/walks");
if (walks.length) await choose(state().walk, state().camera, Number(state().frame) || 0);
