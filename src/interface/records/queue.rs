//! Queues of rays in device memory.

records! {
    "queue";

    /// A queue of rays: part of the parameters of the passes that fill it and read its tags.
    QueueRecord: structure {
        /// `Ray`s, 32 bytes each.
        rays: address,
        /// A `uint` a ray, for the callback of the stream that traces the queue.
        tags: address,
        /// A `uint`: how many rays there are. The host clears it and sees to it that the queue is large enough.
        count: address,
    }
}
