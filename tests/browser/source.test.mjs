import assert from "node:assert/strict";
import { createServer } from "node:http";
import { after, before, test } from "node:test";
import { LoadError, Source } from "../../web-viewer/web/js/source.js";
import { notches } from "../../web-viewer/web/js/input.js";

const FILE = Buffer.from(Array.from({ length: 1000 }, (_, i) => i % 251));
const CONTENT_ID = "00112233445566778899aabbccddeeff";
let server;
let origin;
let seen;

before(async () => {
  server = createServer((request, response) => {
    seen.push(request.url);
    const range = /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? "");
    const part = range && [Number(range[1]), Math.min(Number(range[2]) + 1, FILE.length)];
    const answer = (status, body, headers = {}) => response.writeHead(status, headers).end(body);
    if (request.url === `/pages/scan/${CONTENT_ID}/3-5`) return answer(200, FILE.subarray(300, 600));
    if (request.url === `/pages/replaced/${CONTENT_ID}/3`) return answer(410, "");
    if (request.url === `/pages/long/${CONTENT_ID}/3`) return answer(200, FILE);
    if (request.url.startsWith("/pages/") || request.url === "/files/missing.marq") return answer(404, "");
    if (request.url === "/files/broken.marq") return answer(500, "");
    if (request.url === "/files/whole.marq") return answer(200, FILE);
    if (request.url === "/files/shifted.marq") {
      return answer(206, FILE.subarray(0, 10), { "Content-Range": `bytes 5-14/${FILE.length}` });
    }
    if (request.url === "/files/cut.marq") {
      response.writeHead(206, { "Content-Length": 100 });
      response.write(FILE.subarray(0, 50));
      setTimeout(() => response.destroy(), 50);
      return undefined;
    }
    if (part[0] >= FILE.length) return answer(416, "");
    return answer(206, FILE.subarray(...part), { "Content-Range": `bytes ${part[0]}-${part[1] - 1}/${FILE.length}` });
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  origin = `http://127.0.0.1:${server.address().port}`;
});
after(() => server.close());

function source(path) {
  seen = [];
  return new Source(origin + path, new AbortController().signal);
}

const rejects = (promise, pattern) =>
  assert.rejects(promise, (error) => error instanceof LoadError && pattern.test(error.message));

test("a range is exactly what was asked for", async () => {
  const scan = source("/files/scan.marq");
  assert.deepEqual(Buffer.from(await scan.range(10, 20)), FILE.subarray(10, 20));
  assert.equal(scan.requests, 1);
  assert.equal(scan.bytes, 10);
});

test("beyond the end there is less, or nothing", async () => {
  assert.equal((await source("/files/scan.marq").range(990, 2000)).length, 10);
  assert.equal((await source("/files/scan.marq").range(2000, 3000)).length, 0);
});

test("a server without ranges gives the front, and nothing else", async () => {
  assert.deepEqual(Buffer.from(await source("/files/whole.marq").range(0, 64)), FILE.subarray(0, 64));
  await rejects(source("/files/whole.marq").range(64, 128), /no byte ranges/);
});

test("other bytes than asked for are refused", async () => {
  await rejects(source("/files/shifted.marq").range(0, 10), /other bytes/);
});

test("pages come from their own URL", async () => {
  const scan = source("/files/scan.marq");
  scan.usePages(CONTENT_ID);
  assert.deepEqual(Buffer.from(await scan.pages(3, 5, 300, 600)), FILE.subarray(300, 600));
  assert.deepEqual(seen, [`/pages/scan/${CONTENT_ID}/3-5`]);
});

test("a host without page URLs is asked once, then for ranges", async () => {
  const scan = source("/files/other.marq");
  scan.usePages(CONTENT_ID);
  assert.deepEqual(Buffer.from(await scan.pages(3, 5, 300, 600)), FILE.subarray(300, 600));
  assert.deepEqual(Buffer.from(await scan.pages(6, 6, 600, 700)), FILE.subarray(600, 700));
  assert.deepEqual(seen, [`/pages/other/${CONTENT_ID}/3-5`, "/files/other.marq", "/files/other.marq"]);
});

test("a file elsewhere has no page URLs", async () => {
  const scan = source("/static/scan.marq");
  scan.usePages(CONTENT_ID);
  await scan.pages(0, 1, 10, 20);
  assert.deepEqual(seen, ["/static/scan.marq"]);
});

test("a replaced file is no reason to fall back", async () => {
  const scan = source("/files/replaced.marq");
  scan.usePages(CONTENT_ID);
  await rejects(scan.pages(3, 3, 300, 600), /replaced/);
});

test("more bytes than asked for are refused", async () => {
  const scan = source("/files/long.marq");
  scan.usePages(CONTENT_ID);
  await rejects(scan.pages(3, 3, 300, 600), /more bytes/);
});

test("failures say what happened", async () => {
  await rejects(source("/files/missing.marq").range(0, 10), /no such file/);
  await rejects(source("/files/broken.marq").range(0, 10), /HTTP 500/);
  await rejects(source("/files/cut.marq").range(0, 100), /cannot be reached/);
  await rejects(new Source("http://127.0.0.1:1/x.marq", new AbortController().signal).range(0, 1), /cannot be reached/);
});

test("an abandoned load ends", async () => {
  const controller = new AbortController();
  seen = [];
  const abandoned = new Source(`${origin}/files/scan.marq`, controller.signal);
  controller.abort();
  await assert.rejects(abandoned.range(0, 10), { name: "AbortError" });
});

test("a notch is a notch in every browser's units", () => {
  assert.equal(notches({ deltaY: 100, deltaMode: 0 }), 1);
  assert.ok(Math.abs(notches({ deltaY: 3, deltaMode: 1 }) - 1) < 0.05);
  assert.equal(notches({ deltaY: -1e9, deltaMode: 0 }), -4);
});
