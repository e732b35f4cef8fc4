// The browser test: the real page, from the real server, in headless Chromium with WebGPU in software.
//
//   node tests/browser/run.mjs --marquetry target/release/marquetry --chromium /usr/bin/chromium --out target/browser

import assert from "node:assert/strict";
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { Checks, Marquetry, ROOT, browser, decode, options, scan, texturedScan } from "./harness.mjs";
import { ALL_VIEWS, flyPaths } from "./paths.mjs";
import { maskedSsim } from "./ssim.mjs";
import { PATIENCE_MS, ViewerPage } from "./viewer_page.mjs";

/** Requests and bytes that the first image may take. */
const READY_REQUESTS = 2;
const READY_BYTES = 256 * 1024;
/** Least similarity of browser and native picture over the object: two rasterizers differ at its outline. */
const SAME_PICTURE = 0.98;
/** Least similarity of a view and the same view by its link, which rounds the camera to nine digits. */
const SAME_LINK = 0.995;
/** Least similarity of pictures by WebGPU and by WebGL 2. */
const SAME_API = 0.999;
const BACKGROUND = "202226";
/** Pixels of error, and the file, once the picture of the dragon at 1 px is compared. */
const EASY_PX = "8";
/** Fine enough that the light scan takes pages beyond its base. */
const PAGED_PX = "1";
const LIGHT = "second%20one";

const given = options(["marquetry", "chromium", "out"]);
const out = resolve(given.out ?? "target/browser");
const served = join(out, "served");
mkdirSync(served, { recursive: true });
const marquetry = new Marquetry(resolve(given.marquetry ?? "target/release/marquetry"));

const input = scan(out);
const file = join(served, "dragon.marq");
console.log(`  converting ${input} (up to a minute)`);
await marquetry.convert(input, file);
// Comparing pictures takes the dragon, as clusters; everything after that a light scan, for software drawing takes seconds a frame. It has charts.
const light = join(served, "second one.marq");
const lightInput = join(ROOT, "../shared/data/armadillo_86k.obj.gz");
await marquetry.convert(existsSync(lightInput) ? lightInput : input, light, "--charts", "always");
await marquetry.convert(texturedScan(out), join(served, "textured.marq"));

const server = await marquetry.serve(served);
const chromium = await browser(given.chromium ?? "/usr/bin/chromium");
const checks = new Checks();
let main;
try {
  main = await ViewerPage.open(chromium, `${server.url}/?file=dragon`);
  await loading();
  await picture();
  await main.close();
  main = await ViewerPage.open(chromium, `${server.url}/?file=${LIGHT}#error-px=${EASY_PX}`);
  await main.settle();
  await moving();
  await hands();
  await thePage();
  await main.close();
  await decoding();
  await webgl();
  await otherHosts();
  await embedding();
  await failures();
  await paths();
} finally {
  await chromium.close();
  server.stop();
}
process.exitCode = checks.finish() ? 0 : 1;

async function loading() {
  await checks.run("the first image takes few requests", async () => {
    await main.state("ready", "settled");
    const { atReady, events } = await main.spied();
    const ready = events.find((event) => event.type === "ready");
    assert.ok(atReady.length >= 1 && atReady.length <= READY_REQUESTS, JSON.stringify(atReady));
    assert.equal(ready.requests, atReady.length);
    assert.ok(ready.bytes > 0 && ready.bytes <= READY_BYTES, `${ready.bytes} bytes`);
    return `${ready.requests} requests, ${ready.bytes} bytes`;
  });
  await checks.run("the view settles", async () => {
    await main.settle();
    const { events } = await main.spied();
    assert.ok(events.some((event) => event.type === "settled"));
    assert.equal(events.filter((event) => event.type === "progress").at(-1).progress, 1);
    const stats = await main.read((viewer) => viewer.stats());
    assert.equal(stats.pages.missing, 0);
    assert.equal(stats.failures, 0);
    assert.ok(stats.cache.used_bytes <= stats.cache.capacity_bytes);
    return `${stats.triangles} triangles, ${stats.network.bytes} bytes in ${stats.network.requests} requests`;
  });
  await checks.run("pages come from their own URLs", async () => {
    const { requests } = await main.spied();
    assert.ok(requests.some(({ url }) => /^\/pages\/dragon\/[0-9a-f]{32}\/\d+(-\d+)?$/.test(url)));
  });
  await checks.run("nothing is drawn while nothing changes", async () => {
    await main.rest();
    const { submits: before } = await main.spied();
    await main.page.waitForTimeout(1000);
    const { submits: later } = await main.spied();
    assert.ok(before > 0);
    assert.equal(later, before);
  });
}

async function picture() {
  await checks.run("browser and native draw the same picture", async () => {
    const web = await main.screenshot();
    writeFileSync(join(out, "browser.png"), web);
    const size = await main.canvas();
    const camera = await main.read((viewer) => viewer.camera);
    const native = await marquetry.render(file, join(out, "native.png"), { ...size, camera, background: BACKGROUND });
    const { ssim, pixels, total } = maskedSsim(decode(web), native, rgb(BACKGROUND));
    assert.ok(pixels > total / 20, `the object covers ${pixels} of ${total} pixels`);
    assert.ok(ssim >= SAME_PICTURE, `SSIM ${ssim.toFixed(4)} over ${pixels} pixels; see ${out}`);
    return `SSIM ${ssim.toFixed(4)} over ${pixels} pixels`;
  });
}

async function moving() {
  const reset = async () => {
    await main.page.locator("marquetry-viewer").focus();
    await main.page.keyboard.press("Home");
    await main.rest();
  };
  const start = await main.camera();
  const move = async (name, act, check) => {
    await checks.run(name, async () => {
      await reset();
      const before = await main.camera();
      await act(...(await main.middle()));
      await main.rest();
      check(before, await main.camera());
    });
  };
  const mouse = main.page.mouse;
  const drag = (button) => async (x, y) => {
    await mouse.move(x, y);
    await mouse.down({ button });
    await mouse.move(x + 60, y + 20, { steps: 5 });
    await mouse.up({ button });
  };
  await move("dragging orbits", drag("left"), (before, after) => {
    assert.ok(gap(eye(before), eye(after)) > 0.05 * reach(before), "the eye moves");
    assert.ok(gap(target(before), target(after)) < 1e-6 * reach(before), "the target stays");
    assert.ok(Math.abs(reach(after) / reach(before) - 1) < 1e-6, "the distance stays");
  });
  await move("the right button pans", drag("right"), (before, after) => {
    assert.ok(gap(target(before), target(after)) > 0.01 * reach(before), "the target moves");
  });
  await move("the wheel zooms in", async (x, y) => {
    await mouse.move(x, y);
    await mouse.wheel(0, -240);
  }, (before, after) => assert.ok(reach(after) < 0.9 * reach(before)));
  await move("arrow keys orbit", () => main.page.keyboard.press("ArrowRight"), (before, after) => {
    assert.ok(gap(eye(before), eye(after)) > 0.01 * reach(before));
    assert.ok(gap(target(before), target(after)) < 1e-6 * reach(before));
  });
  await move("plus zooms in", () => main.page.keyboard.press("+"), (before, after) =>
    assert.ok(reach(after) < reach(before)));
  await move("two fingers zoom", () => pinch(main), (before, after) => assert.ok(reach(after) < 0.95 * reach(before)));
  await checks.run("Home leads back", async () => {
    await reset();
    const now = await main.camera();
    assert.ok(gap(eye(start), eye(now)) < 1e-6 * reach(start));
  });
  await checks.run("keys and buttons change the shading", async () => {
    await main.page.keyboard.press("l");
    await main.rest();
    assert.equal(await main.read((viewer) => viewer.shade), "lod");
    assert.ok(await main.page.locator("input[value=lod]").isChecked());
    const lod = await main.screenshot();
    await main.page.locator("label", { hasText: "Normals" }).click();
    await main.rest();
    assert.equal(await main.read((viewer) => viewer.shade), "normal");
    const normal = await main.screenshot();
    await main.page.locator("label", { hasText: "Wire" }).click();
    await main.rest();
    const wire = await main.screenshot();
    await main.page.locator("label", { hasText: "Lit" }).click();
    await main.rest();
    const lit = await main.screenshot();
    const pictures = { lod, normal, wire, lit };
    for (const [name, png] of Object.entries(pictures)) writeFileSync(join(out, `shade_${name}.png`), png);
    const distinct = new Set(Object.values(pictures).map((png) => png.toString("base64")));
    assert.equal(distinct.size, 4);
  });
}

/** The tools: focus, measure, section, flight, annotations, a lost device. */
async function hands() {
  const { page } = main;
  const viewer = page.locator("marquetry-viewer");
  const home = async () => {
    await viewer.focus();
    await page.keyboard.press("Home");
    await main.rest();
  };
  const picked = await main.read((viewer) => {
    const { clientWidth: width, clientHeight: height } = viewer;
    return { middle: viewer.pick(width / 2, height / 2), corner: viewer.pick(1, 1), bounds: viewer.facts().bounds };
  });
  await checks.run("a place in the picture is a point of the model, and back", async () => {
    assert.equal(picked.corner, null);
    const { position, error, normal } = picked.middle;
    assert.ok(error > 0 && Math.abs(Math.hypot(...normal) - 1) < 1e-6);
    position.forEach((value, axis) => {
      assert.ok(value >= picked.bounds.min[axis] - error && value <= picked.bounds.max[axis] + error);
    });
    const place = await main.read((viewer, point) => viewer.project(point), position);
    assert.ok(gap(place, await main.read((viewer) => [viewer.clientWidth / 2, viewer.clientHeight / 2])) < 0.01);
  });
  await checks.run("the wheel keeps the point below the pointer", async () => {
    const [x, y] = (await main.middle()).map(Math.round);
    const box = await viewer.boundingBox();
    const at = [x + 20 - box.x, y + 15 - box.y];
    const before = await main.read((viewer, [x, y]) => viewer.pick(x, y), at);
    await page.mouse.move(x + 20, y + 15);
    await page.mouse.wheel(0, -300);
    await main.rest();
    assert.ok(gap(await main.read((viewer, point) => viewer.project(point), before.position), at) < 0.1);
  });
  await checks.run("a double click looks at the point below it", async () => {
    await home();
    const [x, y] = (await main.middle()).map(Math.round);
    const box = await viewer.boundingBox();
    const { position } = await main.read((viewer, [x, y]) => viewer.pick(x, y), [x + 30 - box.x, y - 20 - box.y]);
    await page.mouse.dblclick(x + 30, y - 20);
    await main.rest();
    const camera = await main.camera();
    assert.ok(gap(target(camera), position) < 1e-6 * reach(camera), `${target(camera)}, not ${position}`);
  });
  await checks.run("the distance between two points is measured, by mouse and by keys", async () => {
    await home();
    const [x, y] = await main.middle();
    await page.keyboard.press("m");
    await page.mouse.click(x - 30, y);
    await page.mouse.click(x + 30, y + 10);
    const byMouse = await main.read((viewer) => viewer.measurement);
    assert.ok(byMouse.distance > 0 && byMouse.error > 0);
    assert.ok(Math.abs(gap(...byMouse.points) - byMouse.distance) < 1e-12);
    const tag = viewer.locator(".tag");
    assert.match(await tag.textContent(), /^[\d.]+ ± [\d.]+$/);
    await page.screenshot({ path: join(out, "measure.png") });
    await page.keyboard.press("Enter");
    await page.keyboard.press("ArrowRight");
    await main.rest();
    await page.keyboard.press("Enter");
    const byKeys = await main.read((viewer) => viewer.measurement);
    assert.ok(byKeys.distance > 0 && byKeys.distance !== byMouse.distance);
    await page.keyboard.press("Escape");
    assert.equal(await main.read((viewer) => viewer.measurement), null);
    assert.ok(await tag.isHidden());
    await page.keyboard.press("Escape");
    assert.equal(await main.read((viewer) => viewer.measuring), false);
    return `${byMouse.distance} ± ${byMouse.error}`;
  });
  await checks.run("a section opens the model, and the address keeps it", async () => {
    await home();
    const whole = await main.screenshot();
    await page.keyboard.press("o");
    await page.locator("#section-axis").selectOption("z");
    await page.locator("#transition").selectOption("dither");
    await main.rest();
    assert.equal(await main.read((viewer) => viewer.section), "z,0.5");
    const middle = await main.read((viewer) => viewer.pick(viewer.clientWidth / 2, viewer.clientHeight / 2));
    const half = (picked.bounds.min[2] + picked.bounds.max[2]) / 2;
    assert.ok(middle === null || middle.position[2] <= half + 1e-9);
    const { ssim } = maskedSsim(decode(whole), decode(await main.screenshot()), rgb(BACKGROUND));
    assert.ok(ssim < 0.95, `SSIM ${ssim}`);
    await page.screenshot({ path: join(out, "section.png") });
    assert.match(page.url(), /&transition=dither&section=z,0\.5/);
    await page.locator("#section-axis").selectOption("");
    await page.locator("#transition").selectOption("geomorph");
    await viewer.focus();
    await page.keyboard.press("o");
    await main.rest();
    assert.equal(await main.read((viewer) => viewer.section), "");
  });
  await checks.run("held keys fly", async () => {
    await home();
    const before = await main.camera();
    await page.keyboard.press("g");
    await page.keyboard.down("d");
    await page.waitForFunction(() => document.querySelector("marquetry-viewer").flying);
    await page.waitForTimeout(300);
    await page.keyboard.up("d");
    await main.rest();
    const after = await main.camera();
    assert.ok(gap(eye(before), eye(after)) > 0 && Math.abs(reach(after) - reach(before)) < 1e-6 * reach(before));
    await page.keyboard.press("Escape");
    assert.equal(await main.read((viewer) => viewer.flying), false);
    await home();
  });
  await checks.run("annotations are pins; a wrong file is named", async () => {
    const notes = [
      { position: picked.middle.position, title: "Here", text: "<b>in words</b>", camera: "" },
      { position: picked.bounds.min.map((value, i) => value - (picked.bounds.max[i] - value) * 0.01), text: "Behind" },
    ];
    await page.route("**/notes.json", (route) => route.fulfill({ json: { version: 1, annotations: notes } }));
    await page.route("**/wrong.json", (route) => route.fulfill({ body: "{" }));
    await main.read((viewer) => viewer.setAttribute("annotations", "/notes.json"));
    const pins = viewer.locator(".pin");
    await pins.nth(1).waitFor();
    await pins.first().focus();
    const note = viewer.locator(".note");
    assert.equal(await note.innerText(), "Here\n<b>in words</b>");
    await page.screenshot({ path: join(out, "annotations.png") });
    assert.equal(await pins.first().getAttribute("class"), "pin");
    await main.read((viewer) => viewer.setAttribute("annotations", "/wrong.json"));
    await page.waitForFunction(() => window.spy.events.some((event) => event.kind === "annotations"));
    assert.equal(await pins.count(), 0);
    await main.read((viewer) => viewer.removeAttribute("annotations"));
  });
  await checks.run("a lost device is replaced, and the view stays", async () => {
    await viewer.focus();
    await page.keyboard.press("ArrowLeft");
    await main.rest();
    const before = await main.camera();
    await page.evaluate(() => window.spy.devices.at(-1).destroy());
    await page.waitForFunction(() => window.spy.events.some((event) => event.kind === "device"), undefined, { timeout: PATIENCE_MS });
    await main.settle();
    const after = await main.camera();
    assert.ok(gap(eye(before), eye(after)) < 1e-9 * reach(before));
    const { pixels } = maskedSsim(decode(await main.screenshot()), decode(await main.screenshot()), rgb(BACKGROUND));
    assert.ok(pixels > 1000);
    await home();
  });
}

async function thePage() {
  await checks.run("a new size is drawn at that size", async () => {
    await main.page.setViewportSize({ width: 800, height: 520 });
    await main.page.waitForFunction(
      () => document.querySelector("marquetry-viewer").shadowRoot.querySelector("canvas").width === 800,
      undefined,
      { timeout: PATIENCE_MS },
    );
    await main.rest();
    const size = await main.canvas();
    const picture = decode(await main.screenshot());
    assert.deepEqual([picture.width, picture.height], [size.width, size.height]);
    await main.page.setViewportSize({ width: 640, height: 480 });
    await main.rest();
  });
  await checks.run("the address reproduces the view", async () => {
    await main.page.locator("marquetry-viewer").focus();
    for (const key of ["ArrowLeft", "ArrowLeft", "ArrowUp", "+"]) await main.page.keyboard.press(key);
    await main.rest();
    await main.page.waitForTimeout(600);
    const [camera, before] = [await main.camera(), await main.screenshot()];
    const address = main.page.url();
    assert.match(address, /#camera=/);
    const again = await ViewerPage.open(chromium, address);
    await again.settle();
    const close = (await again.camera()).every((value, i) => Math.abs(value - camera[i]) <= 1e-7 * reach(camera));
    assert.ok(close, `${camera} and ${await again.camera()}`);
    const { ssim } = maskedSsim(decode(before), decode(await again.screenshot()), rgb(BACKGROUND));
    assert.ok(ssim >= SAME_LINK, `SSIM ${ssim}`);
    await again.close();
    return `SSIM ${ssim.toFixed(4)}`;
  });
  await checks.run("statistics and help show", async () => {
    await main.page.keyboard.press("i");
    await main.page.getByText("Fetched").waitFor({ timeout: PATIENCE_MS });
    await main.page.screenshot({ path: join(out, "page.png") });
    await main.page.keyboard.press("?");
    assert.ok(await main.page.locator("#help").isVisible());
    await main.page.keyboard.press("Escape");
  });
  await checks.run("a narrow page holds everything", async () => {
    await main.page.setViewportSize({ width: 360, height: 640 });
    await main.rest();
    await main.page.screenshot({ path: join(out, "narrow.png") });
    const overflow = await main.page.evaluate(() =>
      [document.documentElement, ...document.querySelectorAll("header *")]
        .filter((element) => element.getBoundingClientRect().right > innerWidth + 0.5)
        .map((element) => element.outerHTML.slice(0, 80)),
    );
    assert.deepEqual(overflow, []);
  });
  await checks.run("the console is clean", async () => assert.deepEqual(main.complaints, []));
  await checks.run("the catalogue lists what is served", async () => {
    const list = await ViewerPage.open(chromium, server.url, { scheme: "light" });
    const links = list.page.locator("#files a");
    await links.nth(1).waitFor();
    assert.deepEqual(await list.page.locator("#files strong").allTextContents(), ["dragon", "second one", "textured"]);
    await list.page.screenshot({ path: join(out, "catalogue.png") });
    await links.nth(1).click();
    await list.state("ready", "settled");
    await list.page.screenshot({ path: join(out, "light.png") });
    assert.deepEqual(list.complaints, []);
    await list.close();
  });
}

/** Images are decoded by workers where there are any. */
async function decoding() {
  const address = `${server.url}/?file=textured`;
  const look = async (prepare) => {
    const viewer = await ViewerPage.open(chromium, address, { size: { width: 400, height: 300 }, prepare });
    await viewer.settle();
    const { decoding, failures } = await viewer.read((element) => element.stats());
    const picture = await viewer.screenshot();
    assert.deepEqual([failures, viewer.complaints], [0, []]);
    await viewer.close();
    return { ...decoding, picture };
  };
  let away;
  await checks.run("workers decode images", async () => {
    away = await look();
    writeFileSync(join(out, "textured.png"), away.picture);
    assert.ok(away.workers > 0 && away.by_workers > 0 && away.here.images === 0, JSON.stringify({ ...away, picture: null }));
    return `${away.by_workers} images by ${away.workers} workers`;
  });
  await checks.run("without workers the page decodes them", async () => {
    const here = await look((page) => page.addInitScript(() => delete window.Worker));
    assert.ok(here.workers === 0 && here.by_workers === 0 && here.here.images > 0);
    // A cluster that was seen larger on the way may keep a larger image.
    const { ssim } = maskedSsim(decode(here.picture), decode(away.picture), rgb(BACKGROUND));
    assert.ok(ssim >= SAME_LINK, `SSIM ${ssim}`);
    return `${here.here.images} images in ${here.here.ms.toFixed()} ms, with ${here.here.meshes} meshes`;
  });
}

/** Where there is no WebGPU. */
async function webgl() {
  for (const [what, address] of [["charts", `${LIGHT}#error-px=${EASY_PX}`], ["textured clusters", "textured"]]) {
    await checks.run(`WebGL 2 draws the same picture: ${what}`, async () => {
      const pictures = [];
      for (const prepare of [undefined, withoutWebGpu]) {
        const viewer = await ViewerPage.open(chromium, `${server.url}/?file=${address}`, { prepare });
        await viewer.settle();
        const { adapter, failures } = await viewer.read((element) => element.stats());
        assert.equal(/WebGL 2/.test(adapter), prepare === withoutWebGpu, adapter);
        pictures.push(decode(await viewer.screenshot()));
        assert.deepEqual([failures, viewer.complaints], [0, []]);
        await viewer.close();
      }
      const { ssim, pixels, total } = maskedSsim(...pictures, rgb(BACKGROUND));
      assert.ok(pixels > total / 20, `the object covers ${pixels} of ${total} pixels`);
      assert.ok(ssim >= SAME_API, `SSIM ${ssim}`);
      return `SSIM ${ssim.toFixed(4)}`;
    });
  }
  await checks.run("an adapter that gives no device is as good as none", async () => {
    const viewer = await ViewerPage.open(chromium, `${server.url}/?file=textured`, {
      prepare: (page) => page.addInitScript(() => (GPUAdapter.prototype.requestDevice = () => Promise.reject(new Error("no")))),
    });
    await viewer.settle();
    const { adapter, decoding } = await viewer.read((element) => element.stats());
    assert.match(adapter, /WebGL 2/);
    assert.ok(decoding.by_workers > 0);
    assert.deepEqual(viewer.complaints, []);
    await viewer.close();
  });
  await checks.run("a lost context of WebGL is replaced, and the view stays", async () => {
    const viewer = await ViewerPage.open(chromium, `${server.url}/?file=textured`, { prepare: withoutWebGpu });
    await viewer.settle();
    await viewer.page.locator("marquetry-viewer").focus();
    await viewer.page.keyboard.press("ArrowLeft");
    await viewer.rest();
    const [before, camera] = [decode(await viewer.screenshot()), await viewer.camera()];
    await viewer.read((element) =>
      element.shadowRoot.querySelector("canvas").getContext("webgl2").getExtension("WEBGL_lose_context").loseContext());
    await viewer.page.waitForFunction(() => window.spy.events.some((event) => event.kind === "device"), undefined, { timeout: PATIENCE_MS });
    await viewer.settle();
    assert.ok(gap(eye(camera), eye(await viewer.camera())) < 1e-9 * reach(camera));
    const { ssim } = maskedSsim(decode(await viewer.screenshot()), before, rgb(BACKGROUND));
    assert.ok(ssim >= SAME_LINK, `SSIM ${ssim}`);
    await viewer.close();
  });
}

/** Makes a page believe that its browser has no WebGPU. */
function withoutWebGpu(page) {
  return page.addInitScript(() => Object.defineProperty(Navigator.prototype, "gpu", { get: () => undefined }));
}

async function otherHosts() {
  await checks.run("a host that only knows ranges will do", async () => {
    const viewer = await ViewerPage.open(chromium, `${server.url}/?file=${LIGHT}#error-px=${EASY_PX}`, {
      prepare: (page) => page.route("**/pages/**", (route) => route.fulfill({ status: 404 })),
    });
    await viewer.settle();
    const { requests } = await viewer.spied();
    assert.ok(requests.filter(({ range }) => range !== null).length > READY_REQUESTS);
    await viewer.close();
  });
}

async function embedding() {
  await checks.run("two viewers of one page turn together", async () => {
    const example = readFileSync(join(ROOT, "web-viewer/web/package/example.html"), "utf8");
    const file = `/files/${LIGHT}.marq`;
    const both = await ViewerPage.open(chromium, `${server.url}/example.html?left=${file}&right=${file}`, {
      size: { width: 640, height: 260 },
      prepare: (page) => page.route(/\/example\.html/, (route) => route.fulfill({ contentType: "text/html", body: example })),
    });
    const states = (wanted) => both.page.waitForFunction(
      (wanted) => [...document.querySelectorAll("marquetry-viewer")].every((viewer) => wanted.includes(viewer.state)),
      wanted, { timeout: PATIENCE_MS, polling: 100 },
    );
    await states(["ready", "settled"]);
    await both.page.locator("#left").focus();
    await both.page.keyboard.press("ArrowLeft");
    await both.page.waitForFunction(() => {
      const [left, right] = document.querySelectorAll("marquetry-viewer");
      return left.camera === right.camera;
    });
    await both.page.screenshot({ path: join(out, "example.png") });
    assert.deepEqual(both.complaints, []);
    await both.close();
  });
}

async function failures() {
  const refused = (name, pattern, query, prepare) =>
    checks.run(name, async () => {
      const viewer = await ViewerPage.open(chromium, `${server.url}/?file=${query}`, { prepare });
      await viewer.state("failed");
      const text = await viewer.alert();
      assert.match(text, pattern);
      const { events } = await viewer.spied();
      assert.ok(events.some((event) => event.type === "error" && event.fatal));
      assert.ok(await viewer.page.getByRole("button", { name: "Try again" }).isVisible());
      await viewer.close();
      return text.replace(/\s+/g, " ");
    });
  await refused("a missing file is named so", /no such file/, "missing");
  await refused("a file of another kind is refused", /cannot be shown/, LIGHT, (page) =>
    page.route("**/files/**", (route) => route.fulfill({ status: 206, body: "<html>hello</html>".repeat(999) })));
  await refused("a flipped bit at the front is found", /cannot be shown/, "dragon", (page) =>
    page.route("**/files/**", async (route) => {
      const response = await route.fetch();
      await route.fulfill({ response, body: flipped(await response.body(), 1000) });
    }));
  await refused("a file that ends early is refused", /cannot be shown/, "dragon", (page) =>
    page.route("**/files/**", async (route) => {
      const response = await route.fetch();
      const body = (await response.body()).subarray(0, 3000);
      await route.fulfill({ status: 206, body });
    }));
  await refused("a server that is gone is named so", /cannot be reached/, "dragon", (page) =>
    page.route("**/files/**", (route) => route.abort("connectionrefused")));
  await refused("a server that refuses is named so", /refuses access \(HTTP 403\)/, "dragon", (page) =>
    page.route("**/files/**", (route) => route.fulfill({ status: 403 })));
  await refused("a browser that draws with neither is told so", /WebGPU or with WebGL 2/, "dragon", async (page) => {
    await withoutWebGpu(page);
    await page.addInitScript(() => (HTMLCanvasElement.prototype.getContext = () => null));
  });

  await checks.run("broken pages are asked for again", async () => {
    let broken = 0;
    const viewer = await ViewerPage.open(chromium, `${server.url}/?file=${LIGHT}#error-px=${PAGED_PX}`, {
      prepare: (page) =>
        page.route("**/pages/**", async (route) => {
          const turn = broken++;
          if (turn === 0) return route.abort("connectionreset");
          const response = await route.fetch();
          const body = await response.body();
          if (turn === 1) return route.fulfill({ response, body: flipped(body, body.length >> 1) });
          if (turn === 2) return route.fulfill({ response, body: body.subarray(0, body.length >> 1) });
          if (turn === 3) return route.fulfill({ status: 503 });
          return route.fulfill({ response, body });
        }),
    });
    await viewer.settle();
    const stats = await viewer.read((element) => element.stats());
    assert.ok(stats.failures >= 4, `${stats.failures} failures`);
    assert.equal(stats.pages.missing, 0);
    const { events } = await viewer.spied();
    assert.ok(events.some((event) => event.type === "error" && !event.fatal));
    await viewer.close();
    return `${stats.failures} failures overcome`;
  });
  await checks.run("a file that was replaced is offered", async () => {
    const viewer = await ViewerPage.open(chromium, `${server.url}/?file=${LIGHT}#error-px=${PAGED_PX}`, {
      prepare: (page) => page.route("**/pages/**", (route) => route.fulfill({ status: 410 })),
    });
    const offer = viewer.page.getByRole("button", { name: "Load the new one" });
    await offer.waitFor({ timeout: PATIENCE_MS });
    const { events } = await viewer.spied();
    assert.ok(events.some((event) => event.kind === "replaced" && !event.fatal));
    await viewer.page.unroute("**/pages/**");
    await offer.click();
    await viewer.settle();
    assert.ok(await offer.isHidden());
    await viewer.close();
  });
  await checks.run("trying again helps once the server is back", async () => {
    let down = true;
    const viewer = await ViewerPage.open(chromium, `${server.url}/?file=${LIGHT}#error-px=${EASY_PX}`, {
      prepare: (page) => page.route("**/files/**", (route) => (down ? route.abort() : route.continue())),
    });
    await viewer.state("failed");
    down = false;
    await viewer.page.getByRole("button", { name: "Try again" }).click();
    await viewer.state("ready", "settled");
    await viewer.close();
  });
}

/** Caches hold a part of what the closest view takes. */
async function paths() {
  await flyPaths(checks, chromium, server, "dragon", 1_600_000);
  if (!ALL_VIEWS) return;
  const more = [
    ["komaba", "komaba_scan_1m.ply", 12_000_000, true],
    ["meshroom", "textured_meshroom/texturedMesh.obj", 4_000_000, true],
  ];
  for (const [name, scan, cacheBytes, isTorn] of more) {
    const path = join(ROOT, "../shared/data", scan);
    if (!existsSync(path)) continue;
    await marquetry.convert(path, join(served, `${name}.marq`));
    await flyPaths(checks, chromium, server, name, cacheBytes, isTorn);
  }
}

/** Two fingers that move apart, by the browser's own touch input. */
async function pinch(viewer) {
  const [x, y] = await viewer.middle();
  const session = await viewer.context.newCDPSession(viewer.page);
  await session.send("Emulation.setTouchEmulationEnabled", { enabled: true, maxTouchPoints: 2 });
  const touch = (type, spread) =>
    session.send("Input.dispatchTouchEvent", {
      type,
      touchPoints: spread === null ? [] : [{ x: x - spread, y, id: 1 }, { x: x + spread, y, id: 2 }],
    });
  await touch("touchStart", 30);
  for (const spread of [40, 50, 60]) await touch("touchMove", spread);
  await touch("touchEnd", null);
  await session.send("Emulation.setTouchEmulationEnabled", { enabled: false });
  await session.detach();
}

function flipped(body, at) {
  const copy = Buffer.from(body);
  copy[Math.min(at, copy.length - 1)] ^= 0x10;
  return copy;
}

function rgb(text) {
  return [0, 2, 4].map((at) => parseInt(text.slice(at, at + 2), 16));
}

function eye(camera) {
  return camera.slice(0, 3);
}

function target(camera) {
  return camera.slice(3, 6);
}

function gap(a, b) {
  return Math.hypot(...a.map((value, i) => value - b[i]));
}

/** Distance of eye and target. */
function reach(camera) {
  return gap(eye(camera), target(camera));
}
