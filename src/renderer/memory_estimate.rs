//! Memory that a render of a scene takes, before anything of it is built.

use crate::scene::{Environment, Geometry, Scene, Texture};

/// Bytes that a render takes besides what grows with the scene: the program, a CPU driver with its
/// compiled kernels, and the buffers of an image of 1280x720 pixels.
const PROGRAM: u64 = 156_000_000;
/// Triangles of a leaf of the compute tracer's BVH, on average: most are pairs.
const TRIANGLES_PER_LEAF: u64 = 2;
/// Bytes of a block of the BVH: a leaf, or a node.
const BLOCK: u64 = 64;
/// Leaves for each node above them.
const LEAVES_PER_NODE: u64 = 4;
/// Bytes of a node of the binary tree that becomes the BVH, which has two a leaf.
const BINARY_NODE: u64 = 32;
/// Bytes of a leaf while the BVH is built: the numbers of its triangles, and its place.
const LEAF_WORK: u64 = 12;
/// Bytes of an instance: its records on the host and on the device, and its leaf.
const INSTANCE: u64 = 700;

/// Bytes that a render takes at most at a time, by what they are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct MemoryEstimate {
    /// The program, the driver, and the buffers of an image of 1280x720 pixels.
    pub program: u64,
    /// The scene on the host: vertices, indices, decoded textures.
    pub scene: u64,
    /// Bytes of building the BVH at its peak, on the host.
    pub build: u64,
    /// The scene and its BVH in device memory, which is the host's with a CPU driver.
    pub device: u64,
}

impl MemoryEstimate {
    /// Estimates the memory of `skylit render SCENE` with the compute tracer, from counts alone.
    ///
    /// Each term is an array that lives at the peak, so that sizes of its elements are those of the
    /// code:
    ///
    /// - `scene`: the vectors of [`crate::scene::TriangleMesh`] and the texels, counted;
    /// - `build`: `tracer::wide` has a copy of positions and indices (12 bytes a vertex and a
    ///   triangle), `accel::pairs` the pairs, and `accel::wide` the binary tree (two nodes of 32
    ///   bytes a leaf) and the blocks (64 bytes, a leaf or a node) twice, as pieces and joined;
    /// - `device`: `tracer::gpu_scene` has positions and indices, and `tracer::wide` the blocks,
    ///   which are on the host until they are uploaded.
    ///
    /// Constants that counts do not give, the leaves' triangles and the program's own memory, are
    /// measured: docs/notebook/2026-11-30-loading.md has the scenes.
    pub fn from_scene(scene: &Scene) -> Self {
        let mut own = 0;
        let (mut geometry, mut leaves) = (0, scene.instances.len() as u64);
        for mesh in &scene.meshes {
            match &mesh.geometry {
                Geometry::Triangles(t) => {
                    let bytes = 12 * (t.positions.len() + t.indices.len()) as u64;
                    let sets = t.texcoords.iter().chain(&t.more_texcoords).map(Vec::len).sum::<usize>();
                    let tangents = t.tangents.len() + t.clearcoat_tangents.len() + t.anisotropy_tangents.len();
                    own += bytes + (12 * t.normals.len() + 8 * sets + 16 * (tangents + t.colors.len())) as u64;
                    geometry += bytes;
                    leaves += (t.indices.len() as u64).div_ceil(TRIANGLES_PER_LEAF);
                }
                Geometry::Spheres(spheres) => {
                    let bytes = size_of_val(&spheres[..]) as u64;
                    own += bytes;
                    geometry += bytes;
                    leaves += spheres.len() as u64;
                }
            }
        }
        own += texel_bytes(&scene.textures) + INSTANCE * scene.instances.len() as u64;
        if let Environment::Map(map) = &scene.environment {
            own += 12 * u64::from(map.width) * u64::from(map.height);
        }
        let blocks = BLOCK * (leaves + leaves / LEAVES_PER_NODE);
        Self {
            program: PROGRAM,
            scene: own,
            build: geometry + (LEAF_WORK + 2 * BINARY_NODE) * leaves + 2 * blocks,
            device: geometry + blocks,
        }
    }

    /// Bytes at the peak with a CPU driver: building, or the upload of what was built.
    pub fn peak(&self) -> u64 {
        // the blocks are there twice while they are uploaded
        self.program + self.scene + self.build.max(2 * self.device)
    }
}

/// Bytes of all images that textures show, each counted once.
fn texel_bytes(textures: &[Texture]) -> u64 {
    let is_first = |k: &usize| !textures[..*k].iter().any(|t| t.texels.is_shared_with(&textures[*k].texels));
    (0..textures.len()).filter(is_first).map(|k| textures[k].texels.as_bytes().len() as u64).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;

    #[test]
    fn memory_grows_with_the_scene() {
        let of = |name: &str| MemoryEstimate::from_scene(&builtin::by_name(name).unwrap());
        let [small, large] = [of("terrain:10000"), of("terrain:100000")];
        // half as many vertices as triangles, of 12 bytes each, and a few at the border
        assert!((178_000..190_000).contains(&small.scene), "{small:?}");
        let ratio = |a: u64, b: u64| b as f64 / a as f64;
        for grown in [ratio(small.scene, large.scene), ratio(small.build, large.build)] {
            assert!((9.8..10.2).contains(&grown), "{small:?} {large:?}");
        }
        assert!(large.peak() > PROGRAM + large.scene + large.build - 1);
        // an instance has no copy of its triangles
        let [few, many] = [of("instances:250000"), of("instances:2500000")];
        assert!(many.scene < 12 * few.scene && many.scene < 2_500_000 * 10, "{few:?} {many:?}");
    }
}
