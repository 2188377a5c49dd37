// GLSL extensions that every shader may use; others are enabled where they are used.
#ifndef COMMON_EXTENSIONS
#define COMMON_EXTENSIONS
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#endif
