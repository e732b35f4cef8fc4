// What the page's tools do without a browser: distances in words, annotation files, the sameness of a file.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { load, parse } from "../../web-viewer/web/js/annotations.js";
import { describe } from "../../web-viewer/web/js/measure.js";
import { Source } from "../../web-viewer/web/js/source.js";

test("a distance has the digits that its error leaves certain", () => {
  for (const [distance, error, text] of [
    [12.345678, 0.0123, "12.346 ± 0.013"],
    [12345.6, 123, "12346 ± 130"],
    [0.00012345, 1.2e-7, "0.00012345 ± 0.00000012"],
    [1.25, 0, "1.25"],
    [3, Number.NaN, "3"],
  ]) {
    assert.equal(describe({ distance, error }), text);
  }
});

test("the error that is said is never smaller than the error", () => {
  for (let i = 0; i < 2000; i++) {
    const error = 10 ** (Math.sin(i) * 9);
    const said = Number(describe({ distance: 1, error }).split("±")[1]);
    assert.ok(said >= error * (1 - 1e-9), `${said} for ${error}`);
    assert.ok(said <= error * 1.11, `${said} for ${error}`);
  }
});

const note = { position: [1, 2, 3], title: "Ear", text: "Chipped.", camera: "1,2,3,0,0,0" };

test("annotations are read, unknown keys passed over", () => {
  const text = JSON.stringify({ version: 1, extra: true, annotations: [{ ...note, colour: "red" }, { position: [0, 0, 0], text: "x" }] });
  assert.deepEqual(parse(text), [note, { position: [0, 0, 0], title: "", text: "x", camera: "" }]);
});

test("the example in the documentation is right", () => {
  const document = readFileSync(new URL("../../docs/annotations.md", import.meta.url), "utf8");
  const [, example] = /```json\n([^]*?)```/.exec(document);
  assert.equal(parse(example).length, 1);
});

test("what is wrong with annotations is named", () => {
  const file = (annotations, version = 1) => JSON.stringify({ version, annotations });
  for (const [text, pattern] of [
    ["{", /no JSON/],
    ["null", /version/],
    [file([], 2), /version/],
    [file({}), /no list/],
    [file(Array(1001).fill(note)), /1001/],
    [file([note, null]), /annotation 1: `position`/],
    [file([{ ...note, position: [1, 2] }]), /`position`/],
    [file([{ ...note, position: [1, 2, "3"] }]), /`position`/],
    [file([{ ...note, position: [1, 2, null] }]), /`position`/],
    [file([{ ...note, title: 7 }]), /`title`/],
    [file([{ ...note, text: "x".repeat(4001) }]), /`text`/],
    [file([{ position: [1, 2, 3] }]), /neither/],
    [file([{ ...note, camera: [1] }]), /`camera`/],
  ]) {
    assert.throws(() => parse(text), pattern, text.slice(0, 80));
  }
});

async function withFetch(answer, act) {
  const before = globalThis.fetch;
  globalThis.fetch = answer;
  try {
    await act();
  } finally {
    globalThis.fetch = before;
  }
}

test("annotations that cannot be had are an error with the address", async () => {
  const { signal } = new AbortController();
  const url = "http://localhost/x.json";
  for (const [answer, pattern] of [
    [async () => new Response("", { status: 404 }), /x\.json cannot be had \(HTTP 404\)/],
    [async () => { throw new TypeError("no"); }, /x\.json cannot be reached/],
    [async () => new Response("<html>"), /x\.json is no JSON/],
    [async () => new Response(" ".repeat(1024 * 1024 + 1)), /more than/],
  ]) {
    await withFetch(answer, () => assert.rejects(load(url, signal), pattern));
  }
});

test("a file that was replaced is told by its front", async () => {
  let file = new Uint8Array(1000).fill(1);
  const answer = async (_url, { headers }) => {
    const [, start, end] = /bytes=(\d+)-(\d+)/.exec(headers.Range).map(Number);
    return new Response(file.slice(start, end + 1), { status: 206 });
  };
  await withFetch(answer, async () => {
    const source = new Source("http://localhost/x.marq", new AbortController().signal);
    assert.equal(await source.isSame(), true);
    await source.range(0, 500);
    assert.equal(await source.isSame(), true);
    file = file.with(40, 2);
    assert.equal(await source.isSame(), false);
    file = new Uint8Array(10).fill(1);
    assert.equal(await source.isSame(), false);
  });
});
