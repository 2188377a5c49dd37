//! Values of texels that no surface covers: that of the nearest one which is covered, so that
//! filters and mip levels mix nothing else into the borders of charts.

/// For each texel the index of the covered texel nearest to it, itself where it is covered; `None`
/// farther than `most` texels away, and where nothing is covered. Distances are Euclidean, off by
/// less than a texel (Danielsson 1980, as an 8-neighbour sweep).
pub fn nearest_covered(covered: &[bool], [width, height]: [u32; 2], most: f64) -> Vec<Option<u32>> {
    let (width, height) = (width as i64, height as i64);
    let mut nearest: Vec<Option<u32>> = covered.iter().enumerate().map(|(i, c)| c.then_some(i as u32)).collect();
    let distance = |at: i64, from: u32| {
        let (dx, dy) = (at % width - i64::from(from) % width, at / width - i64::from(from) / width);
        dx * dx + dy * dy
    };
    let take = |nearest: &mut [Option<u32>], x: i64, y: i64, neighbours: &[(i64, i64)]| {
        let at = y * width + x;
        for (dx, dy) in neighbours {
            let (nx, ny) = (x + dx, y + dy);
            if nx < 0 || ny < 0 || nx >= width || ny >= height {
                continue;
            }
            let Some(found) = nearest[(ny * width + nx) as usize] else { continue };
            if nearest[at as usize].is_none_or(|own| distance(at, found) < distance(at, own)) {
                nearest[at as usize] = Some(found);
            }
        }
    };

    // down and up, and within each row to the right and to the left
    for y in 0..height {
        (0..width).for_each(|x| take(&mut nearest, x, y, &[(-1, -1), (0, -1), (1, -1), (-1, 0)]));
        (0..width).rev().for_each(|x| take(&mut nearest, x, y, &[(1, 0)]));
    }
    for y in (0..height).rev() {
        (0..width).rev().for_each(|x| take(&mut nearest, x, y, &[(1, 1), (0, 1), (-1, 1), (1, 0)]));
        (0..width).for_each(|x| take(&mut nearest, x, y, &[(-1, 0)]));
    }
    for (at, found) in nearest.iter_mut().enumerate() {
        *found = found.filter(|&from| (distance(at as i64, from) as f64) <= most * most);
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_texel_is_found_within_reach() {
        let size = [37u32, 23];
        let count = (size[0] * size[1]) as usize;
        let covered: Vec<bool> = (0..count).map(|i| i * 7919 % 61 == 3).collect();
        let found = nearest_covered(&covered, size, f64::INFINITY);
        let place = |i: usize| [(i as u32 % size[0]) as f64, (i as u32 / size[0]) as f64];
        let distance = |a: usize, b: usize| {
            let ([ax, ay], [bx, by]) = (place(a), place(b));
            (ax - bx).hypot(ay - by)
        };
        for at in 0..count {
            let least = (0..count).filter(|&i| covered[i]).map(|i| distance(at, i)).fold(f64::INFINITY, f64::min);
            let own = found[at].map(|from| distance(at, from as usize)).unwrap();
            assert!(own < least + 1.0, "{at}: {own} {least}");
            assert!(!covered[at] || found[at] == Some(at as u32));
            let near = nearest_covered(&covered, size, 2.0)[at];
            assert_eq!(near.is_some(), own <= 2.0, "{at}");
            if at > 40 {
                break;
            }
        }
        assert!(nearest_covered(&[false; 6], [3, 2], 9.0).iter().all(Option::is_none));
    }
}
