// `node decoding.cjs MODULE FILE...`: what examples/decoding.rs does, in wasm.

const fs = require("node:fs");

// How long each file is decoded again and again, at least, after as long that the compiler has.
const FOR_MS = 2000;

const [modulePath, ...files] = process.argv.slice(2);
const { Whole } = require(modulePath);

for (const file of files) {
  const whole = new Whole(fs.readFileSync(file));
  const decoded = whole.decode();
  const decodeForAWhile = () => {
    const times = [];
    const start = performance.now();
    while (performance.now() - start < FOR_MS) {
      const before = performance.now();
      whole.decode();
      times.push((performance.now() - before) / 1000);
    }
    return times.sort((a, b) => a - b);
  };
  decodeForAWhile();
  const times = decodeForAWhile();
  console.log(`${decoded[0]} ${decoded[1]} ${times[Math.floor(times.length / 2)]}`);
}
