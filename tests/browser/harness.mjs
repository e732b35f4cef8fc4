// The programs that the browser test runs, and how checks are counted.

import { execFile, spawn } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import { chromium } from "playwright-core";
import { PNG } from "pngjs";

const run = promisify(execFile);

/** Root of the project. */
export const ROOT = resolve(dirname(fileURLToPath(import.meta.url)), "../..");

/**
 * WebGPU in software: the same on every machine, with or without a GPU. The compositor has to use the same software
 * Vulkan, else a WebGPU canvas is drawn but stays blank.
 */
const CHROMIUM_FLAGS = [
  "--enable-unsafe-webgpu",
  "--use-webgpu-adapter=swiftshader",
  "--enable-features=Vulkan",
  "--use-vulkan=swiftshader",
  "--use-angle=swiftshader",
  "--ignore-gpu-blocklist",
  "--no-sandbox",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
];

/** Options of the command line: `--name value`. */
export function options(names) {
  const found = {};
  for (let i = 2; i < process.argv.length; i += 2) {
    const name = process.argv[i].replace(/^--/, "");
    if (!names.includes(name)) throw new Error(`unknown option ${process.argv[i]}; there are --${names.join(", --")}`);
    found[name] = process.argv[i + 1];
  }
  return found;
}

/** Counts checks; goes on after a failure. */
export class Checks {
  #failed = [];
  #passed = 0;

  async run(name, check) {
    const start = Date.now();
    const seconds = () => `${((Date.now() - start) / 1000).toFixed(1)} s`;
    try {
      const note = await check();
      this.#passed += 1;
      console.log(`  ok      ${name}${note ? `: ${note}` : ""} (${seconds()})`);
    } catch (error) {
      this.#failed.push(name);
      console.log(`  FAILED  ${name} (${seconds()})\n${indent(error.stack ?? String(error))}`);
    }
  }

  /** Prints the sum; true when nothing failed. */
  finish() {
    console.log(`browser: ${this.#passed} passed, ${this.#failed.length} failed`);
    for (const name of this.#failed) console.log(`  failed: ${name}`);
    return this.#failed.length === 0;
  }
}

function indent(text) {
  return text.replace(/^/gm, "          ");
}

/** The scan to test with: the dragon where there is one, else a generated surface. */
export function scan(folder) {
  const known = [join(ROOT, "../shared/data/dragon_vrip.ply"), join(ROOT, "demo/dragon_vrip.ply.gz")];
  const dragon = known.find((path) => existsSync(path));
  if (dragon) return dragon;
  const path = join(folder, "torus.ply");
  if (!existsSync(path)) writeFileSync(path, bumpyTorus(512, 256));
  return path;
}

/** A closed surface of `2 · around · across` triangles with detail at several sizes, as binary PLY. */
function bumpyTorus(around, across) {
  const header =
    `ply\nformat binary_little_endian 1.0\nelement vertex ${around * across}\n` +
    "property float x\nproperty float y\nproperty float z\n" +
    `element face ${2 * around * across}\nproperty list uchar int vertex_indices\nend_header\n`;
  const vertices = Buffer.alloc(around * across * 12);
  const faces = Buffer.alloc(2 * around * across * 13);
  let at = 0;
  for (let j = 0; j < across; j++) {
    for (let i = 0; i < around; i++) {
      const u = (2 * Math.PI * i) / around;
      const v = (2 * Math.PI * j) / across;
      const r = 0.4 + 0.05 * Math.sin(7 * u) * Math.cos(5 * v) + 0.01 * Math.sin(31 * u + 17 * v);
      const ring = 1 + r * Math.cos(v);
      for (const value of [ring * Math.cos(u), ring * Math.sin(u), r * Math.sin(v)]) at = vertices.writeFloatLE(value, at);
    }
  }
  at = 0;
  for (let j = 0; j < across; j++) {
    for (let i = 0; i < around; i++) {
      const corner = (di, dj) => ((j + dj) % across) * around + ((i + di) % around);
      for (const face of [
        [corner(0, 0), corner(1, 0), corner(1, 1)],
        [corner(0, 0), corner(1, 1), corner(0, 1)],
      ]) {
        at = faces.writeUInt8(3, at);
        for (const index of face) at = faces.writeInt32LE(index, at);
      }
    }
  }
  return Buffer.concat([Buffer.from(header), vertices, faces]);
}

/** A bumpy square with an image on it, as OBJ with MTL and PNG; its path. */
export function texturedScan(folder, cells = 48, texels = 512) {
  const image = new PNG({ width: texels, height: texels });
  for (let at = 0; at < texels * texels; at++) {
    const [x, y] = [at % texels, Math.floor(at / texels)];
    const check = ((x >> 5) + (y >> 5)) % 2 ? 90 : 0;
    image.data.set([80 + check + (x % 32), 60 + (y >> 2), 150 + 50 * Math.sin(x * y * 1e-3), 255], 4 * at);
  }
  writeFileSync(join(folder, "textured.png"), PNG.sync.write(image));
  writeFileSync(join(folder, "textured.mtl"), "newmtl image\nmap_Kd textured.png\n");
  const lines = ["mtllib textured.mtl", "usemtl image"];
  for (let j = 0; j <= cells; j++) {
    for (let i = 0; i <= cells; i++) {
      const [u, v] = [i / cells, j / cells];
      lines.push(`v ${u} ${v} ${0.05 * Math.sin(9 * u) * Math.cos(7 * v)}`, `vt ${u} ${v}`);
    }
  }
  const corner = (i, j) => [1, 1].fill(j * (cells + 1) + i + 1).join("/");
  for (let j = 0; j < cells; j++) {
    for (let i = 0; i < cells; i++) {
      lines.push(`f ${corner(i, j)} ${corner(i + 1, j)} ${corner(i + 1, j + 1)} ${corner(i, j + 1)}`);
    }
  }
  const path = join(folder, "textured.obj");
  writeFileSync(path, lines.join("\n"));
  return path;
}

/** The `marquetry` binary. */
export class Marquetry {
  #binary;

  constructor(binary) {
    this.#binary = binary;
  }

  /** Converts, unless `output` is newer than input and binary. */
  async convert(input, output, ...more) {
    const time = (path) => statSync(path, { throwIfNoEntry: false })?.mtimeMs ?? 0;
    if (time(output) > Math.max(time(input), time(this.#binary))) return;
    mkdirSync(dirname(output), { recursive: true });
    await run(this.#binary, ["convert", input, "-o", output, ...more]);
  }

  /** Draws one frame headless; returns the PNG. */
  async render(file, output, { width, height, camera, background }) {
    await run(this.#binary, [
      "render", file, "-o", output,
      "--size", `${width}x${height}`,
      // One word, since a camera may begin with a minus sign.
      `--camera=${camera}`,
      "--background", background,
    ]);
    return PNG.sync.read(readFileSync(output));
  }

  /** Starts a server on a free port; returns its URL and how to stop it. */
  async serve(...paths) {
    const child = spawn(this.#binary, ["serve", ...paths, "--listen", "127.0.0.1:0"], {
      stdio: ["ignore", "pipe", "pipe"],
    });
    const url = await new Promise((done, fail) => {
      let said = "";
      const listen = (chunk) => {
        said += chunk;
        const match = /listening on (http:\/\/\S+)/.exec(said);
        if (match) done(match[1].replace(/\/$/, ""));
      };
      child.stdout.on("data", listen);
      child.stderr.on("data", listen);
      child.on("error", fail);
      child.on("exit", (code) => fail(new Error(`the server ended with ${code}:\n${said}`)));
    });
    return { url, stop: () => child.kill() };
  }
}

/** Starts Chromium with WebGPU. */
export function browser(executablePath) {
  return chromium.launch({ executablePath, args: CHROMIUM_FLAGS });
}

/** Decodes a PNG. */
export function decode(bytes) {
  return PNG.sync.read(bytes);
}
