//! Stage `narrowphase`: one pass a pair kind that the plan has. Host side of `shaders/narrowphase/`.

use crate::{Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::layout::pair_kind;
use tumble_core::{Plan, Result};

/// Shader of each kind.
const STEMS: [(u32, &str); 5] = [
    (pair_kind::BALL_BALL, "narrowphase/ball_ball"),
    (pair_kind::BALL_CUBOID, "narrowphase/ball_cuboid"),
    (pair_kind::CUBOID_CUBOID, "narrowphase/cuboid_cuboid"),
    (pair_kind::BALL_HALFSPACE, "narrowphase/ball_halfspace"),
    (pair_kind::CUBOID_HALFSPACE, "narrowphase/cuboid_halfspace"),
];

pub(crate) struct Narrowphase {
    passes: Vec<Arc<Pass>>,
}

impl Narrowphase {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, plan: &Plan) -> Result<Self> {
        let stems = STEMS.iter().filter(|(kind, _)| plan.has(*kind));
        Ok(Self { passes: stems.map(|(_, stem)| pipelines.pass(gpu, stem, "collide")).collect::<Result<_>>()? })
    }

    /// `args`: buffer and offset of the arguments for one thread a pair.
    pub(crate) fn record(&self, recorder: &mut Recorder, args: (&wgpu::Buffer, u64)) -> Result<()> {
        recorder.stage("narrowphase");
        self.passes.iter().try_for_each(|pass| recorder.dispatch_indirect(pass, &[], args.0, args.1))
    }
}
