// What all pages share: asking the server, saying what it says, and the address as the page's state.

/** What the server answers to a question; an error is said on the page and thrown. */
export async function ask(path, params = {}, options = {}) {
  const query = new URLSearchParams(params).toString();
  return answered(await reach(query ? `${path}?${query}` : path, options));
}

/** What the server answers to an object that is sent. Of a conflict the answer has `conflicts`. */
export async function send(path, content) {
  const body = JSON.stringify(content);
  return answered(await reach(path, { method: "POST", body, headers: { "content-type": "application/json" } }));
}

async function reach(address, options) {
  try {
    return await fetch(address, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw failed("The studio does not answer: it has ended, or the line to it is cut. Nothing that is shown here is lost while this page stays open.");
  }
}

async function answered(response) {
  const found = await response.json().catch(() => ({ error: `The studio answers ${response.status}.` }));
  if (response.ok) return found;
  if (response.status === 409) return found;
  throw failed(found.error);
}

function failed(text) {
  say(text, "error");
  return Object.assign(new Error(text), { said: true });
}

/** Say a sentence on top of the page; `kind` "error", or "" for good news. `buttons`: names and what they do. */
export function say(text, kind = "", buttons = {}) {
  const place = document.getElementById("said");
  if (!text) return place.replaceChildren();
  const words = element("p", { class: kind }, text);
  for (const [name, act] of Object.entries(buttons)) {
    words.append(element("button", { type: "button", onclick: () => { say(""); act(); } }, name));
  }
  place.replaceChildren(words);
}

/** An element with attributes (functions are listeners) and children. */
export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value !== null && value !== false) made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children);
  return made;
}

/** The element with an id. */
export const $ = (id) => document.getElementById(id);

/** An element of SVG with attributes and a text. */
export function svg(name, attributes = {}, text = null) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== null) made.textContent = text;
  return made;
}

/** The page's state: the words of its address. */
export function state() {
  return Object.fromEntries(new URLSearchParams(location.search));
}

/** Put words into the address, so that the page can be linked and loaded again; "" takes one out. */
export function remember(words) {
  const query = new URLSearchParams(location.search);
  for (const [key, value] of Object.entries(words)) {
    if (value === "" || value === null) query.delete(key);
    else query.set(key, value);
  }
  history.replaceState(null, "", `${location.pathname}?${query}`);
}

/** Fill a list to choose from, and choose `wanted` or else the first. */
export function fill(select, options, wanted) {
  select.replaceChildren(...options.map(([value, text]) => element("option", { value }, text)));
  if (options.some(([value]) => value === wanted)) select.value = wanted;
}

/** Call `act(key, event)` for keys that are pressed outside of fields to type in. */
export function onKeys(act) {
  document.addEventListener("keydown", (event) => {
    const field = event.target.closest("input:not([type=range]):not([type=checkbox]), select, textarea");
    if (field || event.ctrlKey || event.metaKey || event.altKey) return;
    if (act(event.key, event)) event.preventDefault();
  });
}
