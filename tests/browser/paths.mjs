// Along the camera paths of tests/paths, with answers that come late, out of order, damaged or not at all and a cache that holds a
// part of them, every frame is whole.
//
// A frame is drawn over two backgrounds, with what is drawn kept as it is. Where a pixel shows both and the surface covers all of its four
// samples is a hole. What covers them is told by picking, which knows levels at rest: hence the transition `none`, in which all are. With the
// others the same engine flies in tests/tests/paths.rs.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { ROOT } from "./harness.mjs";
import { ViewerPage } from "./viewer_page.mjs";

const PATHS = ["approach", "orbit", "fly-through", "teleport", "oscillation"];
const SIZE = { width: 320, height: 240 };
/** Whether to look at every frame, and at more scans. */
export const ALL_VIEWS = process.env.MARQUETRY_ALL_VIEWS === "1";
/** Of the frames of a path one in so many is looked at. */
const LOOK_AT_ONE_IN = ALL_VIEWS ? 1 : 10;
/** How often paths are flown again at most until something had to go from the cache. */
const MOST_TURNS = 8;
/** What no surface here is, and what differs from it in all channels. */
const BACKGROUNDS = ["ff00ff", "00ff00"];

/** Runs in the page before its own scripts: an unreliable network, once `window.network.isBad`. */
function unreliable() {
  // A failure and damage are among the first four answers.
  let seed = 21;
  const random = () => {
    seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
    return seed / 2 ** 32;
  };
  const network = { isBad: false, late: 0, failed: 0, damaged: 0 };
  window.network = network;
  const fetch = window.fetch;
  window.fetch = async (input, init) => {
    const answer = await fetch(input, init);
    if (!network.isBad || !/\.marq$|\/pages\//.test(answer.url)) return answer;
    const [delay, fate] = [400 * random(), random()];
    const bytes = new Uint8Array(await answer.arrayBuffer());
    await new Promise((done) => setTimeout(done, delay));
    network.late += 1;
    if (fate < 0.2) {
      network.failed += 1;
      throw new TypeError("the network failed");
    }
    if (fate < 0.4 && bytes.length > 0) {
      network.damaged += 1;
      bytes[Math.floor(random() * bytes.length)] ^= 1 << Math.floor(8 * random());
    }
    return new Response(bytes, { status: answer.status, headers: answer.headers });
  };
}

/** Runs in the page: flies one path; what it saw. */
async function fly({ cameras, every, backgrounds, isTorn }) {
  const viewer = document.querySelector("marquetry-viewer");
  const { min, max } = viewer.facts().bounds;
  const centre = min.map((low, k) => (low + max[k]) / 2);
  const radius = Math.hypot(...min.map((low, k) => max[k] - low)) / 2;
  const nextFrame = () => new Promise(requestAnimationFrame);
  const texels = async (png) => {
    const image = await createImageBitmap(await png);
    const context = new OffscreenCanvas(image.width, image.height).getContext("2d");
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, image.width, image.height);
  };
  // Around the places of the samples, since the device has rounded corners of triangles.
  const samples = [[-0.125, -0.375], [0.375, -0.125], [-0.375, 0.125], [0.125, 0.375]];
  const around = ([x, y]) => [[-1, 0], [1, 0], [0, -1], [0, 1]].map(([dx, dy]) => [x + dx / 16, y + dy / 16]);
  // Sheets of torn scans end on others' edges, where they leave gaps of their own: there one triangle has to be all around. It is told by its
  // normal, which many have in common only where a scan was cut off along an axis.
  const isOneTriangle = ([{ normal: first }, ...rest]) =>
    first.every((value) => Math.abs(value) < 1) && rest.every(({ normal }) => normal.every((value, axis) => value === first[axis]));
  const isCovered = (x, y, sample) => {
    const picks = [];
    for (const [dx, dy] of around(sample)) {
      const pick = viewer.pick(x + 0.5 + dx, y + 0.5 + dy);
      // Nearly all of the places that are asked about are beside the surface.
      if (pick === null) return false;
      picks.push(pick);
    }
    return !isTorn || isOneTriangle(picks);
  };
  const isInside = (x, y) => samples.every((sample) => isCovered(x, y, sample));
  // Whether two colours differ as the backgrounds do behind it, at one sample of four at least.
  const opposed = (a, b, at) =>
    [1, -1, 1].every((sign, channel) => sign * (a.data[at + channel] - b.data[at + channel]) > 24);
  const holes = (a, b) => {
    const found = [];
    for (let at = 0; at < a.data.length; at += 4) {
      if (!opposed(a, b, at)) continue;
      const [x, y] = [(at / 4) % a.width, Math.floor(at / 4 / a.width)];
      if (isInside(x, y)) found.push([x, y]);
    }
    return found;
  };
  const seen = { frames: 0, surface: 0, missing: 0, selfChecked: 0 };
  for (const [number, place] of cameras.entries()) {
    viewer.camera = place.map((value, k) => centre[k % 3] + radius * value).join(",");
    await nextFrame();
    await nextFrame();
    if (number % every > 0) continue;
    viewer.frozen = true;
    // What was decided for this camera is drawn, and stays until the picks are done.
    await nextFrame();
    await nextFrame();
    const [first, second] = backgrounds;
    const pngs = [first, second, first].map((background) => {
      viewer.setAttribute("background", background);
      return viewer.screenshot();
    });
    const [a, b, again] = [await texels(pngs[0]), await texels(pngs[1]), await texels(pngs[2])];
    if (a.data.some((value, at) => value !== again.data[at])) throw new Error("what is frozen changed");
    const found = holes(a, b);
    if (found.length > 0) return { ...seen, camera: viewer.camera, frame: number, holes: found };
    for (let at = 0; at < a.data.length; at += 4) {
      const differs = opposed(a, b, at);
      seen.surface += differs ? 0 : 1;
    }
    // A hole that is made would be found.
    const middleRow = 4 * a.width * Math.floor(a.height / 2);
    for (let x = 0; x < a.width; x += 8) {
      const at = middleRow + 4 * x;
      if (opposed(a, b, at) || !isInside(x, Math.floor(a.height / 2))) continue;
      a.data.set([255, 0, 255], at);
      b.data.set([0, 255, 0], at);
      if (holes(a, b).length !== 1) throw new Error("a hole was made and not found");
      seen.selfChecked += 1;
      break;
    }
    seen.missing += viewer.stats().pages.missing > 0 ? 1 : 0;
    viewer.frozen = false;
    seen.frames += 1;
  }
  return { ...seen, holes: [] };
}

/**
 * Flies all paths over file `name` of `server`, with a cache of `cacheBytes`, which should not hold what the closest view takes.
 * Scans that are torn have gaps of their own.
 */
export async function flyPaths(checks, chromium, server, name, cacheBytes, isTorn = false) {
  const viewer = await ViewerPage.open(chromium, `${server.url}/?file=${name}`, {
    size: SIZE,
    prepare: (page) => page.addInitScript(unreliable),
  });
  await viewer.state("ready", "settled");
  await viewer.read((element, bytes) => {
    element.setAttribute("transition", "none");
    element.setAttribute("cache", String(bytes));
  }, cacheBytes);
  await viewer.page.evaluate(() => (window.network.isBad = true));
  let selfChecked = 0;
  const flyAlong = async (path) => {
    const { cameras } = JSON.parse(readFileSync(join(ROOT, "tests/paths", `${path}.json`), "utf8"));
    const seen = await viewer.page.evaluate(fly, { cameras, every: LOOK_AT_ONE_IN, backgrounds: BACKGROUNDS, isTorn });
    assert.deepEqual(seen.holes, [], JSON.stringify(seen));
    assert.equal(seen.frames, Math.ceil(cameras.length / LOOK_AT_ONE_IN));
    assert.ok(seen.surface > 5000, JSON.stringify(seen));
    selfChecked += seen.selfChecked;
    return `${seen.frames} frames, ${seen.missing} of them with pages missing`;
  };
  for (const path of PATHS) await checks.run(`${name} is whole along the path ${path}`, () => flyAlong(path));
  await checks.run("there were faults and evictions on the way", async () => {
    const hadAll = async () => {
      const { failed, damaged } = await viewer.page.evaluate(() => window.network);
      const { cache } = await viewer.read((element) => element.stats());
      return failed > 0 && damaged > 0 && cache.evictions > 0;
    };
    // How much comes in the time that a path takes is the machine's affair: where that was little it is flown on.
    for (let turn = 0; turn < MOST_TURNS && !(await hadAll()); turn++) {
      await viewer.page.waitForTimeout(1000);
      await flyAlong(["approach", "teleport"][turn % 2]);
    }
    const network = await viewer.page.evaluate(() => window.network);
    const { cache } = await viewer.read((element) => element.stats());
    assert.ok(network.failed > 0 && network.damaged > 0 && cache.evictions > 0 && selfChecked > 0, JSON.stringify({ network, cache, selfChecked }));
    assert.ok(cache.used_bytes <= cache.capacity_bytes);
    return `${network.late} answers late, ${network.failed} failures, ${network.damaged} damaged, ${cache.evictions} evictions`;
  });
  await viewer.close();
}
