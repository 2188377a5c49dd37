// Whole numbers without what drivers for CPUs do one lane at a time: conversions of floats (lavapipe keeps them in range by scalar comparisons), quotients and remainders.
#ifndef COMMON_INTEGERS
#define COMMON_INTEGERS

// int(x) of a whole number from -2^22 to 2^22; 0 for numbers beyond and NaN. The sum of x and 1.5 * 2^23 has x in the lowest bits of its mantissa.
int to_int(float x) {
    precise float sum = x + 12582912.0;
    return abs(x) <= 4194304.0 ? floatBitsToInt(sum) - 0x4b400000 : 0;
}
ivec2 to_int(vec2 x) { return ivec2(to_int(x.x), to_int(x.y)); }

// Remainder (x) and quotient (y) of `a` by `b`, where `a` is less than 2^31 and the quotient less than 2^21. Of an index and a width they are column and row.
uvec2 divide(uint a, uint b) {
    // one too many or too few at most
    int quotient = to_int(floor(float(int(a)) / float(int(b))));
    int remainder = int(a) - quotient * int(b);
    int off = remainder < 0 ? -1 : remainder >= int(b) ? 1 : 0;
    return uvec2(remainder - off * int(b), quotient + off);
}

#endif
