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
const uint ASKS_RECTANGLES = 128u;
const uint ASKS_KINDS = 255u;           // all of these
const uint ASKS_CHOICE = 256u;          // there is more than one to choose among
const uint ASKS_MAP = 512u;             // the environment is an image
// strategies; neither: BSDF samples alone
const uint ASKS_LIGHT_SAMPLES = 1024u;  // there are lights, and they are sampled
const uint ASKS_MIS = 2048u;            // and what BSDF samples find counts, too
const uint ASKS_COSINE = 4096u;         // directions by the cosine
const uint ASKS_UNIFORM = 8192u;        // uniform hemisphere sampling
// options
const uint ASKS_GREY = 16384u;          // every surface is diffuse and grey
const uint ASKS_VIEW = 32768u;          // no light, but what camera rays see
const uint ASKS_CLAMP = 65536u;         // of fireflies
const uint ASKS_LENS = 131072u;
const uint ASKS_FILTER = 262144u;       // pixels are more than a box
const uint ASKS_CONES = 524288u;        // textures are read over cones
const uint ASKS_DISKS = 1048576u;       // directional lights have an extent: paths meet them
const uint ASKS_MEDIA = 2097152u;       // volumes absorb, or may lie in each other
const uint ASKS_CLEAR_WALLS = 4194304u; // thin walls let light through in straight lines

bool asks(uint what) { return (ASKED & what) != 0u; }

#endif
