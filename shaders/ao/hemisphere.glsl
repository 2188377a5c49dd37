// The hemisphere of a surface point's occlusion rays: on the side of the viewer.
#ifndef AO_HEMISPHERE
#define AO_HEMISPHERE
#include "common/camera.glsl"
#include "scene/surface.glsl"

struct Hemisphere {
    vec3 ng;    // geometric normal, towards the viewer
    vec3 axis;  // axis of the hemisphere: ng, or the shading normal on the side of ng
};

// about_ns: its axis is the shading normal.
Hemisphere hemisphere_at(BlockParams p, Surface s, bool about_ns) {
    float facing = dot(s.ng, view_direction(p, s.position)) > 0.0 ? -1.0 : 1.0;
    vec3 ng = facing * s.ng;
    // ns is on the side of ng
    return Hemisphere(ng, about_ns ? facing * s.ns : ng);
}

#endif
