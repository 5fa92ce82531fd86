//! Voids: the holes enclosed by the grains and bonds of a 2D sample.
//!
//! Bonds between disks that touch do not cross, so the bonds are the edges of a plane graph. Its
//! bounded faces are the voids; the boundary of a void passes from one bond to the next at each
//! grain. The face outside the sample and the face around a fragment inside a void are not voids.

/// A face with a smaller ratio of area to the sum of squared edges is that of a tree, not a void.
const FLAT: f64 = 1e-6;

/// The voids, and for each bond the two voids that it separates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Voids {
    /// For each bond from i to j, the void on its left and on its right; `None` outside the sample.
    pub beside: Vec<[Option<usize>; 2]>,
    /// The centre of each void, m: the mean of its points of contact.
    pub centre: Vec<[f64; 2]>,
}

impl Voids {
    /// The voids between grains with centres `position` (m), bonded by `pair` with points of
    /// contact `point` (m).
    pub fn find(position: &[[f64; 2]], pair: &[[i32; 2]], point: &[[f64; 2]]) -> Self {
        let graph = Graph::new(position, pair);
        let mut voids = Self { beside: vec![[None; 2]; pair.len()], centre: vec![] };
        let mut seen = vec![false; 2 * pair.len()];
        for start in 0..seen.len() {
            if seen[start] {
                continue;
            }
            let face = graph.face(start);
            face.iter().for_each(|&edge| seen[edge] = true);
            if !graph.bounded(&face) {
                continue;
            }
            let mean = |k: usize| face.iter().map(|&edge| point[edge / 2][k]).sum::<f64>() / face.len() as f64;
            for &edge in &face {
                voids.beside[edge / 2][edge % 2] = Some(voids.centre.len());
            }
            voids.centre.push([mean(0), mean(1)]);
        }
        voids
    }
}

/// Every bond twice: edge 2b runs from i to j, edge 2b + 1 back.
struct Graph<'a> {
    position: &'a [[f64; 2]],
    pair: &'a [[i32; 2]],
    /// The edges that leave each grain, counter-clockwise.
    around: Vec<Vec<usize>>,
    /// The place of each edge in that list.
    place: Vec<usize>,
}

impl<'a> Graph<'a> {
    fn new(position: &'a [[f64; 2]], pair: &'a [[i32; 2]]) -> Self {
        let mut graph = Self { position, pair, around: vec![vec![]; position.len()], place: vec![0; 2 * pair.len()] };
        for edge in 0..2 * pair.len() {
            let grain = graph.from(edge);
            graph.around[grain].push(edge);
        }
        for grain in 0..position.len() {
            let mut edges = std::mem::take(&mut graph.around[grain]);
            let angle = |edge: usize| {
                let [x, y] = graph.way(edge);
                y.atan2(x)
            };
            edges.sort_by(|&a, &b| angle(a).total_cmp(&angle(b)));
            edges.iter().enumerate().for_each(|(k, &edge)| graph.place[edge] = k);
            graph.around[grain] = edges;
        }
        graph
    }

    fn from(&self, edge: usize) -> usize {
        self.pair[edge / 2][edge % 2] as usize
    }

    /// From the beginning to the end of an edge, m.
    fn way(&self, edge: usize) -> [f64; 2] {
        let (from, to) = (self.position[self.from(edge)], self.position[self.from(edge ^ 1)]);
        [to[0] - from[0], to[1] - from[1]]
    }

    /// The edge after `edge` around the face on its left: the next edge clockwise from the reverse
    /// edge.
    fn next(&self, edge: usize) -> usize {
        let back = edge ^ 1;
        let around = &self.around[self.from(back)];
        around[(self.place[back] + around.len() - 1) % around.len()]
    }

    fn face(&self, start: usize) -> Vec<usize> {
        let mut face = vec![start];
        let mut edge = self.next(start);
        while edge != start {
            face.push(edge);
            edge = self.next(edge);
        }
        face
    }

    /// Whether the face lies inside the line around it: then that line runs counter-clockwise.
    fn bounded(&self, face: &[usize]) -> bool {
        let origin = self.position[self.from(face[0])];
        let (mut area, mut size) = (0.0, 0.0);
        for &edge in face {
            let (at, way) = (self.position[self.from(edge)], self.way(edge));
            area += 0.5 * ((at[0] - origin[0]) * way[1] - (at[1] - origin[1]) * way[0]);
            size += way[0] * way[0] + way[1] * way[1];
        }
        area > FLAT * size
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn middles(position: &[[f64; 2]], pair: &[[i32; 2]]) -> Vec<[f64; 2]> {
        let middle = |[i, j]: &[i32; 2]| {
            let (a, b) = (position[*i as usize], position[*j as usize]);
            [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
        };
        pair.iter().map(middle).collect()
    }

    #[test]
    fn a_square_with_a_tail_has_one_void() {
        let position = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [2.0, 0.0]];
        let pair = [[0, 1], [2, 1], [2, 3], [3, 0], [1, 4]];
        let voids = Voids::find(&position, &pair, &middles(&position, &pair));
        assert_eq!(voids.centre, [[0.5, 0.5]]);
        // the second bond runs downwards: the void is on its right
        let inside = Some(0);
        assert_eq!(voids.beside, [[inside, None], [None, inside], [inside, None], [inside, None], [None, None]]);
    }

    #[test]
    fn voids_are_as_many_as_euler_counts() {
        // a lattice of 5 × 4 grains: edges − grains + 1 voids
        let position: Vec<[f64; 2]> = (0..20).map(|k| [f64::from(k % 5), f64::from(k / 5)]).collect();
        let right = (0..20).filter(|k| k % 5 < 4).map(|k| [k, k + 1]);
        let up = (0..15).map(|k| [k + 5, k]);
        let pair: Vec<[i32; 2]> = right.chain(up).collect();
        let voids = Voids::find(&position, &pair, &middles(&position, &pair));
        assert_eq!(voids.centre.len(), pair.len() - 20 + 1);
        // each void has four sides
        for void in 0..voids.centre.len() {
            assert_eq!(voids.beside.iter().flatten().filter(|&&side| side == Some(void)).count(), 4);
        }
    }

    #[test]
    fn a_pair_that_floats_in_a_void_encloses_nothing() {
        let position = [[0.0, 0.0], [9.0, 0.0], [4.0, 9.0], [4.0, 3.0], [5.0, 3.0]];
        let pair = [[0, 1], [1, 2], [2, 0], [3, 4]];
        let voids = Voids::find(&position, &pair, &middles(&position, &pair));
        assert_eq!((voids.centre.len(), voids.beside[3]), (1, [None; 2]));
    }
}
