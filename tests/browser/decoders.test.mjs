// The pool of workers without a browser: who gets how much, and what becomes of jobs whose worker is gone.

import assert from "node:assert/strict";
import { mock, test } from "node:test";
import { Decoders, WorkerLost } from "../../web-viewer/web/js/decoders.js";

mock.timers.enable({ apis: ["setTimeout"] });

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
  return { decoders: new Decoders("webgl2", "module", start, processors), workers };
}

const bytes = () => new Uint8Array(4);

test("workers are as many as processors less one, one to four", () => {
  for (const [processors, count] of [[1, 1], [2, 1], [3, 2], [64, 4]]) {
    const { decoders, workers } = pool(processors);
    assert.equal(workers.length, count);
    assert.deepEqual(workers[0].received, [{ api: "webgl2", module: "module" }]);
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
  // Two of them are never answered.
  for (const answer of answers) answer.catch(() => {});
  assert.equal(decoders.room(user), 0);
  for (const { received } of workers) assert.equal(received.length, 3);
  const [first, second] = workers.map(({ received }) => received.slice(1).map(({ id }) => id));
  workers[1].say({ id: second[0], reason: "no key frame" });
  workers[0].say({ id: first[1], texels: "texels" });
  await assert.rejects(answers[second[0]], /no key frame/);
  assert.equal(await answers[first[1]], "texels");
  assert.equal(decoders.room(user), 2);
});

test("viewers that have something to decode share equally", () => {
  const { decoders, workers } = pool();
  for (const worker of workers) worker.say({ ready: true });
  let told = 0;
  const [one, two] = [() => (told += 1), () => {}];
  // One has nothing to give.
  assert.equal(decoders.room(one), 4);
  decoders.wait(one, false);
  assert.equal(decoders.room(two), 4);
  for (let i = 0; i < 4; i++) decoders.run(two, bytes()).catch(() => {});
  // One is refused, and is told when there is room, which is its own then.
  assert.equal(decoders.room(one), 0);
  workers[0].say({ id: workers[0].received[1].id, texels: "texels" });
  assert.equal(told, 1);
  assert.equal(decoders.room(two), 0);
  assert.equal(decoders.room(one), 1);
  decoders.leave(one);
  assert.equal(decoders.room(two), 1);
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
  assert.ok(decoders.count === 0 && decoders.room(user) === 0);
  // Others are started in their place, but not for ever.
  for (let at = 2; at < workers.length; at++) {
    workers[at].say({ ready: true });
    workers[at].dispatchEvent(new Event("error"));
  }
  assert.equal(workers.length, 6);
  assert.ok(!decoders.isThere);
});

test("a worker that owes an answer for long is lost", async () => {
  const { decoders, workers } = pool(2);
  workers[0].say({ ready: true });
  const answers = [0, 1].map(() => decoders.run(() => {}, bytes()));
  workers[0].say({ id: workers[0].received[1].id, texels: "texels" });
  assert.equal(await answers[0], "texels");
  mock.timers.tick(30_000);
  await assert.rejects(answers[1], WorkerLost);
  assert.ok(workers[0].isGone);
});

test("nobody waits for a worker that starts late, but it is welcome", () => {
  const { decoders, workers } = pool(2);
  assert.ok(decoders.isThere);
  mock.timers.tick(3_000);
  assert.ok(!decoders.isThere);
  workers[0].say({ ready: true });
  assert.ok(decoders.isThere && decoders.count === 1);
});

test("where no worker starts there is none", () => {
  const refuse = () => {
    throw new Error("refused");
  };
  assert.ok(!new Decoders("webgl2", "module", refuse, 4).isThere);
  const { decoders, workers } = pool(2);
  assert.ok(decoders.isThere);
  workers[0].say({ ready: false, reason: "no wasm here" });
  assert.ok(!decoders.isThere && workers[0].isGone);
});
