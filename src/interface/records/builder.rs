//! Memory of the builder on the device (shaders/bvh): nodes of the binary tree, and the counts by
//! which one pass tells the next how much there is to do.

records! {
    "builder" values {
        /// Invocations of a work-group.
        BUILD_LANES: uint = 128;
        /// Number of values of a digit that a pass of the sort orders by, four bits.
        SORT_DIGITS: uint = 16;
        /// Number of passes of the sort: digits of a Morton code.
        SORT_PASSES: uint = 8;
        /// Consecutive keys that an invocation sorts.
        SORT_KEYS: uint = 8;
        /// Clusters to either side among which a cluster looks for its nearest.
        SEARCH_RADIUS: uint = 16;
        /// Clusters of a work-group: the other invocations repeat the search of its neighbours.
        CLUSTER_TILE: uint = 96;
        /// Maximum number of rounds of clustering, and of inner nodes on a path of the binary tree.
        MAX_ROUNDS: uint = 112;
        /// Maximum number of levels of the wide tree: `MAX_DEPTH`.
        MAX_TREE_LEVELS: uint = 48;
        /// First bit of the height of a binary node in `BuildNode.choices`.
        HEIGHT_SHIFT: uint = 24;
        /// The step of the first round: there is one more than are recorded.
        FIRST_ROUND: uint = SORT_PASSES;
        /// The step of the first level: there is one more than are recorded.
        FIRST_LEVEL: uint = FIRST_ROUND + MAX_ROUNDS + 1;
        /// Number of steps.
        BUILD_STEPS: uint = FIRST_LEVEL + MAX_TREE_LEVELS + 1;
        /// Work-groups along x; more go along y, for which each device has 65,535.
        MAX_GROUPS_X: uint = 32768;
    };

    /// A node of the binary tree: leaves in the order of their numbers, then the inner ones, the
    /// root last.
    BuildNode: Array(buffer: "BuildNodes", access: "", align: 16) {
        /// Lower corner.
        min: vec3,
        /// Three bits for each number c of wide subtrees, 1 to 7, from the lowest: how many of them
        /// the left child takes where c are least expensive; 0: c - 1 are. For c = 1: how many of
        /// the seven children of a wide node. Above them the height: inner nodes on the longest
        /// path. Zero for a leaf.
        choices: uint,
        /// Upper corner.
        max: vec3,
        /// Number of blocks of the subtree as a wide one, its root included.
        blocks: uint,
    }

    /// The other part of an inner node of the binary tree: its children, and what it costs as at
    /// most 1 to 7 wide subtrees.
    BuildInner: Array(buffer: "BuildInners", access: "", align: 16) {
        /// Numbers of the children.
        children: uint[2],
        /// Expected area of the blocks that a ray visits, in units of the scene.
        cost: float[7],
        /// Number of blocks.
        blocks: uint[7],
    }

    /// A step of a build: a pass of the sort, a round of clustering, or a level of the wide tree.
    BuildStep: Array(buffer: "BuildSteps", access: "coherent", align: 16) {
        /// Work-groups along x, y and z.
        groups: uint[3],
        /// Clusters before a round, or wide nodes of a level.
        count: uint,
        /// Number of work-groups that have finished: the last one sums up.
        finished: uint,
        /// Padding to a multiple of 16 bytes.
        reserved: uint[3],
    }

    /// Results of passes for the next ones and for the host.
    BuildState: Block(access: "coherent", align: 16) {
        /// Lower corner of the leaves' centres, times two, in an order that compares as uints.
        low: uint[3],
        /// Upper corner of them.
        high: uint[3],
        /// Area of the root.
        root_area: float,
        /// Cost of the root as a wide tree, in the same units.
        root_cost: float,
        /// Number of blocks.
        blocks: uint,
        /// The greatest height of a cluster.
        height: uint,
        /// The greatest height that there may be, at least the binary logarithm of `count`.
        max_height: uint,
        /// Padding to a multiple of 16 bytes.
        reserved: uint,
    }

    /// Parameters of the passes of a build.
    BuildParams: Block(access: "readonly", align: 16) {
        /// The `BuildState`.
        state: address,
        /// The steps: passes of the sort, rounds from `FIRST_ROUND` on, levels from
        /// `FIRST_LEVEL` on.
        steps: address,
        /// A `BuildNode` per leaf and inner node.
        nodes: address,
        /// A `BuildInner` per inner node.
        inners: address,
        /// Two arrays in turn of a `uvec2` per leaf: keys and leaves while they are sorted, then
        /// partners and clusters, then nodes of a level.
        pairs: address[2],
        /// A `uint` per digit and tile of the sort, or two per tile of clusters.
        counts: address,
        /// A block of 64 bytes per leaf.
        leaves: address,
        /// The blocks of the wide tree.
        blocks: address,
        /// Number of leaves.
        count: uint,
        /// Half of the reciprocal of the largest coordinate: areas of boxes are neither too large
        /// nor too small for a float.
        scale: float,
    }
}
