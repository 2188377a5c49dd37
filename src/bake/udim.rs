//! Tiles of the plane of texture coordinates, each of which has an image of its own (UDIM).

use std::collections::BTreeSet;

use glam::{IVec2, Vec2};

use super::texels::Layout;

/// Distance by which a corner may lie outside of its tile.
const ROUNDING: f32 = 1e-4;
/// Tiles of a row, as their numbers count them.
const COLUMNS: i64 = 10;
/// Number of the first tile.
const FIRST: i64 = 1001;

/// Number of a tile: 1001 for the unit square, one more to the right, and ten more for each row up.
/// Texture coordinates grow downwards, so that rows up are negative. `None` for a tile that has no
/// number.
pub fn number(tile: IVec2) -> Option<u32> {
    let (column, row) = (i64::from(tile.x), -i64::from(tile.y));
    let number = FIRST + column + COLUMNS * row;
    ((0..COLUMNS).contains(&column) && row >= 0 && number < 10_000).then_some(number as u32)
}

/// The tiles of surfaces; `None` unless there are several, each triangle lies in one of them, and
/// no more than `most_overlap` of a tile shows several places.
pub fn tiles(size: [u32; 2], surfaces: &[&[[Vec2; 3]]], most_overlap: f64) -> Option<Vec<IVec2>> {
    let all = surfaces.iter().flat_map(|corners| corners.iter()).filter(|corners| has_area(corners));
    let tiles = all.map(|corners| tile_of(corners).filter(|tile| number(*tile).is_some()));
    let tiles: BTreeSet<[i32; 2]> = tiles.map(|tile| tile.map(|t| t.to_array())).collect::<Option<_>>()?;
    let is_unique = |tile: &[i32; 2]| {
        let shown: Vec<_> = surfaces.iter().map(|corners| corners_in(corners, IVec2::from(*tile))).collect();
        let shown: Vec<&[[Vec2; 3]]> = shown.iter().map(|corners| &corners[..]).collect();
        Layout::new(size, &shown).overlap() <= most_overlap
    };
    (tiles.len() > 1 && tiles.iter().all(is_unique)).then(|| tiles.into_iter().map(IVec2::from).collect())
}

/// Texture coordinates of the triangles of a tile as those of the unit square; all corners of other
/// triangles are its origin.
pub fn corners_in(corners: &[[Vec2; 3]], tile: IVec2) -> Vec<[Vec2; 3]> {
    let origin = tile.as_vec2();
    let shown = |c: &[Vec2; 3]| if tile_of(c) == Some(tile) { c.map(|c| c - origin) } else { [Vec2::ZERO; 3] };
    corners.iter().map(shown).collect()
}

fn has_area(corners: &[Vec2; 3]) -> bool {
    (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]) != 0.0
}

/// The tile in which a triangle lies; `None` across several.
fn tile_of(corners: &[Vec2; 3]) -> Option<IVec2> {
    let tile = (corners.iter().sum::<Vec2>() / 3.0).floor();
    let is_within = |c: &Vec2| {
        (*c - tile).cmpge(Vec2::splat(-ROUNDING)).all() && (*c - tile).cmple(Vec2::splat(1.0 + ROUNDING)).all()
    };
    corners.iter().all(is_within).then(|| tile.as_ivec2())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(low: Vec2) -> [Vec2; 3] {
        [low, low + Vec2::X, low + Vec2::Y]
    }

    #[test]
    fn tiles_are_numbered_to_the_right_and_upwards() {
        let cases = [((0, 0), Some(1001)), ((9, 0), Some(1010)), ((0, -1), Some(1011)), ((3, -2), Some(1024))];
        for ((x, y), expected) in
            cases.into_iter().chain([((10, 0), None), ((-1, 0), None), ((0, 1), None), ((i32::MAX, i32::MIN), None)])
        {
            assert_eq!(number(IVec2::new(x, y)), expected, "{x} {y}");
        }
    }

    #[test]
    fn surfaces_apart_in_tiles_are_found() {
        let [first, right, above] = [Vec2::ZERO, Vec2::X, Vec2::NEG_Y].map(triangle);
        let find = |all: &[[Vec2; 3]]| tiles([32; 2], &[all], 0.0);
        assert_eq!(find(&[first, right, above]), Some(vec![IVec2::NEG_Y, IVec2::ZERO, IVec2::X]));
        // one tile, two places in a tile, across two tiles, and below the first row
        assert_eq!(find(&[first]), None);
        assert_eq!(find(&[first, right, right]), None);
        assert_eq!(find(&[first, triangle(Vec2::new(0.5, 0.0))]), None);
        assert_eq!(find(&[first, triangle(Vec2::Y)]), None);

        // the triangles of a tile, by their numbers
        assert_eq!(corners_in(&[first, right], IVec2::X), [[Vec2::ZERO; 3], first]);
    }
}
