// What the materials of the scene need: a specialisation constant, so that the code of what is absent is compiled away. Mirrors
// src/tracer/shading.rs.
#ifndef BSDF_FEATURES
#define BSDF_FEATURES

layout(constant_id = 9) const uint SHADING = 0xffffffffu;

const uint HAS_DIFFUSE = 1u;
const uint HAS_GLTF = 2u;
const uint HAS_CONDUCTOR = 4u;
const uint HAS_GLASS = 8u;
const uint HAS_MIRROR = 16u;
const uint HAS_UNLIT = 32u;
const uint HAS_COAT = 64u;
const uint HAS_SHEEN = 128u;
const uint HAS_THIN_WALLS = 256u;      // transmission through surfaces without thickness
const uint HAS_VOLUMES = 512u;         // and into bodies
const uint HAS_ABSORPTION = 1024u;     // in them
const uint HAS_ANISOTROPY = 2048u;
const uint HAS_BASE_COLORS = 8192u;    // that vary over a surface, by texture or by vertex
const uint HAS_EMISSION = 16384u;
const uint HAS_COMPENSATION = 32768u;  // of energy that microfacets lose
const uint HAS_BENT_NORMALS = 65536u;  // shading normals that are not those of the surface
// 131072: every surface is white, and nothing but HAS_DIFFUSE is set; shaders do not ask
const uint HAS_RAY_CONES = 262144u;    // textures have levels, if any path asks for them
const uint FIRST_USE = 19u;            // this and the twelve bits above: textures for each USE_* of path/shading.glsl

bool has(uint what) { return (SHADING & what) != 0u; }

bool has_use(uint use) { return has(1u << (FIRST_USE + use)); }

#endif
