// What the rays through the pixels of an image hit. In motion paths begin where the G-buffer's rays do: what those found is not looked for again.
#ifndef PATH_KNOWN_HIT
#define PATH_KNOWN_HIT
#include "common/types.glsl"
#include "interface/radiance.glsl"

void store_known_hit(uvec2 hits, uint at, Hit hit) {
    STORE_PAIR(hits, KNOWN_HIT_PAIRS * at, uvec2(floatBitsToUint(hit.t), hit.instance));
    // the other fields of a miss are not read
    if (!is_hit(hit)) return;
    STORE_PAIR(hits, KNOWN_HIT_PAIRS * at + 1u, uvec2(hit.primitive, floatBitsToUint(hit.u)));
    STORE_PAIR(hits, KNOWN_HIT_PAIRS * at + 2u, uvec2(floatBitsToUint(hit.v), 0u));
}

Hit load_known_hit(uvec2 hits, uint at) {
    uvec2 a = LOAD_PAIR(hits, KNOWN_HIT_PAIRS * at);
    if (uintBitsToFloat(a.x) == INFINITY) return miss();
    uvec2 b = LOAD_PAIR(hits, KNOWN_HIT_PAIRS * at + 1u), c = LOAD_PAIR(hits, KNOWN_HIT_PAIRS * at + 2u);
    return Hit(uintBitsToFloat(a.x), a.y, b.x, uintBitsToFloat(b.y), uintBitsToFloat(c.x));
}

#endif
