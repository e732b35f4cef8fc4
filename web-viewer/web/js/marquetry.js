// The custom element:
//
//   <script type="module" src="…/marquetry.js"></script>
//   <marquetry-viewer src="…/dragon.marq" error-px="1" transition="geomorph"></marquetry-viewer>
//
// Attributes: src, error-px, transition, shade, background (RRGGBB), cache (bytes), section (AXIS,PART), camera, time,
// annotations (URL; empty for SRC with .annotations.json in place of .marq).
// Events: ready (first image), progress, settled (nothing missing for this view), camerachange, shadechange, modechange,
// measure, error. marquetry.d.ts has their details, and all members.

import { Annotations, load as loadAnnotations } from "./annotations.js";
import { Decoding } from "./decoding.js";
import { decoders, giveUpWebGpu, loadEngine, MissingGraphics } from "./graphics.js";
import { listen } from "./input.js";
import { Measure } from "./measure.js";
import { OVERLAY_STYLE, Overlay } from "./overlay.js";
import { LoadError, Source } from "./source.js";
import { sentence } from "./text.js";

/** Attributes that are passed to the engine as they are. */
const OPTIONS = ["error-px", "transition", "shade", "background", "cache", "section"];

/** Longest step of the clock, seconds: after a pause nothing jumps. */
const LONGEST_STEP = 0.1;
const FIRST_STEP = 1 / 60;

/** How often to look whether the device is still there while nothing is drawn, milliseconds. */
const WATCH_MS = 1000;
/** Most devices that are tried in a minute before giving up. */
const MOST_RECOVERIES = 3;
const MINUTE_MS = 60_000;
/** Least milliseconds between two looks whether the file is still the same. */
const IDENTITY_PAUSE_MS = 5000;

/** Cache for machines that say they are small. */
const SMALL_CACHE_BYTES = 192 * 1024 * 1024;

const STYLE = `
  :host { display: block; position: relative; overflow: hidden; min-height: 8rem; contain: content; }
  :host([hidden]) { display: none; }
  :host(:focus-visible) { outline: 2px solid Highlight; outline-offset: -2px; }
  canvas { position: absolute; inset: 0; width: 100%; height: 100%; display: block; touch-action: none; cursor: grab; }
  canvas:active { cursor: grabbing; }
  .alert {
    position: absolute; inset: 0; display: grid; place-content: center; justify-items: center; gap: 0.75rem;
    padding: 1.5rem; text-align: center; font: 1rem/1.5 system-ui, sans-serif; color: #e8e6e1; background: #202226;
  }
  .alert[hidden] { display: none; }
  .alert strong { font-size: 1.15rem; }
  .alert p { margin: 0; max-width: 34rem; overflow-wrap: anywhere; }
  .banner { position: absolute; inset: auto 0.75rem 0.75rem; margin: auto; width: fit-content; display: flex; flex-wrap: wrap;
    align-items: center; gap: 0.75rem; padding: 0.5rem 0.9rem; border: 1px solid #e0aa62; border-radius: 0.6rem;
    font: 1rem/1.5 system-ui, sans-serif; color: #e8e6e1; background: #17181bf0; }
  .action { font: inherit; padding: 0.4rem 1.1rem; border-radius: 0.4rem; border: 1px solid #8b8f98; background: none;
    color: inherit; cursor: pointer; }
  .action:hover { background: #8b8f9840; }
  @media (prefers-color-scheme: light) { .alert { color: #23211e; background: #e7e8ea; } }
`;

export class MarquetryViewer extends HTMLElement {
  static observedAttributes = ["src", "camera", "time", "annotations", ...OPTIONS];

  #canvas = document.createElement("canvas");
  #alert = document.createElement("div");
  #life = null;
  #loading = null;
  #gpu = null;
  #view = null;
  #source = null;
  #frame = 0;
  #lastTime = 0;
  #frameMs = NaN;
  #pixels = [0, 0];
  #time = 0;
  #ready = false;
  #settled = false;
  #progress = -1;
  #lastCamera = "";
  #lastShade = "";
  #lastMode = "";
  #overlay = new Overlay((point) => this.project(point));
  #ruler = new Measure(this.#overlay);
  #annotations = new Annotations(
    this.#overlay,
    (point) => this.#view?.isInSight(...point) ?? false,
    (note) => note.camera && this.#attempt(() => (this.camera = note.camera)),
  );
  #banner = document.createElement("div");
  #recoveries = [];
  #replaced = false;
  #identityChecked = 0;
  /** What is decoded where. */
  #decoding = null;

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open" });
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(STYLE + OVERLAY_STYLE);
    root.adoptedStyleSheets = [sheet];
    this.#alert.className = "alert";
    this.#alert.setAttribute("role", "alert");
    this.#banner.className = "banner";
    this.#banner.setAttribute("role", "alert");
    this.#banner.hidden = true;
    // The host would capture the pointer, and the click with it.
    this.#banner.addEventListener("pointerdown", (event) => event.stopPropagation());
    this.#alert.hidden = true;
    this.#canvas.setAttribute("aria-hidden", "true");
    root.append(this.#canvas, this.#overlay.element, this.#alert, this.#banner);
  }

  connectedCallback() {
    if (!this.hasAttribute("tabindex")) this.tabIndex = 0;
    if (!this.hasAttribute("role")) this.setAttribute("role", "application");
    if (!this.hasAttribute("aria-label")) {
      this.setAttribute("aria-label", "3D viewer: arrow keys orbit, with Shift they pan; plus and minus zoom; Home resets; G flies");
    }
    this.#life = new AbortController();
    const { signal } = this.#life;
    this.addEventListener("keydown", (event) => this.#onKey(event), { signal });
    const clicked = (x, y) => this.#clicked(x, y);
    listen(this, () => this.#canvas, () => this.#view, () => this.#wake(), clicked, signal);
    const watch = setInterval(() => this.#view?.isLost && this.#wake(), WATCH_MS);
    signal.addEventListener("abort", () => clearInterval(watch));
    const observer = new ResizeObserver((entries) => this.#measure(entries.at(-1)));
    try {
      observer.observe(this, { box: "device-pixel-content-box" });
    } catch {
      observer.observe(this);
    }
    this.#life.signal.addEventListener("abort", () => observer.disconnect());
    this.#load();
  }

  disconnectedCallback() {
    this.#life?.abort();
    this.#unload();
    this.#dropGpu();
    this.#pixels = [0, 0];
  }

  attributeChangedCallback(name, before, value) {
    if (!this.isConnected || this.#life === null || before === value) return;
    if (name === "src") this.#load();
    else if (name === "annotations") this.#loadAnnotations();
    else if (name === "time") this.#attempt(() => this.setTime(Number(value ?? 0)));
    else if (name === "camera") this.#attempt(() => value !== null && this.#view?.setCamera(value));
    else if (name === "section") this.#attempt(() => this.#view?.setOption(name, value ?? ""));
    else this.#attempt(() => this.#applyOption(name));
    this.#wake();
  }

  /** URL of the file. */
  get src() {
    return this.getAttribute("src") ?? "";
  }

  set src(value) {
    this.setAttribute("src", value);
  }

  /** `eye.x,eye.y,eye.z,target.x,target.y,target.z`, as `marquetry render --camera` takes it; empty before `ready`. */
  get camera() {
    return this.#view?.camera ?? "";
  }

  set camera(value) {
    if (!this.#view) throw new Error("the camera can be set once the viewer is ready");
    this.#view.setCamera(String(value));
    this.#wake();
  }

  /** What the surface's colour shows: lit, normal, lod, wire, unlit. */
  get shade() {
    return this.#view?.shade ?? this.getAttribute("shade") ?? "lit";
  }

  set shade(value) {
    this.setAttribute("shade", value);
    this.#attempt(() => this.#applyOption("shade"));
    this.#wake();
  }

  /** How resolutions change: none, alpha, dither, geomorph. */
  get transition() {
    return this.#view?.transition ?? this.getAttribute("transition") ?? "geomorph";
  }

  set transition(value) {
    this.setAttribute("transition", value);
  }

  /** Where the model is cut open: `AXIS,PART` or `NX,NY,NZ,OFFSET`; empty where it is not. */
  get section() {
    return this.#view?.section ?? this.getAttribute("section") ?? "";
  }

  set section(value) {
    if (value) this.setAttribute("section", value);
    else this.removeAttribute("section");
  }

  /** Whether keys fly instead of orbiting. */
  get flying() {
    return this.#view?.flying ?? false;
  }

  set flying(on) {
    this.#view?.setFlying(Boolean(on));
    this.#wake();
  }

  /** Whether what is drawn stays as it is, wherever one looks from. */
  get frozen() {
    return this.#view?.freeze ?? false;
  }

  set frozen(on) {
    this.#view?.setOption("freeze", String(Boolean(on)));
    this.#wake();
  }

  /** Whether clicks pick points to measure between. */
  get measuring() {
    return this.#ruler.active;
  }

  set measuring(on) {
    if (on !== this.measuring) this.#ruler.active = Boolean(on);
    this.#wake();
  }

  /** What was measured last, in the file's units: distance, error, points. Null before there are two points. */
  get measurement() {
    return this.#ruler.result;
  }

  /**
   * The point of the surface at a place, CSS pixels from the element's upper left corner: position, normal, error (the most
   * that the surface drawn there is away from the source); null on the background.
   */
  pick(x, y) {
    const scale = this.#scale();
    return this.#pickPixel(x / scale, y / scale);
  }

  /** Where a point of the model is, CSS pixels from the element's upper left corner; null behind the eye. */
  project(point) {
    const place = this.#view?.project(...point) ?? [];
    return place.length > 0 ? [place[0] * this.#scale(), place[1] * this.#scale()] : null;
  }

  /** `empty`, `loading`, `ready`, `settled` or `failed`. */
  get state() {
    if (!this.#alert.hidden) return "failed";
    if (this.#ready) return this.#settled ? "settled" : "ready";
    return this.#loading ? "loading" : "empty";
  }

  /** What is drawn and what it took; keys as in `marquetry render --json`. Null before `ready`. */
  stats() {
    if (!this.#view) return null;
    const stats = JSON.parse(this.#view.stats());
    stats.decoding = this.#decoding.stats;
    stats.network = { requests: this.#source.requests, bytes: this.#source.bytes };
    return stats;
  }

  /** Facts of the file: source_triangles, charts, pages. Null before `ready`. */
  facts() {
    return this.#view ? JSON.parse(this.#view.facts()) : null;
  }

  /** The picture as a PNG blob. */
  async screenshot() {
    if (!this.#ready) throw new Error("there is no picture yet");
    // The browser takes the canvas' picture away when this task ends: draw and read in one go.
    if (!this.#view.frame(0, true)) throw new Error("the picture cannot be drawn just now");
    const blob = new Promise((resolve) => this.#canvas.toBlob(resolve, "image/png"));
    this.#wake();
    const png = await blob;
    if (!png) throw new Error("the picture cannot be read");
    return png;
  }

  /** Point in time that a scene is shown at. Scans have no time and look the same at any. */
  setTime(time) {
    if (!Number.isFinite(time)) throw new TypeError("time is a finite number");
    this.#time = time;
    this.#wake();
  }

  /** Point in time that was set. */
  get time() {
    return this.#time;
  }

  /** Loads the file anew. */
  reload() {
    this.#load();
  }

  /** Loads the file; a view that is given is shown again. */
  async #load(kept = null) {
    this.#unload();
    this.#alert.hidden = true;
    this.#banner.hidden = true;
    if (!this.src || !this.isConnected) return;
    const loading = new AbortController();
    this.#loading = loading;
    const gone = () => loading.signal.aborted;
    let opener = null;
    let module;
    try {
      const url = new URL(this.src, document.baseURI).href;
      const source = new Source(url, loading.signal);
      this.#source = source;
      // The first bytes are on their way while the engine loads.
      const first = source.range(0, FIRST_READ_BYTES);
      first.catch(() => {});
      module = await loadEngine();
      opener = new module.Opener();
      let bytes = opener.end === FIRST_READ_BYTES ? await first : null;
      while (!opener.isOpen) {
        bytes ??= await source.range(opener.start, opener.end);
        if (gone()) return;
        opener.feed(bytes);
        bytes = null;
      }
      source.usePages(opener.contentId);
      await this.#openGpu(module);
      if (gone()) return;
      const opened = opener;
      // The view takes it over, also when it refuses it.
      opener = null;
      this.#view = new module.View(this.#gpu, opened);
      this.#decoding = new Decoding(this.#view, decoders(), () => this.#wake());
      this.#applyAll(kept);
      this.#resize();
      this.#wake();
      this.#loadAnnotations();
    } catch (error) {
      if (gone()) return;
      if (error instanceof MissingGraphics && giveUpWebGpu(module)) {
        this.#dropGpu();
        this.#load(kept);
      } else this.#fail(error);
    } finally {
      opener?.free();
    }
  }

  async #openGpu(module) {
    if (this.#gpu) return;
    const canvas = this.#canvas;
    let gpu;
    try {
      gpu = await module.Gpu.open(canvas);
    } catch (error) {
      throw new MissingGraphics(error.message);
    }
    // The viewer may have left the page, or begun anew, meanwhile.
    if (this.#canvas === canvas && !this.#gpu) {
      this.#gpu = gpu;
      // WebGL's way to say that the device is lost.
      canvas.addEventListener("webglcontextlost", () => this.#gpu === gpu && gpu.lose());
    } else {
      gpu.free();
    }
  }

  #dropGpu() {
    this.#gpu?.free();
    this.#gpu = null;
    // A canvas keeps the context that was made for it, so the next device gets another.
    const fresh = this.#canvas.cloneNode();
    this.#canvas.replaceWith(fresh);
    this.#canvas = fresh;
  }

  #unload() {
    this.#loading?.abort();
    this.#loading = null;
    cancelAnimationFrame(this.#frame);
    this.#frame = 0;
    this.#lastTime = 0;
    this.#view?.free();
    this.#view = null;
    this.#decoding?.end();
    this.#decoding = null;
    this.#source = null;
    this.#ready = false;
    this.#settled = false;
    this.#progress = -1;
    this.#lastCamera = "";
    this.#lastShade = "";
    this.#lastMode = "";
    this.#replaced = false;
    this.#ruler.clear();
    this.#annotations.set([]);
  }

  async #loadAnnotations() {
    const loading = this.#loading;
    const given = this.getAttribute("annotations");
    this.#annotations.set([]);
    if (given === null || !this.#view) return;
    const url = new URL(given || this.src.replace(/\.marq(?=$|[?#])/, ".annotations.json"), document.baseURI).href;
    try {
      const notes = await loadAnnotations(url, loading.signal);
      if (!loading.signal.aborted && given === this.getAttribute("annotations")) this.#annotations.set(notes);
    } catch (error) {
      if (!loading.signal.aborted) this.#emit("error", { message: sentence(error.message), fatal: false, kind: "annotations" });
    }
    this.#placeOverlay();
  }

  /** What a reader chose, to be shown again after a new start. */
  #keep() {
    if (!this.#view) return null;
    const { camera, shade, transition, section, freeze } = this.#view;
    return { camera, options: { shade, transition, section, freeze: String(freeze) } };
  }

  /** Starts again on a new device, as one that was lost comes back after a moment. */
  #recover(error) {
    const now = performance.now();
    this.#recoveries = this.#recoveries.filter((time) => now - time < MINUTE_MS);
    if (this.#recoveries.length >= MOST_RECOVERIES) {
      this.#fail(error);
      this.#dropGpu();
      return;
    }
    this.#recoveries.push(now);
    const kept = this.#keep();
    this.#emit("error", { message: `${sentence(error.message)} Starting again.`, fatal: false, kind: "device" });
    this.#unload();
    this.#dropGpu();
    this.#load(kept);
  }

  /** Offers the file that is there now instead of the one that is shown. */
  #offerReload() {
    if (this.#replaced) return;
    this.#replaced = true;
    const text = document.createElement("span");
    text.textContent = "The file was replaced on the server.";
    const button = document.createElement("button");
    button.type = "button";
    button.className = "action";
    button.textContent = "Load the new one";
    button.addEventListener("click", () => this.#load(this.#keep()));
    this.#banner.replaceChildren(text, button);
    this.#banner.hidden = false;
    this.#emit("error", { message: text.textContent, fatal: false, kind: "replaced" });
  }

  /** After a failure: whether the file is still the one that was opened. */
  async #checkIdentity(error) {
    const source = this.#source;
    if (error.status === 410) this.#offerReload();
    const now = performance.now();
    if (this.#replaced || now - this.#identityChecked < IDENTITY_PAUSE_MS) return;
    this.#identityChecked = now;
    const isSame = await source.isSame().catch(() => true);
    if (!isSame && this.#source === source) this.#offerReload();
  }

  #scale() {
    const { width } = this.#canvas;
    return width > 0 ? this.#canvas.clientWidth / width : 1;
  }

  #pickPixel(x, y) {
    const found = this.#view?.pick(x, y) ?? [];
    if (found.length === 0) return null;
    return { position: Array.from(found.subarray(0, 3)), normal: Array.from(found.subarray(3, 6)), error: found[6] };
  }

  /** A click or a tap at a pixel of the canvas; whether that means something here. */
  #clicked(x, y) {
    if (!this.#ruler.active) return false;
    const result = this.#ruler.take(this.#pickPixel(x, y));
    if (result) this.#emit("measure", result);
    return true;
  }

  #onKey(event) {
    if (!this.#ruler.active || event.defaultPrevented || event.composedPath()[0] !== this) return;
    if (event.key === "Enter") this.#clicked(this.#canvas.width / 2, this.#canvas.height / 2);
    else if (event.key === "Escape") {
      if (!this.#ruler.clear()) this.measuring = false;
    } else return;
    event.preventDefault();
    this.#wake();
  }

  #placeOverlay() {
    const again = () => this.#annotations.check() && requestAnimationFrame(again);
    if (this.#overlay.place()) requestAnimationFrame(again);
  }

  #applyAll(kept) {
    // What a machine can hold is a guess; an attribute overrules it.
    if ((navigator.deviceMemory ?? 8) <= 4) this.#view.setOption("cache", String(SMALL_CACHE_BYTES));
    for (const name of OPTIONS) this.#attempt(() => this.#applyOption(name));
    for (const [name, value] of Object.entries(kept?.options ?? {})) this.#attempt(() => this.#view.setOption(name, value));
    const camera = kept?.camera ?? this.getAttribute("camera");
    if (camera) this.#attempt(() => this.#view.setCamera(camera));
    const time = this.getAttribute("time");
    if (time !== null) this.#attempt(() => this.setTime(Number(time)));
  }

  #applyOption(name) {
    const value = this.getAttribute(name);
    if (value !== null) this.#view?.setOption(name, value);
  }

  /** Does what a page asked for; a wrong value is reported and changes nothing. */
  #attempt(change) {
    try {
      change();
    } catch (error) {
      this.#emit("error", { message: sentence(error.message), fatal: false, kind: "option" });
    }
  }

  #measure(entry) {
    const box = entry.devicePixelContentBoxSize?.[0];
    const scale = devicePixelRatio || 1;
    this.#pixels = box
      ? [box.inlineSize, box.blockSize]
      : [Math.round(entry.contentRect.width * scale), Math.round(entry.contentRect.height * scale)];
    this.#resize();
    this.#wake();
  }

  #resize() {
    const [width, height] = this.#pixels;
    if (!this.#view || width < 1 || height < 1) return;
    const shrink = Math.min(1, this.#gpu.maxSize / Math.max(width, height));
    this.#canvas.width = Math.max(1, Math.floor(width * shrink));
    this.#canvas.height = Math.max(1, Math.floor(height * shrink));
    this.#view.resize(this.#canvas.width, this.#canvas.height);
  }

  #wake() {
    if (this.#view && !this.#frame) this.#frame = requestAnimationFrame((time) => this.#tick(time));
  }

  #tick(time) {
    this.#frame = 0;
    const view = this.#view;
    const [width, height] = this.#pixels;
    if (!view || width < 1 || height < 1) return;
    const step = this.#lastTime ? (time - this.#lastTime) / 1000 : FIRST_STEP;
    const start = performance.now();
    let drew;
    try {
      this.#decoding.decodeHere(1000 * step);
      drew = view.frame(Math.min(Math.max(step, 0), LONGEST_STEP), false);
    } catch (error) {
      if (view.isLost) {
        this.#recover(error);
        return;
      }
      this.#fail(error);
      // Whatever it was, the device is not to be trusted any more.
      this.#dropGpu();
      return;
    }
    if (drew) {
      this.#frameMs = this.#lastTime ? time - this.#lastTime : this.#frameMs;
      view.setTimes(this.#frameMs, performance.now() - start);
    }
    const again = view.wantsFrame;
    this.#lastTime = again ? time : 0;
    if (again) this.#wake();
    if (drew) this.#placeOverlay();
    this.#decoding.feed();
    this.#report(drew);
    // Whoever listened may have loaded another file.
    if (this.#view === view) this.#fetchAll();
  }

  #fetchAll() {
    const view = this.#view;
    const source = this.#source;
    const numbers = view.takeRequests();
    if (this.#replaced) {
      // What is there belongs to another file; what is shown stays.
      for (let i = 0; i < numbers.length; i += 6) view.fail(numbers[i], "the file was replaced on the server");
      return;
    }
    for (let i = 0; i < numbers.length; i += 6) {
      const id = numbers[i];
      const [pages, first, last, start, end] = Array.from(numbers.subarray(i + 1, i + 6), Number);
      const answer = pages ? source.pages(first, last, start, end) : source.range(start, end);
      answer.then(
        (bytes) => this.#view === view && view.deliver(id, bytes),
        (error) => {
          if (this.#view !== view) return;
          view.fail(id, error.message);
          this.#checkIdentity(error);
        },
      ).then(() => this.#view === view && this.#wake());
    }
  }

  #report(drew) {
    const cost = { requests: this.#source.requests, bytes: this.#source.bytes };
    const { progress, camera, shade, isSettled } = this.#view;
    const events = [];
    if (drew && !this.#ready) {
      this.#ready = true;
      events.push(["ready", cost]);
    }
    const failures = this.#view.takeFailures();
    if (failures.length > 0 && !this.#replaced) {
      // Bytes that came but are not what they should be: of another file, perhaps.
      this.#checkIdentity({});
      events.push(["error", { message: sentence(failures.at(-1)), fatal: false, kind: "network" }]);
    }
    if (Math.abs(progress - this.#progress) > 0.002 || (isSettled && this.#progress !== progress)) {
      this.#progress = progress;
      events.push(["progress", { progress, ...cost }]);
    }
    if (camera !== this.#lastCamera) {
      this.#lastCamera = camera;
      events.push(["camerachange", { camera }]);
    }
    if (shade !== this.#lastShade) {
      this.#lastShade = shade;
      events.push(["shadechange", { shade }]);
    }
    const mode = { flying: this.flying, frozen: this.frozen, measuring: this.measuring };
    if (JSON.stringify(mode) !== this.#lastMode) {
      this.#lastMode = JSON.stringify(mode);
      events.push(["modechange", mode]);
    }
    if (this.#ready && isSettled !== this.#settled) {
      this.#settled = isSettled;
      if (isSettled) events.push(["settled", cost]);
    }
    for (const [type, detail] of events) this.#emit(type, detail);
  }

  #fail(error) {
    const kind = error instanceof MissingGraphics ? "graphics" : error instanceof LoadError ? "network" : "file";
    const title = kind === "graphics" ? "This browser cannot draw in three dimensions" : "This scan cannot be shown";
    const message = sentence(error.message);
    this.#unload();
    const heading = document.createElement("strong");
    heading.textContent = title;
    const text = document.createElement("p");
    text.textContent = message;
    const retry = document.createElement("button");
    retry.type = "button";
    retry.className = "action";
    retry.textContent = "Try again";
    retry.addEventListener("click", () => this.reload());
    this.#alert.replaceChildren(heading, text, retry);
    this.#alert.hidden = false;
    this.#emit("error", { message, fatal: true, kind });
  }

  #emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}

/** Bytes of the first read; the engine says so too, but is not here yet when it begins. */
const FIRST_READ_BYTES = 64 * 1024;

if (!customElements.get("marquetry-viewer")) customElements.define("marquetry-viewer", MarquetryViewer);
