//! Queues of rays in device memory.

records! {
    "queue";

    /// A queue of rays: part of the parameters of the passes that fill it and read its tags.
    QueueRecord: Structure {
        /// The `Ray`s, 32 bytes each.
        rays: address,
        /// A `uint` per ray, which the callback of the stream that traces the queue receives.
        tags: address,
        /// A `uint`: number of rays in the queue, cleared by the host, at most those of a launch.
        count: address,
    }
}
