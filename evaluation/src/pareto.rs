//! Pareto fronts: which points no other point beats in cost and in error at once.

/// Whether each of `points` (cost, error), both the less the better, is on the front: no other point is at most as costly and at
/// most as wrong, and better in one of the two. Points that are not numbers never are. O(n log n).
pub fn front(points: &[(f64, f64)]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..points.len())
        .filter(|&k| !points[k].0.is_nan() && !points[k].1.is_nan())
        .collect();
    order.sort_by(|&a, &b| {
        let ((cost_a, error_a), (cost_b, error_b)) = (points[a], points[b]);
        cost_a.total_cmp(&cost_b).then(error_a.total_cmp(&error_b))
    });
    let mut on_front = vec![false; points.len()];
    // The last point put on the front; points equal to it are on it, too.
    let mut last: Option<(f64, f64)> = None;
    for k in order {
        let (cost, error) = points[k];
        if last
            .is_none_or(|(last_cost, least)| error < least || (error <= least && cost <= last_cost))
        {
            on_front[k] = true;
            last = Some((cost, error));
        }
    }
    on_front
}

#[cfg(test)]
mod tests {
    use super::*;

    fn naive(points: &[(f64, f64)]) -> Vec<bool> {
        let beats =
            |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
        points
            .iter()
            .map(|&p| !points.iter().any(|&q| beats(q, p)))
            .collect()
    }

    #[test]
    fn front_is_that_of_comparing_all_pairs() {
        let mut state = 7_u64;
        for count in [0, 1, 2, 5, 40] {
            let points: Vec<(f64, f64)> = (0..count)
                .map(|_| {
                    let mut next = || {
                        state = state
                            .wrapping_mul(6_364_136_223_846_793_005)
                            .wrapping_add(1);
                        // Few values, so that there are ties.
                        ((state >> 33) % 12) as f64
                    };
                    (next(), next())
                })
                .collect();
            assert_eq!(front(&points), naive(&points), "{points:?}");
        }
    }

    #[test]
    fn equal_points_are_on_it_together_and_no_number_is_not() {
        let points = [
            (1.0, 2.0),
            (1.0, 2.0),
            (1.0, 3.0),
            (2.0, 1.0),
            (0.5, f64::NAN),
        ];
        assert_eq!(front(&points), [true, true, false, true, false]);
    }
}
