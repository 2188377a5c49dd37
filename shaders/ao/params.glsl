// Parameters of the passes of ambient occlusion stills.
#ifndef AO_PARAMS
#define AO_PARAMS
#include "common/camera.glsl"
#include "interface/ao.glsl"

AoParams ao_params() { return AoParams(behind_block(0u)); }

#endif
