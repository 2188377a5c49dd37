// What the passes of a frame with a budget share; src/render/realtime/budget.rs has the same numbers.
#ifndef COMMON_BUDGET
#define COMMON_BUDGET

layout(buffer_reference, std430, buffer_reference_align = 4) buffer BudgetSums { uint v[]; };
layout(buffer_reference, std430, buffer_reference_align = 4) buffer FrameWords { uint v[]; };

// Wishes at 64 levels, twice; sum of deviations; number of pixels; number of rays that are listed.
const uint SUMS_COARSE = 0u;
const uint SUMS_FINE = 64u;
const uint SUMS_DEVIATION = 128u;
const uint SUMS_PIXELS = 129u;
const uint SUMS_LISTED = 130u;
// Of a ray, and of a deviation.
const float SUM_UNITS = 16.0;
const float DEVIATION_UNITS = 256.0;
// Samples of a history that half floats and sixteenths can count.
const float MAX_CAP = 4000.0;

#endif
