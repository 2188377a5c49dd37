// Volumes within volumes: which of them a path is in, and which two meet at a surface (Schmidt and Budge, "Simple Nested Dielectrics in Ray Traced
// Images", JGT 2002). A path keeps the volumes whose surfaces it has entered and not left. Of those it is in the one of highest priority, and among
// equal ones in the one that it entered last. A surface at which the active volume does not change is ignored.
#ifndef PATH_MEDIA
#define PATH_MEDIA
#include "path/shading.glsl"
#include "path/wavelength.glsl"

// Materials of volumes, the last entered first; NO_MEDIUM at the end. Beyond four, the first that was entered is forgotten.
#define MediaStack uvec4

bool is_medium(uint material) {
    return HAS_VOLUMES && SHADING_OF(material).walls == WALLS_VOLUME || HAS_DIELECTRIC && SHADING_OF(material).model == BSDF_DIELECTRIC;
}

// The volume that a path with this stack is in.
uint current_medium(MediaStack stack) {
    uint found = NO_MEDIUM;
    int highest_ = 0;
    [[unroll]] for (uint k = 0u; k < 4u; k++) {
        if (stack[k] == NO_MEDIUM) break;
        int priority = SHADING_OF(stack[k]).priority;
        if (found == NO_MEDIUM || priority > highest_) {
            found = stack[k];
            highest_ = priority;
        }
    }
    return found;
}

MediaStack entered(MediaStack stack, uint m) { return MediaStack(m, stack.xyz); }

// The stack without a volume; unchanged if it does not contain the volume.
MediaStack left(MediaStack stack, uint m) {
    if (stack.x == m) return MediaStack(stack.yzw, NO_MEDIUM);
    if (stack.y == m) return MediaStack(stack.xzw, NO_MEDIUM);
    if (stack.z == m) return MediaStack(stack.xyw, NO_MEDIUM);
    return stack.w == m ? MediaStack(stack.xyz, NO_MEDIUM) : stack;
}

// Index of refraction at a wavelength; 1 outside of all volumes.
float medium_ior(uint m, float wavelength) {
    if (m == NO_MEDIUM) return 1.0;
    return HAS_DISPERSION ? index_at(m, wavelength) : SHADING_OF(m).ior;
}

// Index of refraction of one medium over that of another.
float relative_ior(uint beyond, uint here, float wavelength) { return medium_ior(beyond, wavelength) / medium_ior(here, wavelength); }

bool disperses(uint m) { return m != NO_MEDIUM && SHADING_OF(m).dispersion > 0.0; }

// The medium beyond a surface of a volume.
struct Boundary {
    bool is_there;
    uint medium;       // beyond
    uint before;       // the medium before it: where a path leaves without having entered, that of the surface
    MediaStack stack;  // beyond
};

Boundary boundary_at(uint material, bool front, uint here, MediaStack stack) {
    Boundary b;
    b.stack = front ? entered(stack, material) : left(stack, material);
    if (!front && b.stack == stack) {
        // a path that leaves without having entered: the mesh is not closed, or the path began inside
        b.is_there = true;
        b.medium = here;
        b.before = material;
        return b;
    }
    b.medium = current_medium(b.stack);
    b.is_there = b.medium != here;
    b.before = here;
    return b;
}

// How the boundary disperses a path whose wavelength has a place among all; is_single: it has no other already.
Dispersion dispersion_at(Boundary b, float place, bool is_single) {
    if (!disperses(b.medium) && !disperses(b.before)) return NO_DISPERSION;
    vec2 etas = vec2(relative_ior(b.medium, b.before, WAVELENGTHS.x), relative_ior(b.medium, b.before, WAVELENGTHS.y));
    return Dispersion(true, is_single ? vec3(1.0) : color_of_wavelength(place), etas);
}

#endif
