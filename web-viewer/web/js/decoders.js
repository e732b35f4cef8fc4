// Workers that decode images, shared by all viewers of a page.
//
// A worker gets the module that the page has compiled, and bytes, which change hands without a copy. Memory is not shared, since
// that takes headers which not every host can send. Where workers cannot be had (a policy forbids them, the page is a file),
// or do not answer, whoever has images decodes them itself.

/** Most workers. */
const MOST_WORKERS = 4;
/** Jobs that a worker has at a time: one to do while the answer to the other is on its way. */
const JOBS_A_WORKER = 2;
/** Milliseconds that others wait for a worker to start; one that is later is welcome. */
const START_MS = 3_000;
/** Milliseconds after which a worker that owes an answer is taken for lost. */
const ANSWER_MS = 30_000;
/** Workers that are started in place of lost ones, at most. */
const MOST_REPLACED = 4;
/** Milliseconds after which a worker has certainly read its script. */
const READ_MS = 60_000;

/** The job was not done: its worker is gone. */
export class WorkerLost extends Error {}

/** A worker from a module of ours, which may lie on another origin than the page. */
export function startWorker() {
  // Bundlers know the worker by this pattern alone, and change no other URL here.
  const here = new URL(import.meta.url);
  if (here.origin === self.origin) {
    return new Worker(new URL("./decoder_worker.js", import.meta.url), { type: "module", name: "marquetry decoder" });
  }
  // Pages may start workers of their own origin only; such a one may import ours.
  const { href } = new URL("./decoder_worker.js", here);
  const script = new Blob([`import ${JSON.stringify(href)};`], { type: "text/javascript" });
  const local = URL.createObjectURL(script);
  const worker = new Worker(local, { type: "module", name: "marquetry decoder" });
  setTimeout(() => URL.revokeObjectURL(local), READ_MS);
  return worker;
}

/** A few workers, and what they are at. */
export class Decoders {
  #workers = new Set();
  #starting = 0;
  #users = new Set();
  /** Users that were told there is no room. */
  #waiting = new Set();
  #nextId = 0;
  #replaced = 0;
  #first;
  #startWorker;

  /** Starts workers that run `module`, a compiled one of the bundle `api`. */
  constructor(api, module, start = startWorker, processors = navigator.hardwareConcurrency ?? 2) {
    this.#first = { api, module };
    this.#startWorker = start;
    const count = Math.min(Math.max(processors - 1, 1), MOST_WORKERS);
    for (let i = 0; i < count; i++) this.#start();
  }

  /** Workers that are ready. */
  get count() {
    return this.#workers.size;
  }

  /** Whether workers will do it: some are ready, or may be soon. */
  get isThere() {
    return this.#workers.size + this.#starting > 0;
  }

  /** How many jobs `user` may give now. Those who have jobs or wait for room get equal parts. */
  room(user) {
    this.#users.add(user);
    const places = JOBS_A_WORKER * this.#workers.size;
    const rivals = new Set(this.#waiting).add(user);
    let [taken, own] = [0, 0];
    for (const { jobs } of this.#workers) {
      taken += jobs.size;
      for (const job of jobs.values()) {
        rivals.add(job.user);
        own += job.user === user ? 1 : 0;
      }
    }
    const room = Math.max(Math.min(Math.ceil(places / rivals.size) - own, places - taken), 0);
    if (room === 0) this.#waiting.add(user);
    return room;
  }

  /** Whether `user` has more images than it was given room for. */
  wait(user, isWaiting) {
    if (isWaiting) this.#waiting.add(user);
    else this.#waiting.delete(user);
  }

  /** `user` has no more to give. */
  leave(user) {
    this.#users.delete(user);
    this.#waiting.delete(user);
  }

  /** Has `message` decoded; the answer. Takes the message's memory. */
  run(user, message) {
    const free = [...this.#workers].sort((a, b) => a.jobs.size - b.jobs.size)[0];
    if (!free) return Promise.reject(new WorkerLost("there is no worker"));
    const id = this.#nextId++;
    return new Promise((resolve, reject) => {
      const timer = setTimeout(free.lose, ANSWER_MS);
      free.jobs.set(id, { user, resolve, reject, timer });
      free.worker.postMessage({ id, message }, [message.buffer]);
    });
  }

  #start() {
    let worker;
    try {
      worker = this.#startWorker();
      worker.postMessage(this.#first);
    } catch {
      return;
    }
    const own = { worker, jobs: new Map(), isReady: false };
    this.#starting += 1;
    let isAwaited = true;
    const settle = () => {
      this.#starting -= isAwaited ? 1 : 0;
      isAwaited = false;
      clearTimeout(timer);
    };
    own.lose = () => {
      settle();
      worker.terminate();
      this.#workers.delete(own);
      if (own.isReady && this.#replaced < MOST_REPLACED) {
        this.#replaced += 1;
        this.#start();
      }
      own.isReady = false;
      for (const { reject, timer } of own.jobs.values()) {
        clearTimeout(timer);
        reject(new WorkerLost("a worker is gone"));
      }
      own.jobs.clear();
      this.#tell();
    };
    const timer = setTimeout(() => {
      settle();
      this.#tell();
    }, START_MS);
    worker.addEventListener("error", own.lose);
    worker.addEventListener("messageerror", own.lose);
    worker.addEventListener("message", ({ data }) => {
      if (own.isReady) {
        this.#answer(own, data);
      } else if (data.ready) {
        settle();
        own.isReady = true;
        this.#workers.add(own);
        this.#tell();
      } else {
        own.lose();
      }
    });
  }

  #answer(own, { id, texels, reason, isFatal }) {
    const job = own.jobs.get(id);
    own.jobs.delete(id);
    clearTimeout(job?.timer);
    if (texels) job?.resolve(texels);
    else job?.reject(new Error(reason));
    if (isFatal) own.lose();
    // Who waits comes before whose job it was.
    for (const user of [...this.#waiting]) {
      if (user !== job?.user) user();
    }
  }

  /** There may be room, or no worker any more. */
  #tell() {
    for (const user of this.#users) user();
  }
}
