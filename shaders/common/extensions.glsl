// What every shader may use; the rest is asked for where it is used.
#ifndef COMMON_EXTENSIONS
#define COMMON_EXTENSIONS
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#endif
