//! An elimination order with little fill: nested dissection by breadth-first levels.
//!
//! George & Liu, "An automatic nested dissection algorithm for irregular finite element problems", 1978. A connected part
//! is searched from a vertex of great eccentricity; a level that is short for what it cuts off separates the rest, without those of
//! its vertices that touch one side only, and comes last. On planar graphs, as here, separators are about as long as the
//! part is wide, which gives O(n log n) fill.

use super::edges::NONE;

/// Parts of at most this many are not dissected.
const SMALL: usize = 8;

/// Parts of more than this are searched twice, from an end that the first search finds. Others are short on all sides, and begin
/// at an end of the part that they come from.
const SEARCHED_TWICE: usize = 256;

/// An elimination order.
#[derive(Debug)]
pub(super) struct Order {
    /// The place of every vertex.
    pub(super) places: Vec<u32>,
    /// Where each separator, and each part that was left whole, begins: places up to the next are one of them.
    pub(super) blocks: Vec<u32>,
}

/// An elimination order of a graph, given by its edges.
pub(super) fn order(count: u32, pairs: &[[u32; 2]]) -> Order {
    let n = count as usize;
    let mut dissection = Dissection::of(n, pairs);
    let mut members: Vec<u32> = (0..count).collect();
    // Parts still to place: a range of `members`, which is also the range of places it gets.
    let mut parts = vec![(0, n)];
    let mut blocks = Vec::new();
    while let Some((start, end)) = parts.pop() {
        if end - start <= SMALL {
            if end > start {
                blocks.push(index(start));
            }
            continue;
        }
        let [first, second] = dissection.split(&mut members[start..end]);
        if start + first + second < end {
            blocks.push(index(start + first + second));
        }
        parts.push((start, start + first));
        parts.push((start + first, start + first + second));
    }
    blocks.sort_unstable();
    let mut places = vec![NONE; n];
    for (place, &member) in (0u32..).zip(&members) {
        places[member as usize] = place;
    }
    Order { places, blocks }
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
        let last = |list: &[u32]| list.last().copied().unwrap_or(0);
        self.search_from(last(members));
        if members.len() > SEARCHED_TWICE {
            self.search_from(last(&self.queue));
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
        let middle = self.shortest_level();
        let start = self.levels[middle];
        let end = self.levels.get(middle + 1).copied().unwrap_or(reached);
        // What touches nothing beyond the level is not needed to separate.
        let beyond = self.levels.get(middle + 2).copied().unwrap_or(reached);
        self.search += 1;
        for &vertex in &self.queue[end..beyond] {
            self.reached[vertex as usize] = self.search;
        }
        let (mut before, mut at) = (start, members.len());
        members[..start].copy_from_slice(&self.queue[..start]);
        for &vertex in &self.queue[start..end] {
            let v = vertex as usize;
            let touches = self.neighbours[self.starts[v] as usize..self.starts[v + 1] as usize]
                .iter()
                .any(|&to| self.reached[to as usize] == self.search);
            if touches || middle == 0 {
                at -= 1;
                members[at] = vertex;
            } else {
                members[before] = vertex;
                before += 1;
            }
        }
        members[before..at].copy_from_slice(&self.queue[end..]);
        [before, at - before]
    }

    /// The level of the last search with the fewest vertices for those on its smaller side.
    fn shortest_level(&self) -> usize {
        let all = self.queue.len();
        let mut best = (0, all, 0);
        for (level, &start) in self.levels.iter().enumerate() {
            let end = self.levels.get(level + 1).copied().unwrap_or(all);
            let (length, side) = (end - start, start.min(all - end));
            if length * best.2 < best.1 * side {
                best = (level, length, side);
            }
        }
        best.0
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
