import assert from "node:assert/strict";
import { test } from "node:test";
import { maskedSsim } from "./ssim.mjs";

const BACKGROUND = [32, 34, 38];

function picture(width, height, colour) {
  const data = new Uint8Array(width * height * 4);
  for (let j = 0; j < height; j++) {
    for (let i = 0; i < width; i++) data.set([...colour(i, j), 255], (j * width + i) * 4);
  }
  return { width, height, data };
}

const disk = (shift, noise = () => 0) =>
  picture(64, 64, (i, j) => {
    const inside = Math.hypot(i - 32 - shift, j - 32) < 20;
    return inside ? [100 + ((i * 7 + j * 3) % 50) + noise(i, j), 120, 90] : BACKGROUND;
  });

test("a picture equals itself", () => {
  const { ssim, pixels } = maskedSsim(disk(0), disk(0), BACKGROUND);
  assert.ok(Math.abs(ssim - 1) < 1e-9);
  assert.ok(Math.abs(pixels - Math.PI * 400) < 60, `${pixels}`);
});

test("a shift is seen", () => {
  assert.ok(maskedSsim(disk(0), disk(2), BACKGROUND).ssim < 0.9);
});

test("noise is seen", () => {
  const noisy = disk(0, (i, j) => ((i * 31 + j * 17) % 41) - 20);
  assert.ok(maskedSsim(disk(0), noisy, BACKGROUND).ssim < 0.95);
});

test("background does not count", () => {
  const empty = picture(64, 64, () => BACKGROUND);
  const { ssim, pixels } = maskedSsim(empty, empty, BACKGROUND);
  assert.ok(Number.isNaN(ssim));
  assert.equal(pixels, 0);
});

test("sizes must agree", () => {
  assert.throws(() => maskedSsim(disk(0), picture(8, 8, () => BACKGROUND), BACKGROUND), /sizes differ/);
});
