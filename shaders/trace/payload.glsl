// What the shaders of the pipeline tracer hand each other: the tracer's own ids, made scene ids after the trace.
#ifndef TRACE_PAYLOAD
#define TRACE_PAYLOAD

struct Payload {
    float t;  // INFINITY: nothing met
    uint instance;
    uint primitive;  // in the group
    float u;
    float v;
};

#endif
