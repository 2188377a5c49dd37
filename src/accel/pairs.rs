//! Pairs of triangles that share an edge: what a leaf of the wide hierarchy holds. Two triangles
//! take four corners instead of six, the shared edge is tested once, and the hierarchy is built
//! over half as many boxes.

use rayon::prelude::*;

use super::Aabb;

/// Stands for "no triangle".
pub const NONE: u32 = u32::MAX;

/// One triangle, or two with a common edge: (0, 1, 2) and (0, 2, 3) of `corners`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Triangle indices; the second may be [`NONE`].
    pub triangles: [u32; 2],
}

/// Vertex order of a pair of triangles, as a fan around the shared edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fan {
    /// Vertices; the last repeats the third where there is one triangle only.
    pub corners: [u32; 4],
    /// For each triangle, the positions within (0, 1, 2) and (0, 2, 3) of its second and third
    /// corner.
    pub second_third: [[u8; 2]; 2],
}

impl Fan {
    /// One triangle alone.
    pub fn single(t: [u32; 3]) -> Self {
        Self { corners: [t[0], t[1], t[2], t[2]], second_third: [[1, 2]; 2] }
    }

    /// Two triangles, if they share two vertices.
    pub fn from_triangles(a: [u32; 3], b: [u32; 3]) -> Option<Self> {
        // the corner of each that the other lacks
        let apex = (0..3).find(|&k| !b.contains(&a[k]))?;
        let other = (0..3).find(|&k| !a.contains(&b[k]))?;
        let corners = [a[(apex + 2) % 3], a[apex], a[(apex + 1) % 3], b[other]];
        let second = [corners[0], corners[2], corners[3]];
        let place = |v: u32| second.iter().position(|&s| s == v).map(|p| p as u8);
        // a degenerate triangle may repeat a vertex
        if corners[0] == corners[2]
            || b.iter().any(|&v| place(v).is_none())
            || b[0] == b[1]
            || b[1] == b[2]
            || b[2] == b[0]
        {
            return None;
        }
        let turn = (4 - apex as u8) % 3;
        let of_a = |k: u8| (k + turn) % 3;
        Some(Self { corners, second_third: [[of_a(1), of_a(2)], [place(b[1])?, place(b[2])?]] })
    }
}

/// Which of three edges, by its ends; and both ends in ascending order.
fn edge(t: &[u32; 3], k: usize) -> [u32; 2] {
    let (a, b) = (t[k], t[(k + 1) % 3]);
    [a.min(b), a.max(b)]
}

/// For every triangle and edge a triangle on its other side, or [`NONE`].
fn neighbours(triangles: &[[u32; 3]], vertex_count: usize) -> Vec<[u32; 3]> {
    // edges in buckets by their lower vertex
    let mut begin = vec![0u32; vertex_count + 1];
    for t in triangles {
        for k in 0..3 {
            begin[edge(t, k)[0] as usize + 1] += 1;
        }
    }
    for v in 0..vertex_count {
        begin[v + 1] += begin[v];
    }
    let mut fill = begin.clone();
    let mut entries = vec![[0u32; 2]; triangles.len() * 3];
    for (i, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let [low, high] = edge(t, k);
            let at = &mut fill[low as usize];
            entries[*at as usize] = [high, 3 * i as u32 + k as u32];
            *at += 1;
        }
    }

    // edges of a bucket with the same upper vertex are joined, two at a time
    let mut out = vec![[NONE; 3]; triangles.len()];
    let mut join = |a: u32, b: u32| {
        out[a as usize / 3][a as usize % 3] = b / 3;
        out[b as usize / 3][b as usize % 3] = a / 3;
    };
    for v in 0..vertex_count {
        let bucket = &mut entries[begin[v] as usize..begin[v + 1] as usize];
        // at a vertex of very many triangles, sorting brings those that share an edge together
        if bucket.len() > CROWDED {
            bucket.sort_unstable();
        }
        for i in 0..bucket.len() {
            let [high, a] = bucket[i];
            if a == NONE {
                continue;
            }
            let end = bucket.len().min(if bucket.len() > CROWDED { i + CROWDED } else { usize::MAX });
            let other = |j: &usize| bucket[*j][0] == high && bucket[*j][1] / 3 != a / 3 && bucket[*j][1] != NONE;
            if let Some(j) = (i + 1..end).find(other) {
                join(a, bucket[j][1]);
                bucket[j][1] = NONE;
            }
        }
    }
    out
}

/// Number of edges at a vertex above which not all pairs are compared.
const CROWDED: usize = 32;

/// Matches triangles with neighbours so that the boxes of the pairs are small: in each round,
/// triangles that are each other's best choice are paired. A box of a pair is never larger than
/// `GROWTH` times the two boxes of its triangles.
pub fn pair_up(triangles: &[[u32; 3]], boxes: &[Aabb], vertex_count: usize) -> Vec<Pair> {
    const ROUNDS: usize = 4;
    const GROWTH: f32 = 1.2;
    let neighbours = neighbours(triangles, vertex_count);
    let mut partner = vec![NONE; triangles.len()];
    let mut wish = vec![NONE; triangles.len()];

    // in each round every triangle wishes for its best neighbour, and mutual wishes become pairs
    for _ in 0..ROUNDS {
        wish.par_iter_mut().with_min_len(4096).enumerate().for_each(|(t, wish)| {
            *wish = NONE;
            if partner[t] != NONE {
                return;
            }
            let mut best = (f32::INFINITY, NONE, NONE);
            for &n in &neighbours[t] {
                if n == NONE
                    || partner[n as usize] != NONE
                    || Fan::from_triangles(triangles[t], triangles[n as usize]).is_none()
                {
                    continue;
                }
                let (a, b) = (boxes[t], boxes[n as usize]);
                let (union, sum) = (a.union(b).half_area(), a.half_area() + b.half_area());
                if union > GROWTH * sum {
                    continue;
                }
                let key = (union - sum, (t as u32).min(n), (t as u32).max(n));
                if key < best {
                    best = key;
                    *wish = n;
                }
            }
        });

        // both sides see the same wishes, so that this needs no lock
        partner.par_iter_mut().with_min_len(4096).enumerate().for_each(|(t, partner)| {
            let w = wish[t];
            if *partner == NONE && w != NONE && wish[w as usize] == t as u32 {
                *partner = w;
            }
        });
    }

    // the lower triangle of a pair lists it
    let mut pairs = Vec::with_capacity(triangles.len() / 2 + 1);
    for (t, &p) in partner.iter().enumerate() {
        if p == NONE || p > t as u32 {
            pairs.push(Pair { triangles: [t as u32, p] });
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn boxes(triangles: &[[u32; 3]], positions: &[Vec3]) -> Vec<Aabb> {
        triangles.iter().map(|t| Aabb::of_points(&t.map(|v| positions[v as usize]))).collect()
    }

    /// The corners of both triangles by a fan, as each triangle has them: its first is what the
    /// other two leave.
    fn unfolded(fan: &Fan) -> [[u32; 3]; 2] {
        let [a, b, c, d] = fan.corners;
        let own = |corners: [u32; 3], [second, third]: [u8; 2]| {
            let first = 3 - second - third;
            [first, second, third].map(|k| corners[k as usize])
        };
        [own([a, b, c], fan.second_third[0]), own([a, c, d], fan.second_third[1])]
    }

    fn turned(t: [u32; 3], by: usize) -> [u32; 3] {
        [0, 1, 2].map(|k| t[(k + by) % 3])
    }

    #[test]
    fn a_fan_keeps_both_triangles_corners_in_their_order() {
        for k in 0..36 {
            // two vertices in common, every rotation and winding
            let a = turned(if k / 9 % 2 == 0 { [10, 20, 30] } else { [20, 10, 30] }, k % 3);
            let b = turned(if k / 18 == 0 { [20, 10, 40] } else { [10, 20, 40] }, k / 3 % 3);
            let fan = Fan::from_triangles(a, b).unwrap_or_else(|| panic!("{a:?} and {b:?} share an edge"));
            assert_eq!(unfolded(&fan), [a, b], "{fan:?}");
            let mut ends = [fan.corners[0], fan.corners[2]];
            ends.sort_unstable();
            assert_eq!(ends, [10, 20], "{a:?} {b:?}: the diagonal is not the common edge");
        }
        let one = Fan::single([7, 8, 9]);
        assert_eq!(unfolded(&one)[0], [7, 8, 9]);
    }

    /// Very many triangles around one vertex: those with a common edge find each other, and in
    /// time.
    #[test]
    fn a_crowded_vertex() {
        const PAIRS: u32 = 100_000;
        let triangles: Vec<[u32; 3]> =
            (0..PAIRS).flat_map(|i| [[0, 3 * i + 1, 3 * i + 2], [0, 3 * i + 2, 3 * i + 3]]).collect();
        let found = neighbours(&triangles, 3 * PAIRS as usize + 1);
        for i in 0..PAIRS {
            let (a, b) = (2 * i, 2 * i + 1);
            assert_eq!(found[a as usize], [NONE, NONE, b]);
            assert_eq!(found[b as usize], [a, NONE, NONE]);
        }
    }

    #[test]
    fn what_is_no_pair_is_refused() {
        for (a, b) in [
            // nothing in common; one corner
            ([0, 1, 2], [3, 4, 5]),
            ([0, 1, 2], [2, 3, 4]),
            // the same triangle, turned, and wound the other way
            ([0, 1, 2], [0, 1, 2]),
            ([0, 1, 2], [1, 2, 0]),
            ([0, 1, 2], [2, 1, 0]),
            // a corner twice
            ([0, 1, 2], [1, 1, 2]),
            ([0, 1, 2], [1, 2, 1]),
            ([0, 1, 2], [1, 3, 3]),
            ([1, 1, 2], [0, 1, 2]),
            ([0, 1, 1], [1, 2, 3]),
            ([1, 0, 1], [1, 0, 2]),
            ([0, 0, 0], [0, 0, 0]),
        ] {
            assert_eq!(Fan::from_triangles(a, b), None, "{a:?} {b:?}");
        }
    }

    /// Every triangle is in one pair, once; partners share an edge and do not grow their boxes
    /// beyond what is allowed.
    fn check(triangles: &[[u32; 3]], positions: &[Vec3]) -> usize {
        let boxes = boxes(triangles, positions);
        let pairs = pair_up(triangles, &boxes, positions.len());
        let mut seen = vec![0; triangles.len()];
        for Pair { triangles: [a, b] } in &pairs {
            seen[*a as usize] += 1;
            if *b != NONE {
                seen[*b as usize] += 1;
                let fan = Fan::from_triangles(triangles[*a as usize], triangles[*b as usize])
                    .expect("a pair without a common edge");
                assert_eq!(unfolded(&fan), [triangles[*a as usize], triangles[*b as usize]]);
                let (a, b) = (boxes[*a as usize], boxes[*b as usize]);
                assert!(a.union(b).half_area() <= 1.21 * (a.half_area() + b.half_area()));
            }
        }
        assert!(seen.iter().all(|&n| n == 1), "{seen:?}");
        pairs.iter().filter(|p| p.triangles[1] != NONE).count()
    }

    #[test]
    fn meshes_of_every_kind_are_paired() {
        // a sheet of quads: nearly all find a partner
        let n = 20u32;
        let positions: Vec<Vec3> =
            (0..n * n).map(|i| Vec3::new((i % n) as f32, (i / n) as f32, (i * 7 % 5) as f32 * 0.1)).collect();
        let mut sheet = Vec::new();
        for i in (0..n * (n - 1)).filter(|i| i % n < n - 1) {
            sheet.extend([[i, i + 1, i + n + 1], [i, i + n + 1, i + n]]);
        }
        let pairs = check(&sheet, &positions);
        assert!(pairs * 2 > sheet.len() * 9 / 10, "{pairs} pairs of {} triangles", sheet.len());
        // all of it twice, the second time wound the other way: four triangles to an edge
        let twice: Vec<_> = sheet.iter().copied().chain(sheet.iter().map(|&[a, b, c]| [a, c, b])).collect();
        assert!(check(&twice, &positions) > sheet.len() / 2);
        // one edge of all, the same triangle many times, ones without area among them
        let fan: Vec<_> = (2..50).map(|k| [0, 1, k]).collect();
        assert!(check(&fan, &positions) > 0);
        assert_eq!(check(&[[0, 1, 25]; 30], &positions), 0);
        let broken: Vec<_> =
            (0..40).flat_map(|k| [[k, k, k], [k, k + 1, k], [k, k + 1, k + 21], [k + 1, k, k]]).collect();
        check(&broken, &positions);
        assert_eq!(check(&[], &[]), 0);
    }
}
