// What a probe writes.
#ifndef PROBE
#define PROBE

layout(buffer_reference, std430, buffer_reference_align = 16) writeonly buffer ProbeOutputs { uvec4 v[]; };

#endif
