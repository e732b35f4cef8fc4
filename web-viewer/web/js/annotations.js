// Notes at places of the model, from a JSON file beside it. docs/annotations.md describes the file.

import { html, moveTo } from "./overlay.js";
import { LoadError } from "./source.js";

const MOST_BYTES = 1024 * 1024;
const MOST_NOTES = 1000;
const LONGEST_TITLE = 200;
const LONGEST_TEXT = 4000;
/** Pins that are looked for along their ray after one picture; the rest follow. */
const CHECKED_AT_ONCE = 16;

/** Checks the text of an annotations file; the notes in it, or an error that says what is wrong and where. */
export function parse(text) {
  let file;
  try {
    file = JSON.parse(text);
  } catch (error) {
    throw new Error(`is no JSON: ${error.message}`);
  }
  if (file?.version !== 1) throw new Error("has no `version` 1");
  const { annotations } = file;
  if (!Array.isArray(annotations)) throw new Error("has no list `annotations`");
  if (annotations.length > MOST_NOTES) throw new Error(`has ${annotations.length} annotations; ${MOST_NOTES} are the most`);
  return annotations.map((note, i) => {
    const wrong = (what) => new Error(`annotation ${i}: ${what}`);
    const { position, title = "", text = "", camera = "" } = note ?? {};
    const isPoint = Array.isArray(position) && position.length === 3 && position.every(Number.isFinite);
    if (!isPoint) throw wrong("`position` is not three numbers");
    if (typeof title !== "string" || title.length > LONGEST_TITLE) throw wrong(`\`title\` is no text of at most ${LONGEST_TITLE} characters`);
    if (typeof text !== "string" || text.length > LONGEST_TEXT) throw wrong(`\`text\` is no text of at most ${LONGEST_TEXT} characters`);
    if (!title && !text) throw wrong("has neither `title` nor `text`");
    if (typeof camera !== "string") throw wrong("`camera` is no text");
    return { position, title, text, camera };
  });
}

/** Fetches and checks an annotations file. */
export async function load(url, signal) {
  let response;
  try {
    response = await fetch(url, { signal });
  } catch (error) {
    throw signal.aborted ? error : new LoadError(`annotations: ${url} cannot be reached`);
  }
  if (!response.ok) throw new LoadError(`annotations: ${url} cannot be had (HTTP ${response.status})`, response.status);
  const size = Number(response.headers.get("Content-Length") ?? 0);
  const text = size > MOST_BYTES ? "" : await response.text();
  if (size > MOST_BYTES || text.length > MOST_BYTES) throw new Error(`annotations: ${url} has more than ${MOST_BYTES} bytes`);
  try {
    return parse(text);
  } catch (error) {
    throw new Error(`annotations: ${url} ${error.message}`);
  }
}

/** Pins over the picture; their text shows when they have the focus. */
export class Annotations {
  #overlay;
  #isInSight;
  #show;
  #pins = [];
  #note = html("div", "note");
  #open = null;
  #next = 0;
  #unchecked = 0;

  /** `isInSight(point)` says whether nothing hides it; `show(note)` is called when a pin is chosen. */
  constructor(overlay, isInSight, show) {
    this.#overlay = overlay;
    this.#isInSight = isInSight;
    this.#show = show;
    this.#note.hidden = true;
    this.#note.id = "note";
    overlay.element.append(this.#note);
    overlay.add(this);
  }

  get count() {
    return this.#pins.length;
  }

  /** Shows these notes and no others. */
  set(notes) {
    for (const { button } of this.#pins) button.remove();
    this.#close();
    this.#pins = notes.map((note, i) => {
      const button = html("button", "pin");
      button.type = "button";
      button.textContent = String(i + 1);
      button.setAttribute("aria-label", `Annotation ${i + 1}: ${note.title || note.text}`);
      button.setAttribute("aria-describedby", "note");
      const pin = { note, button };
      button.addEventListener("focus", () => this.#openPin(pin));
      button.addEventListener("blur", () => this.#close());
      button.addEventListener("click", () => {
        this.#openPin(pin);
        this.#show(note);
      });
      // The host's keys and gestures are not for a pin.
      for (const type of ["pointerdown", "dblclick"]) button.addEventListener(type, (event) => event.stopPropagation());
      button.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === " ") event.stopPropagation();
        if (event.key === "Escape") this.#close();
      });
      this.#overlay.element.append(button);
      return pin;
    });
    this.#changed();
  }

  place() {
    const { project } = this.#overlay;
    this.#unchecked = this.#pins.length;
    for (const { note, button } of this.#pins) {
      const place = project(note.position);
      button.hidden = place === null;
      if (place) moveTo(button, ...place);
    }
    this.#placeNote();
    return this.check();
  }

  /** Looks for some of the pins along their rays; true while some are left. */
  check() {
    const count = Math.min(this.#unchecked, CHECKED_AT_ONCE);
    for (let i = 0; i < count; i++) {
      const { note, button } = this.#pins[this.#next % this.#pins.length];
      button.classList.toggle("behind", !button.hidden && !this.#isInSight(note.position));
      this.#next = (this.#next + 1) % this.#pins.length;
    }
    this.#unchecked -= count;
    return this.#unchecked > 0;
  }

  #changed() {
    this.#next = 0;
    this.place();
  }

  #openPin(pin) {
    this.#open = pin;
    const title = document.createElement("strong");
    title.textContent = pin.note.title;
    this.#note.replaceChildren(...(pin.note.title ? [title] : []), pin.note.text);
    this.#note.hidden = false;
    this.#placeNote();
  }

  #close() {
    this.#open = null;
    this.#note.hidden = true;
  }

  #placeNote() {
    if (!this.#open) return;
    const place = this.#overlay.project(this.#open.note.position);
    this.#note.hidden = place === null;
    if (!place) return;
    const { clientWidth: width, clientHeight: height } = this.#overlay.element;
    const { offsetWidth, offsetHeight } = this.#note;
    const x = Math.max(8, Math.min(place[0] - offsetWidth / 2, width - offsetWidth - 8));
    const below = place[1] + 20;
    const y = below + offsetHeight > height ? place[1] - 20 - offsetHeight : below;
    moveTo(this.#note, x, Math.max(8, y));
  }
}
