// Structural similarity of two pictures over a mask.
//
// Wang, Bovik, Sheikh, Simoncelli, "Image Quality Assessment: From Error Visibility to Structural Similarity", 2004.
// Differs: uniform 7 × 7 windows on luma (as scikit-image's default), and the mean is over the mask only, so that
// background, which is trivially equal, does not count.

const WINDOW = 7;
const C1 = (0.01 * 255) ** 2;
const C2 = (0.03 * 255) ** 2;
/** Largest difference to the background, in a channel of 0..255, that still counts as background. */
const MASK_TOLERANCE = 3;

/**
 * Mean SSIM of `a` and `b` ({width, height, data: RGBA}) where either differs from `background` ([r, g, b]).
 * Returns {ssim, pixels, total}: `pixels` of the mask out of `total`. An empty mask gives NaN.
 */
export function maskedSsim(a, b, background) {
  if (a.width !== b.width || a.height !== b.height) {
    throw new Error(`sizes differ: ${a.width}×${a.height} and ${b.width}×${b.height}`);
  }
  const { width, height } = a;
  const x = luma(a);
  const y = luma(b);
  const sums = [x, y, product(x, x), product(y, y), product(x, y)].map((plane) => integral(plane, width, height));
  const half = (WINDOW - 1) / 2;
  let total = 0;
  let pixels = 0;
  for (let j = 0; j < height; j++) {
    for (let i = 0; i < width; i++) {
      const at = (j * width + i) * 4;
      if (!differs(a.data, at, background) && !differs(b.data, at, background)) continue;
      const left = Math.max(0, i - half);
      const top = Math.max(0, j - half);
      const right = Math.min(width, i + half + 1);
      const bottom = Math.min(height, j + half + 1);
      const count = (right - left) * (bottom - top);
      const [mx, my, mxx, myy, mxy] = sums.map((sum) => box(sum, width, left, top, right, bottom) / count);
      const covariance = mxy - mx * my;
      const variances = mxx - mx * mx + (myy - my * my);
      total += ((2 * mx * my + C1) * (2 * covariance + C2)) / ((mx * mx + my * my + C1) * (variances + C2));
      pixels++;
    }
  }
  return { ssim: total / pixels, pixels, total: width * height };
}

function differs(data, at, background) {
  return background.some((value, channel) => Math.abs(data[at + channel] - value) > MASK_TOLERANCE);
}

function luma({ width, height, data }) {
  const out = new Float64Array(width * height);
  for (let i = 0; i < out.length; i++) {
    out[i] = 0.2126 * data[4 * i] + 0.7152 * data[4 * i + 1] + 0.0722 * data[4 * i + 2];
  }
  return out;
}

function product(x, y) {
  return x.map((value, i) => value * y[i]);
}

/** Sums over everything above and to the left, one row and one column wider than the plane. */
function integral(plane, width, height) {
  const out = new Float64Array((width + 1) * (height + 1));
  for (let j = 0; j < height; j++) {
    let row = 0;
    for (let i = 0; i < width; i++) {
      row += plane[j * width + i];
      out[(j + 1) * (width + 1) + i + 1] = out[j * (width + 1) + i + 1] + row;
    }
  }
  return out;
}

function box(sum, width, left, top, right, bottom) {
  const stride = width + 1;
  return sum[bottom * stride + right] - sum[top * stride + right] - sum[bottom * stride + left] + sum[top * stride + left];
}
