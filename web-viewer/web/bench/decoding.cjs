// `node decoding.cjs MODULE FILE...`: what examples/decoding.rs does, in wasm.

const fs = require("node:fs");

// How long each is decoded again and again, at least, after as long that the compiler has.
const FOR_MS = 2000;

const [modulePath, ...files] = process.argv.slice(2);
const { Whole } = require(modulePath);

function timesOf(decode) {
  const times = [];
  const start = performance.now();
  while (performance.now() - start < FOR_MS) {
    const before = performance.now();
    decode();
    times.push((performance.now() - before) / 1000);
  }
  return times.sort((a, b) => a - b);
}

for (const file of files) {
  const whole = new Whole(fs.readFileSync(file));
  const found = [() => whole.decodeCharts(), () => whole.decodeClusters()].map((decode) => {
    timesOf(decode);
    const times = timesOf(decode);
    return `${decode()} ${times[Math.floor(times.length / 2)]}`;
  });
  console.log(found.join(" "));
}
