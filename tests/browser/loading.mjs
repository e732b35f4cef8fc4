// What the page's thread does while a scan loads: how long the callbacks of animation frames take, and tasks of 50 ms and more.
//
//   node tests/browser/loading.mjs --marquetry target/release/marquetry --chromium /usr/bin/chromium --file scan.marq [--workers no]
//
// Drawing in software says nothing of a GPU, so compare only runs on the same machine.

import { basename, resolve } from "node:path";
import { Marquetry, browser, options } from "./harness.mjs";
import { ViewerPage } from "./viewer_page.mjs";

const STEPS = 40;
const STEP_MS = 150;
const REST_MS = 15_000;
/** Distance of the eye after all steps over that before. */
const APPROACH = 0.25;

const given = options(["marquetry", "chromium", "file", "workers"]);
const marquetry = new Marquetry(resolve(given.marquetry ?? "target/release/marquetry"));
const file = resolve(given.file);
const server = await marquetry.serve(file);
const chromium = await browser(given.chromium ?? "/usr/bin/chromium");
try {
  const name = encodeURIComponent(basename(file, ".marq"));
  const viewer = await ViewerPage.open(chromium, `${server.url}/?file=${name}`, {
    size: { width: 480, height: 270 },
    prepare: async (page) => {
      await page.addInitScript(watch);
      if (given.workers === "no") await page.addInitScript(() => delete window.Worker);
    },
  });
  await viewer.state("ready", "settled");
  const [x, y, z, ...target] = await viewer.camera();
  for (let step = 1; step <= STEPS; step++) {
    const part = APPROACH ** (step / STEPS);
    const eye = [x, y, z].map((value, axis) => target[axis] + part * (value - target[axis]));
    await viewer.read((element, camera) => (element.camera = camera), [...eye, ...target].join(","));
    await viewer.page.waitForTimeout(STEP_MS);
  }
  // Drawing in software may take for ever to settle; what has come by then will do.
  await viewer.page.waitForTimeout(REST_MS);
  const { frames, tasks } = await viewer.page.evaluate(() => window.watched);
  frames.sort((a, b) => a - b);
  const at = (part) => frames[Math.round(part * (frames.length - 1))].toFixed(1);
  const { decoding, pages } = await viewer.read((element) => element.stats());
  console.log(`frames: ${frames.length}; ms: median ${at(0.5)}, 90th percentile ${at(0.9)}, 99th ${at(0.99)}, max ${at(1)}`);
  console.log(`long tasks: ${tasks.length}, ${tasks.reduce((sum, task) => sum + task, 0).toFixed()} ms`);
  console.log(`pages: ${pages.fetched}, missing ${pages.missing}; decoding: ${JSON.stringify(decoding ?? null)}`);
} finally {
  await chromium.close();
  server.stop();
}

/** Runs in the page before its own scripts. */
function watch() {
  const watched = { frames: [], tasks: [] };
  window.watched = watched;
  const request = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (callback) =>
    request((time) => {
      const start = performance.now();
      callback(time);
      watched.frames.push(performance.now() - start);
    });
  new PerformanceObserver((list) => watched.tasks.push(...list.getEntries().map((entry) => entry.duration))).observe({
    type: "longtask",
    buffered: true,
  });
}
