// The page under test, as a user and as a spy.

/** Time limit of one wait: software WebGPU on two busy cores is slow. */
export const PATIENCE_MS = 400_000;

/** Runs in the page before its own scripts: counts requests for the file, and drawing. */
function spy() {
  const log = { requests: [], submits: 0, events: [], atReady: null };
  const devices = [];
  // Devices cannot be sent to the test, so they are no part of what is.
  Object.defineProperty(log, "devices", { get: () => devices, enumerable: false });
  window.spy = log;
  const fetch = window.fetch;
  window.fetch = (input, init) => {
    const url = new URL(typeof input === "string" ? input : (input.url ?? input.href), document.baseURI).pathname;
    if (url.endsWith(".marq") || url.startsWith("/pages/")) {
      log.requests.push({ url, range: init?.headers?.Range ?? null });
    }
    return fetch(input, init);
  };
  if (window.GPUAdapter) {
    const request = GPUAdapter.prototype.requestDevice;
    GPUAdapter.prototype.requestDevice = async function (...options) {
      const device = await request.apply(this, options);
      devices.push(device);
      return device;
    };
  }
  if (window.GPUQueue) {
    const submit = GPUQueue.prototype.submit;
    GPUQueue.prototype.submit = function (...commands) {
      log.submits += 1;
      return submit.apply(this, commands);
    };
  }
  for (const type of ["ready", "settled", "error", "progress"]) {
    // These events do not bubble, but the capture phase passes here.
    window.addEventListener(
      type,
      (event) => {
        if (event.target?.localName !== "marquetry-viewer") return;
        log.events.push({ type, ...event.detail });
        if (type === "ready") log.atReady = [...log.requests];
      },
      true,
    );
  }
}

/** A tab with the viewer. */
export class ViewerPage {
  /** What the page complained about. */
  complaints = [];

  static async open(browser, url, { size = { width: 640, height: 480 }, prepare, scheme = "dark" } = {}) {
    const context = await browser.newContext({ viewport: size, deviceScaleFactor: 1, colorScheme: scheme });
    const page = await context.newPage();
    const viewer = new ViewerPage(page, context);
    page.on("console", (message) => {
      if (message.type() === "error") viewer.complaints.push(message.text());
    });
    page.on("pageerror", (error) => viewer.complaints.push(String(error)));
    await page.addInitScript(spy);
    await prepare?.(page);
    await page.goto(url);
    return viewer;
  }

  constructor(page, context) {
    this.page = page;
    this.context = context;
  }

  close() {
    return this.context.close();
  }

  /** Evaluates `read(viewer element)`. */
  read(read, argument) {
    return this.page.locator("marquetry-viewer").evaluate(read, argument);
  }

  spied() {
    return this.page.evaluate(() => window.spy);
  }

  async state(...wanted) {
    const reached = await this.page.waitForFunction(
      (wanted) => {
        const state = document.querySelector("marquetry-viewer")?.state;
        return state === "failed" || wanted.includes(state) ? state : null;
      },
      wanted,
      { timeout: PATIENCE_MS, polling: 100 },
    );
    const state = await reached.jsonValue();
    if (!wanted.includes(state)) throw new Error(`the viewer is ${state}: ${await this.alert()}`);
  }

  settle() {
    return this.state("settled");
  }

  /** Waits until input that was just given is settled, the frame it takes to be noticed included. */
  async rest() {
    await this.page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
    await this.settle();
  }

  /** The camera as six numbers. */
  async camera() {
    return (await this.read((viewer) => viewer.camera)).split(",").map(Number);
  }

  canvas() {
    return this.read((viewer) => {
      const { width, height } = viewer.shadowRoot.querySelector("canvas");
      return { width, height };
    });
  }

  /** The picture as PNG bytes. */
  async screenshot() {
    const base64 = await this.read(async (viewer) => {
      const bytes = new Uint8Array(await (await viewer.screenshot()).arrayBuffer());
      let text = "";
      for (const byte of bytes) text += String.fromCharCode(byte);
      return btoa(text);
    });
    return Buffer.from(base64, "base64");
  }

  /** What the user is told instead of a picture. */
  alert() {
    return this.read((viewer) => viewer.shadowRoot.querySelector(".alert").innerText);
  }

  /** Middle of the viewer in the page. */
  async middle() {
    const box = await this.page.locator("marquetry-viewer").boundingBox();
    return [box.x + box.width / 2, box.y + box.height / 2];
  }
}
