// Functions by which tracers deliver hits and occlusion to a stream.
#ifndef TRACE_CALLBACK
#define TRACE_CALLBACK

void deliver_miss(uint index) {
#ifdef STREAM_ANY
    any(index, false);
#else
    closest(index, miss());
#endif
}

#endif
