// What a scene's lights and a render's options ask of paths: a specialisation constant, so that the code of what nobody asks for is compiled away.
// Mirrors src/render/path/asked.rs.
#ifndef PATH_ASKED
#define PATH_ASKED

layout(constant_id = 11) const uint ASKED = 0u;

// kinds of lights that are drawn: 1 << LIGHT_* of path/lights.glsl
const uint ASKS_POINTS = 1u;
const uint ASKS_SPOTS = 2u;
const uint ASKS_SUNS = 4u;              // directional
const uint ASKS_TRIANGLES = 8u;
const uint ASKS_SPHERES = 16u;
const uint ASKS_SKY = 32u;
const uint ASKS_LIGHT_TREE = 64u;
const uint ASKS_KINDS = 127u;           // all of these
const uint ASKS_CHOICE = 128u;          // there is more than one to choose among
const uint ASKS_MAP = 256u;             // the environment is an image
// strategies; neither: BSDF samples alone
const uint ASKS_LIGHT_SAMPLES = 512u;   // there are lights, and they are drawn
const uint ASKS_MIS = 1024u;            // and what BSDF samples find counts, too
const uint ASKS_COSINE = 2048u;         // directions by the cosine
const uint ASKS_UNIFORM = 4096u;        // directions evenly
// options
const uint ASKS_GREY = 8192u;           // every surface is diffuse and grey
const uint ASKS_VIEW = 16384u;          // no light, but what camera rays see
const uint ASKS_CLAMP = 32768u;         // of fireflies
const uint ASKS_LENS = 65536u;
const uint ASKS_FILTER = 131072u;       // pixels are more than a box
const uint ASKS_CONES = 262144u;        // textures are read over cones

bool asks(uint what) { return (ASKED & what) != 0u; }

#endif
