// Morton order, the same as src/sampling/morton.rs: pixels of aligned squares of 2^k are consecutive.
#ifndef COMMON_MORTON
#define COMMON_MORTON
#include "common/integers.glsl"

uint spread_bits(uint x) {
    x &= 0xffffu;
    x = (x | x << 8) & 0x00ff00ffu;
    x = (x | x << 4) & 0x0f0f0f0fu;
    x = (x | x << 2) & 0x33333333u;
    return (x | x << 1) & 0x55555555u;
}

uint morton(uvec2 pixel) {
    return spread_bits(pixel.x) | spread_bits(pixel.y) << 1;
}

// Pixel k of a tile of 8x8.
uvec2 morton_pixel(uint k) {
    return uvec2((k & 1u) | (k >> 1 & 2u) | (k >> 2 & 4u), (k >> 1 & 1u) | (k >> 2 & 2u) | (k >> 3 & 4u));
}

// Pixel k, Morton order within the tile, of a tile of 8x8 of an image with `tiles_x` of them in a row.
uvec2 tile_pixel(uint tile, uint tiles_x, uint k) {
    return divide(tile, tiles_x) * 8u + morton_pixel(k);
}

// The inverse: the index of a pixel that counts the image in such tiles.
uint tile_index(uvec2 pixel, uint tiles_x) {
    uvec2 tile = pixel >> 3u;
    return (tile.y * tiles_x + tile.x) << 6 | morton(pixel & 7u);
}

#endif
