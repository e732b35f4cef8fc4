//! Unit normals in two bytes: the octahedral map.
//!
//! Meyer et al., "On Floating-Point Normal Vectors", 2010; Cigolle et al., "A Survey of Efficient
//! Representations for Independent Unit Vectors", 2014. A byte b stands for the coordinate 2b − 255 of 255.
//! Limit: about 0.95° worst error; the four corners of the square are all −z, and the exact axes fall between
//! codes. Arithmetic on codes goes through integer vectors of L1 norm 255, so it is equal on every machine.

#![allow(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "components are bounded as documented, codes are clamped to a byte"
)]

/// The code of `normal`, any length; (0, 0, 1) for a vector that is zero or not finite.
pub fn encode(normal: [f32; 3]) -> [u8; 2] {
    let [x, y, z] = normal.map(f64::from);
    let sum = x.abs() + y.abs() + z.abs();
    if !(sum.is_finite() && sum > 0.0) {
        return [128, 128];
    }
    let (mut u, mut v) = (x / sum, y / sum);
    if z < 0.0 {
        (u, v) = ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v));
    }
    [u, v].map(|c| {
        (127.5 * (c.clamp(-1.0, 1.0) + 1.0) + 0.5)
            .floor()
            .min(255.0) as u8
    })
}

/// The unit normal of `code`.
pub fn decode(code: [u8; 2]) -> [f32; 3] {
    let [x, y, z] = vector(code).map(f64::from);
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|c| (c / length) as f32)
}

/// The integer vector of `code`; its L1 norm is 255.
pub fn vector(code: [u8; 2]) -> [i32; 3] {
    let [x, y] = code.map(|c| 2 * i32::from(c) - 255);
    let z = 255 - x.abs() - y.abs();
    if z >= 0 {
        [x, y, z]
    } else {
        [(255 - y.abs()) * sign(x), (255 - x.abs()) * sign(y), z]
    }
}

/// The code nearest to an integer vector in octahedral coordinates; `None` for zero.
///
/// Coordinates are below 2^20 in magnitude.
pub fn from_vector([x, y, z]: [i32; 3]) -> Option<[u8; 2]> {
    let sum = x.abs() + y.abs() + z.abs();
    if sum == 0 {
        return None;
    }
    let (x, y) = if z < 0 {
        ((sum - y.abs()) * sign(x), (sum - x.abs()) * sign(y))
    } else {
        (x, y)
    };
    // round(255 · (c / sum + 1) / 2), in 31 bits: the sum has 22, a code is at most 255.5 before it is rounded down.
    Some([x, y].map(|c| ((255 * (c + sum) + sum) as u32 / (2 * sum) as u32) as u8))
}

fn sign(value: i32) -> i32 {
    if value < 0 { -1 } else { 1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_survives_decode_and_encode() {
        for u in 0..=255u8 {
            for v in 0..=255u8 {
                let integer = from_vector(vector([u, v])).unwrap();
                let float = encode(decode([u, v]));
                // On the rim of the square two codes name one vector.
                assert_eq!(vector(integer), vector([u, v]));
                assert_eq!(vector(float), vector([u, v]));
            }
        }
    }

    #[test]
    fn codes_are_rounded_exactly() {
        let mut state = 1u32;
        let mut next = |limit: i32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (i64::from(state >> 8) * i64::from(2 * limit + 1)) >> 24
        };
        for limit in [1, 7, 255, 10_200, (1 << 20) - 1] {
            for _ in 0..50_000 {
                let [x, y, z] = [0; 3].map(|_| next(limit) as i32 - limit);
                let sum = x.abs() + y.abs() + z.abs();
                if sum == 0 {
                    continue;
                }
                let [u, v] = if z < 0 {
                    [(sum - y.abs()) * sign(x), (sum - x.abs()) * sign(y)]
                } else {
                    [x, y]
                };
                // Half up: 255 / 2 · (c / sum + 1) + 1 / 2, over one denominator.
                let exact = [u, v].map(|c| {
                    let numerator = 255 * i64::from(c + sum) + i64::from(sum);
                    (numerator / (2 * i64::from(sum))).min(255) as u8
                });
                assert_eq!(from_vector([x, y, z]), Some(exact), "{x} {y} {z}");
            }
        }
    }

    #[test]
    fn vectors_have_norm_255() {
        for u in 0..=255u8 {
            for v in 0..=255u8 {
                assert_eq!(vector([u, v]).iter().map(|c| c.abs()).sum::<i32>(), 255);
            }
        }
    }

    #[test]
    fn error_stays_below_one_degree() {
        for k in 0..20_000 {
            let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / 20_000.0;
            let (s, c) = (2.399_963_2 * f64::from(k)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let n = [(r * c) as f32, (r * s) as f32, z as f32];
            let m = decode(encode(n));
            let dot: f64 = n
                .iter()
                .zip(m)
                .map(|(a, b)| f64::from(*a) * f64::from(b))
                .sum();
            assert!(dot > 0.999_85, "{n:?} became {m:?}");
        }
    }

    #[test]
    fn degenerate_vectors_have_a_code() {
        assert_eq!(encode([0.0; 3]), [128, 128]);
        assert_eq!(encode([f32::NAN, 0.0, 1.0]), [128, 128]);
        assert_eq!(encode([f32::INFINITY, 0.0, 1.0]), [128, 128]);
        assert_eq!(from_vector([0; 3]), None);
    }
}
