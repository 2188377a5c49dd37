// Bundles of neighbouring pixels, whose camera rays start traversal at the same entry points (entry_points.glsl).
#ifndef COMMON_ENTRY_POINTS
#define COMMON_ENTRY_POINTS
#include "ao/params.glsl"

uint bundle_of(uint ray_index) { return pixel_index(ray_index) >> BUNDLE_BITS; }

// Lists are counted from that of the launch's first ray.
uint first_bundle() { return bundle_of(push.first); }
uint last_bundle() { return bundle_of(push.first + push.count - 1u); }

#endif
