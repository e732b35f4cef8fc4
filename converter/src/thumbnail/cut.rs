//! Which clusters a picture of a given size is drawn of.

use marquetry_format::writer::ClusterInput;

/// The clusters to draw: none is replaced whose `coarseness` is at most 1, but for the sake of others of its group or below.
///
/// `nodes` has children after what they replace. What is drawn stands for everything once, as a group is replaced by all of its children or not at all.
pub(super) fn cut(
    nodes: &[ClusterInput],
    coarseness: impl Fn(&ClusterInput) -> f64,
) -> Vec<&ClusterInput> {
    // A group by its first child; that of a node, 0 for a leaf.
    let group = |node: &ClusterInput| node.children.first().map(|&child| child as usize);
    let mut coarse = vec![0.0_f64; nodes.len()];
    for node in nodes {
        if let Some(first) = group(node) {
            coarse[first] = coarse[first].max(coarseness(node));
        }
    }
    // A group is at least as coarse as those below it, or these would be reached by some of their members only.
    for node in nodes.iter().rev() {
        if let Some(first) = group(node) {
            let below = node
                .children
                .iter()
                .filter_map(|&child| group(&nodes[child as usize]));
            coarse[first] = below
                .map(|first| coarse[first])
                .fold(coarse[first], f64::max);
        }
    }
    let mut reached = vec![false; nodes.len()];
    let mut drawn = Vec::new();
    for (id, node) in nodes.iter().enumerate() {
        if id > 0 && !reached[id] {
            continue;
        }
        if group(node).is_some_and(|first| coarse[first] > 1.0) {
            for &child in &node.children {
                reached[child as usize] = true;
            }
        } else {
            drawn.push(node);
        }
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(error: f32, children: &[u32]) -> ClusterInput {
        ClusterInput {
            error,
            children: children.to_vec(),
            ..ClusterInput::default()
        }
    }

    /// A root over 1 and 2; below both together 3 and 4, below 3 and 4 apart 5, 6 and 7, 8.
    fn graph() -> Vec<ClusterInput> {
        vec![
            node(8.0, &[1, 2]),
            node(4.0, &[3, 4]),
            node(4.0, &[3, 4]),
            node(2.0, &[5, 6]),
            node(1.5, &[7, 8]),
            node(1.0, &[]),
            node(1.0, &[]),
            node(1.0, &[]),
            node(1.0, &[]),
        ]
    }

    fn drawn(nodes: &[ClusterInput], coarseness: impl Fn(&ClusterInput) -> f64) -> Vec<usize> {
        let places = nodes.iter().map(std::ptr::from_ref).collect::<Vec<_>>();
        cut(nodes, coarseness)
            .into_iter()
            .filter_map(|node| places.iter().position(|&place| std::ptr::eq(place, node)))
            .collect()
    }

    #[test]
    fn a_cut_is_as_fine_as_asked_and_no_finer() {
        let nodes = graph();
        let at = |most: f64| drawn(&nodes, |node| f64::from(node.error) / most);
        assert_eq!(at(8.0), [0]);
        assert_eq!(at(7.9), [1, 2]);
        assert_eq!(at(3.0), [3, 4]);
        assert_eq!(at(1.6), [4, 5, 6]);
        assert_eq!(at(0.1), [5, 6, 7, 8]);
    }

    #[test]
    fn members_are_replaced_together_and_by_what_is_above() {
        let nodes = graph();
        let only = |index: usize| {
            let node = &nodes[index];
            drawn(
                &nodes,
                |other| if std::ptr::eq(other, node) { 2.0 } else { 0.0 },
            )
        };
        assert_eq!(only(2), [3, 4]);
        assert_eq!(only(4), [3, 7, 8]);
    }
}
