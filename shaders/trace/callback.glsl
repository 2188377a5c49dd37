// What the tracers say to a stream, whatever it asks.
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
