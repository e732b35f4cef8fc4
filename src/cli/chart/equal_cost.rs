//! The file against discrete levels of detail at the same cost.
//!
//! At every distance and setting the levels' SSIM is read off their curve at as many triangles as the file draws: linear in the
//! logarithm of triangles, between the two levels around it. Where the levels have no such point nothing is said.

use super::data::{EqualCost, EqualCostPair, Method, PicturePoint, Versus};
use super::pictures::same;

/// Compares the curves of `points`; `None` where there are no pictures.
pub(super) fn compare(points: &[PicturePoint]) -> Option<EqualCost> {
    let ours = points.iter().filter(|p| p.method == Method::Marquetry);
    let pairs: Vec<EqualCostPair> = ours
        .filter_map(|ours| {
            let mut curve: Vec<&PicturePoint> = points
                .iter()
                .filter(|p| {
                    matches!(p.method, Method::DiscreteLods | Method::Original)
                        && same(p.distance, ours.distance)
                })
                .collect();
            curve.sort_by(|a, b| a.triangles.total_cmp(&b.triangles));
            let versus = |ssim: fn(&PicturePoint) -> Option<f64>| {
                Some(Versus {
                    marquetry: ssim(ours)?,
                    discrete_lods: between(&curve, ours.triangles, ssim)?,
                })
            };
            Some(EqualCostPair {
                distance: ours.distance,
                setting: ours.setting.clone(),
                triangles: ours.triangles,
                all_views: versus(|p| Some(p.ssim.mean))?,
                three_views: versus(|p| p.ssim_three_views),
            })
        })
        .collect();
    (!points.is_empty()).then(|| EqualCost {
        all_views: mean(pairs.iter().map(|pair| pair.all_views)),
        three_views: mean(pairs.iter().filter_map(|pair| pair.three_views)),
        pairs,
    })
}

/// The value of a curve at `triangles`.
fn between(
    curve: &[&PicturePoint],
    triangles: f64,
    value: fn(&PicturePoint) -> Option<f64>,
) -> Option<f64> {
    let above = curve.iter().position(|p| p.triangles >= triangles)?;
    let high = curve.get(above)?;
    if high.triangles <= triangles {
        return value(high);
    }
    let low = curve.get(above.checked_sub(1)?)?;
    let part = (triangles / low.triangles).ln() / (high.triangles / low.triangles).ln();
    let (low, high) = (value(low)?, value(high)?);
    Some(low + part * (high - low))
}

fn mean(values: impl Iterator<Item = Versus>) -> Option<Versus> {
    let (sum, count) = values.fold(([0.0; 2], 0.0), |(sum, count), v| {
        (
            [sum[0] + v.marquetry, sum[1] + v.discrete_lods],
            count + 1.0,
        )
    });
    (count > 0.0).then(|| Versus {
        marquetry: sum[0] / count,
        discrete_lods: sum[1] / count,
    })
}

#[cfg(test)]
mod tests {
    use super::super::data::{Estimate, FrameTime};
    use super::*;

    fn point(method: Method, distance: f64, triangles: f64, ssim: f64) -> PicturePoint {
        let estimate = |mean| Estimate {
            mean,
            interval: None,
        };
        PicturePoint {
            method,
            distance,
            setting: String::new(),
            triangles,
            ssim: estimate(ssim),
            flip: estimate(0.0),
            psnr_db: None,
            outline: None,
            ssim_three_views: Some(ssim - 0.1),
            time: FrameTime::default(),
            views: 1,
            on_front: false,
        }
    }

    #[test]
    fn curves_are_read_between_their_points_and_not_beyond() {
        let points = [
            point(Method::DiscreteLods, 2.0, 100.0, 0.5),
            point(Method::DiscreteLods, 2.0, 10_000.0, 0.9),
            point(Method::DiscreteLods, 5.0, 1_000.0, 0.1),
            point(Method::Marquetry, 2.0, 1_000.0, 0.8),
            point(Method::Marquetry, 2.0, 50.0, 0.3),
            point(Method::Marquetry, 2.0, 20_000.0, 0.95),
            point(Method::Marquetry, 5.0, 1_000.0, 0.6),
        ];
        let found = compare(&points).unwrap();
        assert_eq!(found.pairs.len(), 2);
        let first = found.pairs[0].all_views;
        assert!((first.marquetry - 0.8).abs() < 1e-12);
        assert!((first.discrete_lods - 0.7).abs() < 1e-12);
        let all = found.all_views.unwrap();
        assert!((all.marquetry - 0.7).abs() < 1e-12 && (all.discrete_lods - 0.4).abs() < 1e-12);
        let three = found.three_views.unwrap();
        assert!((three.discrete_lods - 0.3).abs() < 1e-12);
        assert!(compare(&[]).is_none());
    }
}
