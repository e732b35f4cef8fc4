// The pool of workers without a browser: who gets how much, and what becomes of jobs whose worker is gone.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Decoders, WorkerLost } from "../../web-viewer/web/js/decoders.js";

/** A worker that does what the test says. */
class FakeWorker extends EventTarget {
  received = [];
  isGone = false;

  postMessage(data) {
    this.received.push(data);
  }

  terminate() {
    this.isGone = true;
  }

  say(data) {
    this.dispatchEvent(Object.assign(new Event("message"), { data }));
  }
}

function pool(processors = 3) {
  const workers = [];
  const start = () => workers[workers.push(new FakeWorker()) - 1];
  return { decoders: new Decoders("module", start, processors), workers };
}

const bytes = () => new Uint8Array(4);

test("workers are as many as processors less one, one to four", () => {
  for (const [processors, count] of [[1, 1], [2, 1], [3, 2], [64, 4]]) {
    const { decoders, workers } = pool(processors);
    assert.equal(workers.length, count);
    assert.deepEqual(workers[0].received, [{ module: "module" }]);
    assert.equal(decoders.count, 0);
    for (const worker of workers) worker.say({ ready: true });
    assert.equal(decoders.count, count);
  }
});

test("jobs go to who has least, and answers back to who asked", async () => {
  const { decoders, workers } = pool();
  const user = () => {};
  assert.equal(decoders.room(user), 0);
  await assert.rejects(decoders.run(user, bytes()), WorkerLost);
  for (const worker of workers) worker.say({ ready: true });
  assert.equal(decoders.room(user), 4);
  const answers = [0, 1, 2, 3].map(() => decoders.run(user, bytes()));
  assert.equal(decoders.room(user), 0);
  for (const { received } of workers) assert.equal(received.length, 3);
  const [first, second] = workers.map(({ received }) => received.slice(1).map(({ id }) => id));
  workers[1].say({ id: second[0], reason: "no key frame" });
  workers[0].say({ id: first[1], texels: "texels" });
  await assert.rejects(answers[second[0]], /no key frame/);
  assert.equal(await answers[first[1]], "texels");
  assert.equal(decoders.room(user), 2);
});

test("viewers share equally", () => {
  const { decoders, workers } = pool();
  for (const worker of workers) worker.say({ ready: true });
  const [one, two] = [() => {}, () => {}];
  decoders.room(one);
  assert.equal(decoders.room(two), 2);
  decoders.run(two, bytes()).catch(() => {});
  assert.equal(decoders.room(two), 1);
  assert.equal(decoders.room(one), 2);
  decoders.leave(one);
  assert.equal(decoders.room(two), 3);
});

test("a worker that fails loses its jobs to who gave them, and nothing else", async () => {
  const { decoders, workers } = pool();
  let told = 0;
  const user = () => (told += 1);
  decoders.room(user);
  workers[0].say({ ready: true });
  workers[1].say({ ready: true });
  const answers = [0, 1, 2].map(() => decoders.run(user, bytes()));
  const [first, second] = workers.map(({ received }) => received.slice(1).map(({ id }) => id));
  // It panics at one job: that one is bad, the other is to be done elsewhere.
  workers[0].say({ id: first[0], reason: "unreachable", isFatal: true });
  await assert.rejects(answers[first[0]], (error) => !(error instanceof WorkerLost));
  await assert.rejects(answers[first[1]], WorkerLost);
  assert.ok(workers[0].isGone && !workers[1].isGone && decoders.isThere && told === 3);
  workers[1].dispatchEvent(new Event("error"));
  await assert.rejects(answers[second[0]], WorkerLost);
  assert.ok(!decoders.isThere && decoders.room(user) === 0);
});

test("where no worker starts there is none", () => {
  const refuse = () => {
    throw new Error("refused");
  };
  assert.ok(!new Decoders("module", refuse, 4).isThere);
  const { decoders, workers } = pool(2);
  assert.ok(decoders.isThere);
  workers[0].say({ ready: false, reason: "no wasm here" });
  assert.ok(!decoders.isThere && workers[0].isGone);
});
