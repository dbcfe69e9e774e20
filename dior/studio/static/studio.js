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

/** The same for what is to be written into a file: an error says that it is not. */
export async function write(path, content) {
  return send(path, content).catch((error) => { throw error.said ? failed(`Not written: ${error.message}`) : error; });
}

async function reach(address, options) {
  try {
    return await awaited(fetch(address, options));
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

const GLANCE_MS = 300; // chosen: what is there sooner needs no word
let [waiting, since] = [0, 0];

/** The same promise; the page says that it is at work where that takes longer than a glance. */
export async function awaited(promise) {
  if (!waiting) since = performance.now();
  waiting += 1;
  setTimeout(busy, GLANCE_MS);
  try {
    return await promise;
  } finally {
    waiting -= 1;
    busy();
  }
}

function busy() {
  document.body.toggleAttribute("data-busy", waiting > 0 && performance.now() - since >= GLANCE_MS - 1);
}

function failed(text) {
  say(text, "error");
  return Object.assign(new Error(text), { said: true });
}

/** Say a sentence on top of the page; `kind` "error", or "" for good news. `buttons`: names and what they do. */
export function say(text, kind = "", buttons = {}) {
  const place = document.getElementById("said");
  if (!text) return place.replaceChildren();
  const words = element("p", { class: kind }, ...prose(text));
  for (const [name, act] of Object.entries(buttons)) {
    words.append(element("button", { type: "button", onclick: () => { say(""); act(); } }, name));
  }
  place.replaceChildren(words);
}

/** "1 mark", "2 marks". */
export const many = (count, what) => `${count} ${what}${count === 1 ? "" : "s"}`;

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

/** The parts of a text; what is between backticks is code. */
export function prose(text) {
  return text.split("`").map((part, i) => (i % 2 ? element("code", {}, part) : part));
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

const REMEMBERED_MS = 400;
const address = { words: {}, at: -Infinity, timer: null };

/** Put words into the address, so that the page can be linked and loaded again; "" takes one out. While they change fast
 * the last ones get there: a browser asks for the page's icon at each change, before the next picture, and some allow a
 * hundred in half a minute. */
export function remember(words) {
  Object.assign(address.words, words);
  clearTimeout(address.timer);
  const wait = address.at + REMEMBERED_MS - performance.now();
  if (wait > 0) address.timer = setTimeout(putIntoAddress, wait);
  else putIntoAddress();
}

function putIntoAddress() {
  const query = new URLSearchParams(location.search);
  for (const [key, value] of Object.entries(address.words)) {
    if (value === "" || value === null) query.delete(key);
    else query.set(key, value);
  }
  address.words = {};
  address.at = performance.now();
  history.replaceState(null, "", `${location.pathname}?${query}`);
}

/** Fill a list to choose from, and choose `wanted` or else the first. */
export function fill(select, options, wanted) {
  select.replaceChildren(...options.map(([value, text]) => element("option", { value }, text)));
  if (options.some(([value]) => value === wanted)) select.value = wanted;
}

/** Call `undo` for Ctrl Z, and `redo` for Ctrl Y and Ctrl Shift Z, outside of fields, which have an undo of their own. */
export function onUndo(undo, redo) {
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey || event.target.closest("input[type=text], input[type=number]")) return;
    const name = event.key.toLowerCase();
    if (name === "z" && !event.shiftKey) undo();
    else if (name === "y" || name === "z") redo();
    else return;
    event.preventDefault();
  });
}

/** Call `act(key, event)` for keys that are pressed outside of fields to type in. What was clicked with the mouse gives the
 * focus back: Enter is then the page's. */
export function onKeys(act) {
  document.addEventListener("click", (event) => {
    if (event.detail) event.target.closest("summary, button, input[type=checkbox]")?.blur();
  });
  document.addEventListener("keydown", (event) => {
    const field = event.target.closest("input:not([type=range]):not([type=checkbox]), select, textarea");
    if (field || event.ctrlKey || event.metaKey || event.altKey) return;
    if (act(event.key, event)) event.preventDefault();
  });
}
