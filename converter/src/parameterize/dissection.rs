//! An elimination order with little fill: nested dissection by breadth-first levels.
//!
//! George & Liu, "An automatic nested dissection algorithm for irregular finite element problems", 1978. A connected part
//! is searched from a vertex of great eccentricity; the level that halves it separates the rest, and comes last. On
//! planar graphs, as here, separators are about as long as the part is wide, which gives O(n log n) fill.

use super::edges::NONE;

/// Parts of at most this many are not dissected.
const SMALL: usize = 24;

/// Searches for a vertex of greater eccentricity.
const SEARCHES: usize = 3;

/// The place of every vertex of a graph in the elimination order.
pub(super) fn order(count: u32, pairs: &[[u32; 2]]) -> Vec<u32> {
    let n = count as usize;
    if n <= SMALL {
        return (0..count).collect();
    }
    let mut dissection = Dissection::of(n, pairs);
    let mut members: Vec<u32> = (0..count).collect();
    // Parts still to place: a range of `members`, which is also the range of places it gets.
    let mut parts = vec![(0, n)];
    let mut places = vec![NONE; n];
    while let Some((start, end)) = parts.pop() {
        if end - start <= SMALL {
            for (place, &member) in (start..end).zip(&members[start..end]) {
                places[member as usize] = index(place);
            }
            continue;
        }
        let [first, second] = dissection.split(&mut members[start..end]);
        for (place, &member) in
            (start + first + second..end).zip(&members[start + first + second..end])
        {
            places[member as usize] = index(place);
        }
        parts.push((start, start + first));
        parts.push((start + first, start + first + second));
    }
    places
}

/// An index as it is stored; patches have fewer than 2^32 vertices.
fn index(place: usize) -> u32 {
    u32::try_from(place).unwrap_or(NONE)
}

/// A graph and what searching it needs.
struct Dissection {
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    /// Part that a vertex is in; parts are numbered as they are split.
    part: Vec<u32>,
    current: u32,
    /// Mark of the last search that reached a vertex.
    reached: Vec<u32>,
    search: u32,
    queue: Vec<u32>,
    /// Where each level of the last search starts in the queue.
    levels: Vec<usize>,
}

impl Dissection {
    fn of(n: usize, pairs: &[[u32; 2]]) -> Self {
        let mut starts = vec![0u32; n + 1];
        for &vertex in pairs.as_flattened() {
            starts[vertex as usize + 1] += 1;
        }
        for k in 0..n {
            starts[k + 1] += starts[k];
        }
        let mut next = starts.clone();
        let mut neighbours = vec![0u32; pairs.len() * 2];
        for &[a, b] in pairs {
            for (from, to) in [(a, b), (b, a)] {
                neighbours[next[from as usize] as usize] = to;
                next[from as usize] += 1;
            }
        }
        Self {
            starts,
            neighbours,
            part: vec![0; n],
            current: 0,
            reached: vec![0; n],
            search: 0,
            queue: Vec::with_capacity(n),
            levels: Vec::new(),
        }
    }

    /// Sorts a part into two that do not touch and what separates them, in this order; returns the lengths of the two.
    fn split(&mut self, members: &mut [u32]) -> [usize; 2] {
        self.current += 1;
        for &member in &*members {
            self.part[member as usize] = self.current;
        }
        let mut depth = 0;
        let mut root = members[0];
        for _ in 0..SEARCHES {
            self.search_from(root);
            if self.levels.len() <= depth {
                break;
            }
            depth = self.levels.len();
            root = self.queue.last().copied().unwrap_or(root);
        }
        let reached = self.queue.len();
        if reached < members.len() {
            // The part falls into pieces: the one found, and the rest.
            let (reached_by, search) = (&self.reached, self.search);
            let rest = members
                .iter()
                .filter(|&&member| reached_by[member as usize] != search);
            self.queue.extend(rest);
            members.copy_from_slice(&self.queue);
            return [reached, members.len() - reached];
        }
        let middle = self
            .levels
            .partition_point(|&start| start <= reached / 2)
            .max(1)
            - 1;
        let start = self.levels[middle];
        let end = self.levels.get(middle + 1).copied().unwrap_or(reached);
        let (before, after) = (start, reached - end);
        members[..before].copy_from_slice(&self.queue[..start]);
        members[before..before + after].copy_from_slice(&self.queue[end..]);
        members[before + after..].copy_from_slice(&self.queue[start..end]);
        [before, after]
    }

    /// Breadth-first search of `root`'s part.
    fn search_from(&mut self, root: u32) {
        self.search += 1;
        self.queue.clear();
        self.levels.clear();
        self.queue.push(root);
        self.reached[root as usize] = self.search;
        let mut start = 0;
        while start < self.queue.len() {
            let end = self.queue.len();
            self.levels.push(start);
            for at in start..end {
                let vertex = self.queue[at] as usize;
                for p in self.starts[vertex]..self.starts[vertex + 1] {
                    let to = self.neighbours[p as usize] as usize;
                    if self.part[to] == self.current && self.reached[to] != self.search {
                        self.reached[to] = self.search;
                        self.queue.push(self.neighbours[p as usize]);
                    }
                }
            }
            start = end;
        }
    }
}
