//! The structs that both sides share with the shaders, byte for byte.
//!
//! Each lives once here and once in `shaders/shared/*.wgsl`; a test parses the WGSL and compares every name,
//! offset, size and constant. Arrays are grouped by reader: one element is one to six `vec4`.

mod body;
mod collider;
mod constraint;
mod control;
mod edit;
mod joint;
mod level;
mod manifold;
mod query;
mod step;
mod tree;

pub use body::{BodyProps, BodyState, PoseRecord, Rest, SolverBody, body_flags, locks, pose_tag, touched};
pub use collider::{Aabb, Collider, aabb_body, shape_kind};
pub use constraint::{ConstraintHead, ConstraintPoint, Impulse, ManifoldMemory, tangents};
pub use control::{BATCHES, BREAK_NAMES, Control, LAST_BATCH, QUARANTINE_NAMES, UNBATCHED, overflow};
pub use edit::{EditRange, EditRecord, edit_op};
pub use joint::{
    Joint, JointBlock, JointBody, JointDrive, JointEntry, JointIsland, JointState, JointTables, NO_BODY, joint_bits,
};
pub use level::{LEVEL_CALM, LEVEL_HOLD, LEVELS, MOST_CREDIT};
pub use manifold::{FoundManifold, Manifold, ManifoldPoint, NO_SLOT, Pair, pair_kind};
pub use query::{NO_COLLIDER, PlacedShape, QueryAnswer, QueryInfo, QueryPoint, QueryRay, QueryVolume, query_word};
pub use step::{StepParams, batching, solver};
pub use tree::{NO_NODE, TreeInfo, TreeNode, root_of, tree_members};
