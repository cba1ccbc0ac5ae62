//! Stage `query`: rays, overlaps, nearest points. Host side of `shaders/query/*.wgsl`. It is no part of a step: it runs
//! when asked, over the committed states, and a world that is never asked has none of its buffers and passes.

use crate::broadphase::lbvh::{Scratch, Tree, TreeOptions};
use crate::primitives::{Count, Scan, ScanOptions};
use crate::{Bind, BindCache, Buffers, Gpu, Pipelines, Readback, Recorder};
use bytemuck::{Pod, Zeroable};
use tumble_core::layout::{
    Aabb, Control, PlacedShape, QueryAnswer, QueryInfo, QueryPoint, QueryRay, QueryVolume, query_word, tree_members,
};
use tumble_core::query::{self, BATCH, Nearest, NearestQuery, OverlapShape, Overlaps, Ray, RayHit};
use tumble_core::{Editor, MortonBits, Result, Traversal, limits};
use wgpu::BufferUsages;

/// Bytes of `query_status`.
const STATUS_BYTES: u64 = 4 * query_word::COUNT as u64;

/// Where every collider is, a tree over them, and room for queries.
pub(crate) struct Query {
    buffers: Buffers,
    cache: BindCache,
    tree: Tree,
    scratch: Scratch,
    scan: Scan,
    /// Slots of colliders that there is room for.
    colliders: u32,
    /// The step whose state it shows.
    of_step: Option<u32>,
}

impl Query {
    /// Room for so many slots of colliders.
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, colliders: u32, bits: MortonBits) -> Result<Self> {
        let mut buffers = Buffers::new();
        let storage = BufferUsages::STORAGE;
        for (name, bytes, capacity) in [
            ("query_shapes", size_of::<PlacedShape>(), colliders),
            ("query_aabbs", size_of::<Aabb>(), colliders),
            ("query_unbounded", 4, colliders),
            ("counters", size_of::<Control>(), 1),
            ("query_status", 4, query_word::COUNT),
            ("rays", size_of::<QueryRay>(), 1),
            ("volumes", size_of::<QueryVolume>(), 1),
            ("query_points", size_of::<QueryPoint>(), 1),
            ("query_answers", size_of::<QueryAnswer>(), 1),
            ("query_met", 4, 1),
            ("query_offsets", 4, 1),
            ("query_found", 4, 1),
        ] {
            buffers.create(gpu, name, bytes as u64, capacity.into(), storage)?;
        }
        buffers.alias("aabbs", "query_aabbs");
        buffers.create(gpu, "query_info", size_of::<QueryInfo>() as u64, 1, BufferUsages::UNIFORM)?;
        let options = ScanOptions { capacity: BATCH as u32, count: Count::Host(0), total: Some(query_word::TOTAL) };
        let scan = Scan::new(gpu, pipelines, options)?;
        let options =
            TreeOptions { capacity: colliders, members: tree_members::ALL, bits, traversal: Traversal::Escape };
        let tree = Tree::new(gpu, pipelines, &options)?;
        let scratch = Scratch::new(gpu, pipelines, colliders, bits)?;
        Ok(Self { buffers, cache: BindCache::new(), tree, scratch, scan, colliders, of_step: None })
    }

    /// Whether it has room for exactly so many slots of colliders.
    pub(crate) fn fits(&self, colliders: u32) -> bool {
        self.colliders == colliders
    }

    /// Bytes of its buffers.
    pub(crate) fn bytes(&self) -> u64 {
        self.buffers.bytes() + self.tree.bytes() + self.scratch.bytes()
    }

    fn write<T: Pod>(&self, gpu: &Gpu, name: &str, offset: u64, data: &[T]) -> Result<()> {
        gpu.queue.write_buffer(self.buffers.buffer(name)?, offset, bytemuck::cast_slice(data));
        Ok(())
    }

    /// Places the colliders in `world`'s buffers, whose step this is, and builds the tree, unless that was done.
    pub(crate) fn refresh(
        &mut self,
        gpu: &Gpu,
        pipelines: &mut Pipelines,
        world: &Buffers,
        step: u32,
        collider_count: u32,
    ) -> Result<()> {
        if self.of_step == Some(step) {
            return Ok(());
        }
        self.of_step = None;
        self.write(gpu, "query_info", 0, &[QueryInfo { collider_count, ..QueryInfo::zeroed() }])?;
        self.write(gpu, "query_status", 0, &[0u32; query_word::COUNT as usize])?;
        let empty = Control { center_min: [u32::MAX; 3], ..Control::zeroed() };
        self.write(gpu, "counters", 0, &[empty])?;
        self.tree.prepare(gpu, collider_count);
        self.scratch.prepare(gpu, collider_count)?;
        let bounds = pipelines.pass(gpu, "query/bounds", "bounds")?;
        let mut recorder = Recorder::new(gpu, &self.buffers, &mut self.cache, None);
        let of_world = ["states", "colliders"].map(|name| world.buffer(name).map(|buffer| Bind::new(name, buffer)));
        let [states, colliders] = of_world;
        recorder.dispatch(&bounds, &[states?, colliders?], collider_count.div_ceil(256))?;
        self.tree.record_build(&mut recorder, &self.scratch)?;
        self.tree.record_refit(&mut recorder)?;
        recorder.submit()?;
        self.of_step = Some(step);
        Ok(())
    }

    /// Overlaps that there is room for.
    fn room(&self) -> u32 {
        self.buffers.capacity("query_found").min(u32::MAX.into()) as u32
    }

    /// Uploads queries, with room for answers of so many elements.
    fn upload<Q: Pod>(&mut self, gpu: &Gpu, name: &'static str, queries: &[Q], answers: &'static str) -> Result<()> {
        let count = queries.len() as u64;
        for buffer in [name, answers] {
            self.buffers.grow(gpu, buffer, count.next_power_of_two(), false)?;
        }
        self.write(gpu, name, 0, queries)?;
        let info = QueryInfo { count: count as u32, capacity: self.room(), ..QueryInfo::zeroed() };
        self.write(gpu, "query_info", 0, &[info])?;
        self.write(gpu, "query_status", 4 * u64::from(query_word::TURNS), &[0u32])
    }

    /// Runs what `record` records. What lies then in the first bytes of a buffer, and the words of `query_status`.
    fn run(
        &mut self,
        gpu: &Gpu,
        (answers, bytes): (&str, u64),
        record: impl FnOnce(&mut Recorder, &Parts) -> Result<()>,
    ) -> Result<(Vec<u8>, [u32; query_word::COUNT as usize])> {
        let mut recorder = Recorder::new(gpu, &self.buffers, &mut self.cache, None);
        record(&mut recorder, &Parts { buffers: &self.buffers, tree: self.tree.walk_binds(), scan: &self.scan })?;
        let mut answered = Readback::new(gpu, "query answers", bytes, 1)?;
        let mut status = Readback::new(gpu, "query status", STATUS_BYTES, 1)?;
        answered.copy(recorder.encoder(), self.buffers.buffer(answers)?, 0);
        status.copy(recorder.encoder(), self.buffers.buffer("query_status")?, 0);
        let index = recorder.submit()?;
        answered.submitted(&index);
        status.submitted(&index);
        let words = status.wait_take(gpu)?.unwrap_or_default();
        let status: [u32; query_word::COUNT as usize] =
            std::array::from_fn(|i| words.get(4 * i..4 * i + 4).map_or(0, bytemuck::pod_read_unaligned));
        query::check_bounds(status[query_word::TURNS as usize], status[query_word::UNBOUNDED as usize])?;
        Ok((answered.wait_take(gpu)?.unwrap_or_default(), status))
    }
}

/// What a batch of queries is recorded with.
struct Parts<'a> {
    buffers: &'a Buffers,
    tree: [Bind<'a>; 2],
    scan: &'a Scan,
}

/// Asks about the state that a [`Query`] shows.
pub(crate) struct Asker<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) pipelines: &'a mut Pipelines,
    pub(crate) query: &'a mut Query,
    pub(crate) editor: &'a Editor,
}

impl Asker<'_> {
    pub(crate) fn cast_rays(&mut self, rays: &[Ray]) -> Result<Vec<Option<RayHit>>> {
        let answers: Vec<QueryAnswer> =
            self.one_each(("query/closest", "ray"), "rays", &query::pack_rays(rays)?, "query_answers")?;
        Ok(answers.iter().zip(rays).map(|(answer, ray)| query::ray_hit(answer, ray, self.editor)).collect())
    }

    pub(crate) fn cast_rays_any(&mut self, rays: &[Ray]) -> Result<Vec<bool>> {
        let met: Vec<u32> =
            self.one_each(("query/closest", "ray_any"), "rays", &query::pack_rays(rays)?, "query_met")?;
        Ok(met.into_iter().map(|met| met != 0).collect())
    }

    pub(crate) fn nearest(&mut self, points: &[NearestQuery]) -> Result<Vec<Option<Nearest>>> {
        let packed = query::pack_points(points)?;
        let answers: Vec<QueryAnswer> =
            self.one_each(("query/closest", "point"), "query_points", &packed, "query_answers")?;
        Ok(answers.iter().map(|answer| query::nearest(answer, self.editor)).collect())
    }

    /// One answer a query, from one pass.
    fn one_each<Q: Pod, A: Pod>(
        &mut self,
        (stem, entry): (&str, &str),
        name: &'static str,
        queries: &[Q],
        answers: &'static str,
    ) -> Result<Vec<A>> {
        let mut all = Vec::with_capacity(queries.len());
        for some in queries.chunks(BATCH) {
            let pass = self.pipelines.pass(self.gpu, stem, entry)?;
            self.query.upload(self.gpu, name, some, answers)?;
            let read = (answers, (some.len() * size_of::<A>()) as u64);
            let groups = (some.len() as u32).div_ceil(256);
            let (bytes, _) =
                self.query.run(self.gpu, read, |recorder, parts| recorder.dispatch(&pass, &parts.tree, groups))?;
            all.extend(bytemuck::pod_collect_to_vec::<u8, A>(&bytes));
        }
        Ok(all)
    }

    pub(crate) fn overlaps(&mut self, shapes: &[OverlapShape]) -> Result<Overlaps> {
        let mut all = Overlaps::default();
        for some in query::pack_shapes(shapes)?.chunks(BATCH) {
            let (offsets, mut found) = self.find_overlaps(some)?;
            for (i, &first) in offsets.iter().enumerate() {
                let end = offsets.get(i + 1).map_or(found.len(), |&end| end as usize);
                let list = found.get_mut(first as usize..end).unwrap_or_default();
                all.push(list, self.editor);
            }
        }
        Ok(all)
    }

    /// Where each query's list begins, and all lists. They are filled as far as there is room in the same submission as
    /// they are counted, and once more when there was too little.
    fn find_overlaps(&mut self, volumes: &[QueryVolume]) -> Result<(Vec<u32>, Vec<u32>)> {
        let Self { gpu, pipelines, query, .. } = self;
        let count = pipelines.pass(gpu, "query/overlap", "count")?;
        let fill = pipelines.pass(gpu, "query/overlap", "fill")?;
        let groups = (volumes.len() as u32).div_ceil(256);
        query.upload(gpu, "volumes", volumes, "query_offsets")?;
        query.scan.set_count(gpu, volumes.len() as u32)?;
        let read = ("query_offsets", 4 * volumes.len() as u64);
        let (offsets, status) = query.run(gpu, read, |recorder, Parts { buffers, tree, scan }| {
            recorder.dispatch(&count, tree, groups)?;
            scan.record(recorder, buffers.buffer("query_offsets")?, Some(buffers.buffer("query_status")?))?;
            recorder.dispatch(&fill, tree, groups)
        })?;
        let total = u64::from(status[query_word::TOTAL as usize]);
        let had = query.buffers.capacity("query_found");
        if total > had {
            query.buffers.grow(gpu, "query_found", limits::grown(total), false)?;
            let info = QueryInfo { count: volumes.len() as u32, capacity: query.room(), ..QueryInfo::zeroed() };
            query.write(gpu, "query_info", 0, &[info])?;
        }
        let found = if total == 0 {
            Vec::new()
        } else {
            let again = |recorder: &mut Recorder, parts: &Parts| match total > had {
                true => recorder.dispatch(&fill, &parts.tree, groups),
                false => Ok(()),
            };
            query.run(gpu, ("query_found", 4 * total), again)?.0
        };
        Ok((bytemuck::pod_collect_to_vec(&offsets), bytemuck::pod_collect_to_vec(&found)))
    }
}
