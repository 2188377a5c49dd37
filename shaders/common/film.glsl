// Sums over the samples of a pixel. They are compensated (Kahan 1965): a million samples keep their digits.
#ifndef COMMON_FILM
#define COMMON_FILM

// x: sum, y: what it has too much.
vec2 kahan_add(vec2 sum, float x) {
    precise float y = x - sum.y;
    precise float t = sum.x + y;
    precise float c = t - sum.x;
    precise float compensation = c - y;
    return vec2(t, compensation);
}

#endif
