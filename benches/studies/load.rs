//! Loads scene files, and says what is in them and how long it took: `cargo run --release --example load -- FILE...`

use std::time::Instant;

fn main() {
    for file in std::env::args().skip(1) {
        let start = Instant::now();
        match skylit::scene::load::load(&file) {
            Ok(s) => {
                let seconds = start.elapsed().as_secs_f64();
                println!(
                    "{file}: {seconds:.3} s, {} triangles, {} spheres, {} meshes, {} instances, {} materials, {} textures, \
                     {} cameras, {} lights, {} degenerate, {} flat, {} tangents",
                    s.triangle_count(),
                    s.sphere_count(),
                    s.meshes.len(),
                    s.instances.len(),
                    s.materials.len(),
                    s.textures.len(),
                    s.cameras.len(),
                    s.lights.len(),
                    s.report.degenerate_triangles,
                    s.report.normals_computed,
                    s.report.tangents_computed
                );
                println!("    {:?} {:?} {:?}", s.bounds(), s.hints, s.cameras.first());
                for w in &s.report.warnings {
                    println!("    {w}");
                }
            }
            Err(e) => println!("error (exit {}): {e}", e.exit_code()),
        }
    }
}
