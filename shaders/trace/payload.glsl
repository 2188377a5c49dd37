// Ray payload of the pipeline tracer: the tracer's own ids, which are converted to scene ids after the trace.
#ifndef TRACE_PAYLOAD
#define TRACE_PAYLOAD

struct Payload {
    float t;  // INFINITY for a miss
    uint instance;
    uint primitive;  // in the group
    float u;
    float v;
};

#endif
