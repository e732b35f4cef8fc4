use super::*;
use crate::image::silhouette;

const SIZE: usize = 48;

fn pattern(colour: impl Fn(usize, usize) -> [usize; 3]) -> Vec<u8> {
    (0..SIZE * SIZE)
        .flat_map(|pixel| {
            let [r, g, b] = colour(pixel % SIZE, pixel / SIZE)
                .map(|value| u8::try_from(value.min(255)).unwrap());
            [r, g, b, 255]
        })
        .collect()
}

fn base(x: usize, y: usize) -> [usize; 3] {
    [x * 5 % 256, y * 5 % 256, x * y / 9 % 256]
}

fn map(a: &[u8], b: &[u8]) -> Vec<f64> {
    let [a, b] = [a, b].map(|bytes| Image::new(SIZE, SIZE, bytes).unwrap());
    flip_map(a, b).unwrap()
}

fn mean(a: &[u8], b: &[u8]) -> f64 {
    let everything = silhouette(Image::new(SIZE, SIZE, a).unwrap(), [1, 2, 3]);
    let [a, b] = [a, b].map(|bytes| Image::new(SIZE, SIZE, bytes).unwrap());
    flip(a, b, &everything).unwrap().unwrap()
}

/// Two images, the mean, and four pixels.
type Case = (Vec<u8>, Vec<u8>, f64, [f64; 4]);

/// What NVIDIA's own implementation says of the same images (`flip-evaluator` 1.7 of `PyPI`, `evaluate(…, "LDR")`): the mean,
/// and the pixels (0, 0), (16, 16), (24, 20), (40, 30).
#[test]
fn values_are_those_of_the_published_implementation() {
    let grey = |_, _| [120, 120, 118];
    let square = |x, y| {
        if (16..32).contains(&x) && (16..32).contains(&y) {
            [200, 60, 40]
        } else {
            [120, 120, 118]
        }
    };
    let redder = |x, y| {
        let [r, g, b] = base(x, y);
        [r + 20, g, b]
    };
    let cases: [Case; 5] = [
        (
            pattern(|_, _| [0; 3]),
            pattern(|_, _| [255; 3]),
            0.967_391_968,
            [0.967_388; 4],
        ),
        (
            pattern(base),
            pattern(|x, y| base((x + 2).min(SIZE - 1), y)),
            0.142_902_821,
            [0.044_195, 0.122_445, 0.144_125, 0.182_952],
        ),
        (
            pattern(base),
            pattern(redder),
            0.218_594_894,
            [0.084_371, 0.207_059, 0.2377, 0.273_399],
        ),
        (
            pattern(grey),
            pattern(square),
            0.100_010_432,
            [0.0, 0.441_413, 0.712_058, 0.003_14],
        ),
        (
            pattern(|_, _| [0, 255, 0]),
            pattern(|_, _| [0, 0, 255]),
            1.0,
            [1.0; 4],
        ),
    ];
    for (number, (a, b, expected, pixels)) in cases.iter().enumerate() {
        let found = mean(a, b);
        assert!((found - expected).abs() < 1e-4, "case {number}: {found}");
        let map = map(a, b);
        for ((x, y), expected) in [(0, 0), (16, 16), (24, 20), (40, 30)]
            .into_iter()
            .zip(pixels)
        {
            let found = map[y * SIZE + x];
            assert!(
                (found - expected).abs() < 5e-4,
                "case {number} at ({x}, {y}): {found}"
            );
        }
    }
}

#[test]
fn equal_images_do_not_differ_and_an_empty_mask_has_no_mean() {
    let a = pattern(base);
    assert!(map(&a, &a).iter().all(|&value| value == 0.0));
    let image = Image::new(SIZE, SIZE, &a).unwrap();
    assert_eq!(flip(image, image, &Mask::empty(SIZE, SIZE)), Ok(None));
    let narrow = Image::new(1, 1, &[0; 4]).unwrap();
    assert!(matches!(
        flip_map(image, narrow),
        Err(ImageError::Size { .. })
    ));
}

/// The filters over the plane, pixel by pixel, as the paper writes them.
#[test]
fn filters_in_two_passes_are_those_over_the_plane() {
    let image = pattern(base);
    let size = (SIZE, SIZE);
    let channel = &opponent_colours(Image::new(SIZE, SIZE, &image).unwrap())[2];
    let weight = |x: f64, y: f64| -> f64 {
        SENSITIVITY[2]
            .iter()
            .map(|&(a, b)| {
                let z = (x * x + y * y) / (PIXELS_PER_DEGREE * PIXELS_PER_DEGREE);
                a * (PI / b).sqrt() * (-PI * PI * z / b).exp()
            })
            .sum()
    };
    let reach = isize::try_from(REACH).unwrap();
    let at = |x: isize, y: isize| {
        let last = isize::try_from(SIZE).unwrap() - 1;
        let [x, y] = [x, y].map(|c| usize::try_from(c.clamp(0, last)).unwrap());
        channel[y * SIZE + x]
    };
    let kernels = SENSITIVITY[2].map(|(_, width)| sensitivity_kernel(width));
    let shares = [0, 1].map(|k| {
        let (a, b) = SENSITIVITY[2][k];
        a * (PI / b).sqrt() * kernels[k].sum().powi(2)
    });
    let parts = kernels.map(|kernel| {
        let smooth = kernel.normalized();
        filtered(channel, size, &smooth, &smooth)
    });
    for (x, y) in [(0, 0), (5, 40), (24, 24), (47, 3)] {
        let (mut sum, mut total) = (0.0, 0.0);
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                #[expect(clippy::cast_precision_loss, reason = "at most 10")]
                let weight = weight(dx as f64, dy as f64);
                sum += weight * at(x + dx, y + dy);
                total += weight;
            }
        }
        let pixel = usize::try_from(y).unwrap() * SIZE + usize::try_from(x).unwrap();
        let found =
            (shares[0] * parts[0][pixel] + shares[1] * parts[1][pixel]) / (shares[0] + shares[1]);
        assert!((found - sum / total).abs() < 1e-9, "({x}, {y})");
    }
}
