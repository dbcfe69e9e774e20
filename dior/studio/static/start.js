// The page Start: what `dior check` says, and a run with its progress.

import { $, ask, element, prose, say, send, write } from "./studio.js";

function shown({ state, done, total, lines, dry, elsewhere }) {
  const running = state === "running";
  $("run").disabled = $("dry").disabled = running;
  $("end").hidden = !running;
  $("going").hidden = state === "none" && !elsewhere;
  $("progress").hidden = dry || (!running && state !== "done");
  if (total) $("progress").value = done / total;
  else $("progress").removeAttribute("value");
  const words = { running: dry ? "Looking what would run ..." : "At work ...", done: dry ? "" : "Done.", failed: "It ended with an error.", none: elsewhere };
  $("steps").textContent = `${total && !dry ? `${done} of ${total} steps. ` : ""}${words[state]}`;
  $("steps").className = state === "failed" ? "bad" : "";
  const box = $("lines");
  // who has scrolled back to read stays there
  const last = box.scrollHeight - box.clientHeight - box.scrollTop < 4;
  box.textContent = lines.join("\n");
  if (last) box.scrollTop = box.scrollHeight;
  $("going").dataset.state = state;
  return running;
}

async function follow() {
  let begun = false;
  while (shown(await ask("/api/run"))) {
    begun = true;
    await new Promise((done) => setTimeout(done, 1000));
  }
  // what is left may be another by now
  if (begun && !$("lines").dataset.dry) await again();
}

/** Put the tasks and the report of the page as it is now in the place of those that are shown. */
async function again() {
  const text = await (await fetch(location.href)).text();
  const fresh = new DOMParser().parseFromString(text, "text/html");
  for (const [old, now] of [[document.querySelectorAll("main > section:not(:has(#run, #checked))"), fresh.querySelectorAll("main > section:not(:has(#run, #checked))")]]) {
    old.forEach((one, i) => (now[i] ? one.replaceWith(now[i]) : one.remove()));
  }
  $("outcome").replaceWith(fresh.getElementById("outcome"));
}

async function act(what) {
  $("lines").dataset.dry = what === "dry" ? "yes" : "";
  shown(await send("/api/run", { do: what }));
  await follow();
}

for (const form of document.querySelectorAll(".todos form")) {
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const { path, line, key } = form.dataset;
    const told = await write("/api/fill", { path, line: Number(line), key, value: form.value.value }).catch(() => null);
    if (!told) return;
    if (told.conflicts) return say(`${told.error}: it is '${told.conflicts[0].theirs}' now.`, "error", { "Load the page again": () => location.reload() });
    say("");
    form.value.value = told.value;
    form.dataset.done = told.wrong.length ? "wrong" : "right";
    form.parentElement.querySelector("p")?.remove();
    form.after(element("p", { class: told.wrong.length ? "bad" : "good" }, ...prose(told.wrong.length ? told.wrong.join(" ") : "Written.")));
    const left = [...document.querySelectorAll(".todos form:not([data-done=right])")];
    if (!left.length) return location.reload();
    (told.wrong.length ? form : left.find((one) => one.compareDocumentPosition(form) & Node.DOCUMENT_POSITION_PRECEDING) ?? left[0]).value.focus();
  });
}
for (const what of ["run", "dry", "end"]) $(what).addEventListener("click", () => act(what).catch(() => {}));
follow();

const { faults, warnings, plan } = await ask("/api/check");
$("checking").textContent = faults.length ? "A run would fail with:" : warnings.length ? "A run goes on with these:" : plan ? `All is well. ${plan}` : "Nothing else is wrong.";
$("checked").replaceChildren(...[...faults, ...(faults.length ? [] : warnings)].map((one) =>
  element("li", {}, element("code", {}, one.line ? `${one.file} line ${one.line}` : one.file), ...prose(`: ${one.walk ? `${one.walk}: ` : ""}${one.text}`))));
