// Records that the passes of a frame with a budget share.
#ifndef COMMON_BUDGET
#define COMMON_BUDGET
#include "interface/budget_stage.glsl"
#include "interface/frame.glsl"

layout(buffer_reference, std430, buffer_reference_align = 4) buffer BudgetSums { uint v[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) buffer FrameWords { uint v[]; };

// Fixed-point scales of a number of rays and of a standard deviation.
const float SUM_UNITS = 16.0;
const float DEVIATION_UNITS = 256.0;
// Maximum number of samples of a history that half floats and sixteenths can represent.
const float MAX_CAP = 4000.0;

#endif
