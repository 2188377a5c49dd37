//! Tiles of a film converge with their neighbours.

use skylit::film::Film;
use skylit::film::convergence::{TileCount, TileErrors};

#[test]
fn a_tile_waits_for_its_neighbours() {
    // five by three tiles, the last ones cut
    let mut film = Film::new(38, 20, 3);
    film.samples.fill(64);
    film.variance.fill(0.64);
    let quiet = TileErrors::from_film(&film);
    assert_eq!(quiet.errors.len(), 15);
    assert!(quiet.errors.iter().all(|e| (e - 0.1).abs() < 1e-6));
    assert_eq!(quiet.count(0.1001), TileCount { done: 15, all: 15 });
    assert_eq!(quiet.count(0.0999), TileCount { done: 0, all: 15 });
    // one pixel of the first tile makes four tiles wait
    film.variance[3 * (38 + 1) + 1] = 64.0;
    let errors = TileErrors::from_film(&film);
    let expected = ((191.0 * 0.01 + 1.0) / 192.0f64).sqrt();
    assert!((errors.errors[0] - expected).abs() < 1e-6, "{}, expected {expected}", errors.errors[0]);
    let open = errors.unconverged(0.11);
    assert_eq!((0..15).filter(|&t| open[t]).collect::<Vec<_>>(), [0, 1, 5, 6]);
    // in the middle it would be nine
    film.variance[3 * (38 * 12 + 20)] = 64.0;
    assert_eq!(TileErrors::from_film(&film).count(0.11).done, 15 - 11);
    // pixels with fewer than two samples have not converged
    film.variance.fill(0.0);
    film.samples[0] = 1;
    assert_eq!(TileErrors::from_film(&film).count(1e9).done, 11);
    film.samples[0] = 2;
    assert_eq!(TileErrors::from_film(&film).count(0.0).done, 15);
    film.variance[0] = f32::NAN;
    assert_eq!(TileErrors::from_film(&film).count(f64::INFINITY).done, 11);
}
