//! Shapes of marks.

/// The path of the mark of `style` (0..6) around (x, y).
pub(super) fn path(style: usize, x: f64, y: f64) -> String {
    const R: f64 = 4.0;
    match style {
        0 => format!(
            "M{:.1} {y:.1}a{R} {R} 0 1 0 {} 0a{R} {R} 0 1 0 -{} 0z",
            x - R,
            2.0 * R,
            2.0 * R
        ),
        1 => format!("M{:.1} {:.1}h7v7h-7z", x - 3.5, y - 3.5),
        2 => format!("M{x:.1} {:.1}l4.6 8h-9.2z", y - 5.0),
        3 => format!("M{x:.1} {:.1}l5 5l-5 5l-5 -5z", y - 5.0),
        4 => format!("M{x:.1} {:.1}l4.6 -8h-9.2z", y + 5.0),
        _ => format!("M{:.1} {:.1}h8v4h-8z", x - 4.0, y - 2.0),
    }
}
