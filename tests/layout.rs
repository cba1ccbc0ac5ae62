//! The structs and constants of `shaders/shared` against those of `tumble_core::layout`: names, types, offsets, sizes
//! and values. Oracle: the Rust compiler and naga.

use std::any::type_name_of_val;
use std::collections::{BTreeMap, BTreeSet};

use bytemuck::Zeroable;
use naga::{Expression, Handle, Literal, Module, ScalarKind, Type, TypeInner};
use tumble_core::layout::*;
use tumble_core::limits;

/// The files of `shaders/shared` that hold what the host holds too; the others are helpers of shaders.
const LAYOUTS: &[&str] = &[
    "shared/body",
    "shared/collider",
    "shared/constraint",
    "shared/control",
    "shared/edit",
    "shared/joint",
    "shared/level",
    "shared/manifold",
    "shared/pair",
    "shared/query",
    "shared/step",
    "shared/tree",
];

/// Fields whose Rust name WGSL keeps for itself: (struct, Rust, WGSL).
const RENAMED: &[(&str, &str, &str)] = &[("Aabb", "class", "size_class"), ("EditRecord", "target", "target_slot")];

#[derive(Debug, Clone, PartialEq)]
struct Field {
    name: String,
    offset: usize,
    bytes: usize,
    /// `f32`, `u32` or a struct's name, whatever arrays and vectors are around it.
    leaf: String,
}

#[derive(Debug, Clone, PartialEq)]
struct Layout {
    bytes: usize,
    fields: Vec<Field>,
}

/// The layout of a Rust struct; does not compile unless every field is named.
macro_rules! layouts {
    ($($name:ident { $($field:ident),* $(,)? })*) => {
        vec![$({
            let value = $name::zeroed();
            let $name { $($field: _),* } = value;
            let fields = vec![$({
                let (offset, bytes) = (std::mem::offset_of!($name, $field), std::mem::size_of_val(&value.$field));
                rust_field(stringify!($name), stringify!($field), offset, bytes, type_name_of_val(&value.$field))
            }),*];
            (stringify!($name), Layout { bytes: std::mem::size_of::<$name>(), fields })
        }),*]
    };
}

fn rust_field(owner: &str, field: &str, offset: usize, bytes: usize, type_name: &str) -> Field {
    let renamed = RENAMED.iter().find(|(name, rust, _)| *name == owner && *rust == field);
    let name = renamed.map_or(field, |(_, _, wgsl)| wgsl).to_owned();
    // `[tumble_core::layout::ManifoldPoint; 4]` and `[[u32; 4]; 7]` come down to their last path segment.
    let leaf = type_name.trim_matches('[').split(';').next().unwrap().rsplit("::").next().unwrap().to_owned();
    Field { name, offset, bytes, leaf }
}

fn rust_layouts() -> BTreeMap<&'static str, Layout> {
    BTreeMap::from_iter(layouts! {
        BodyState {
            position, flags, rotation, linear_velocity, generation, angular_velocity, credit, force, h, torque,
            eigenvalue
        }
        BodyProps {
            inverse_inertia, inverse_mass, inertia, gravity_scale, center_of_mass, linear_damping, frame,
            angular_damping, reach, locked, least_level
        }
        Rest { position, time, rotation, island, pad_a, pad_b, pad_c }
        SolverBody {
            linear_velocity, inverse_mass, angular_velocity, touched, translation, eigenvalue, delta,
            inverse_inertia_diagonal, level, inverse_inertia_off, parts, linear_start, weight, angular_start, weighted
        }
        PoseRecord { translation, tag, rotation }
        Collider { size, shape, position, body, rotation, friction, restitution, combine, born, surface_velocity,
            rolling_resistance, twisting_resistance, pad_a, pad_b, pad_c }
        Aabb { min, body, max, class }
        Pair { a, b, slot, kind }
        ManifoldPoint { anchor, separation }
        Manifold { normal, count, features, between, recycled, points }
        FoundManifold { rotation_a, rotation_b, manifold }
        ConstraintHead {
            normal, friction, body_a, body_b, slot, count, restitution, bias_rate, mass_scale, impulse_scale,
            remembered, round_a, round_b, rolling_resistance, between, twisting_resistance, resisted, rolling_inertia,
            surface_velocity, twisting_inertia, level
        }
        ConstraintPoint {
            anchor, adjusted_separation, normal_mass, tangent_mass, approach, deviation, total, pad_b
        }
        Impulse { normal, tangent, feature }
        ManifoldMemory { remembered, resisted, deviations, totals }
        Control {
            stop, overflow, needed, step, old_pair_count, free_count, colored_as, frozen_count, pair_count, processed,
            new_count, dead_count, constraint_count, point_count, batch_count, rounds, unplaced, last_count,
            large_count, max_degree, solved, turns, cell_class, cell_bits, center_min, inverse_cell, center_max,
            pad_a, batch_start, quarantined, pad_b, islands, islands_open, asleep, islands_asleep,
            awake, manifolds_asleep, levels_wanted, levels_used, visits, residual, bodies_over, broken_joints,
            joint_residual, pad_c, pad_d, pad_e, newly_broken
        }
        Joint {
            rotation_a, rotation_b, anchor_a, body_a, anchor_b, body_b, axes, flags, generation, frequency,
            damping_ratio, break_force, break_torque, pad_a, drives
        }
        JointDrive { low, high, target_pos, target_vel, stiffness, damping, max_force, friction }
        JointState {
            impulse, tag, torque, broken, remainder, h, angular_remainder, pad_a, separation, angle, pad_b
        }
        JointIsland {
            first_block, block_count, first_level, level_count, first_joint, joint_count, first_body, body_count
        }
        JointBlock { row, first_entry, entry_count, first_term, term_count, first_row, row_count, pad_a }
        JointEntry { row, column, first_term, term_count, shared_bodies, pad_a }
        JointBody { body, first_end, end_count, direct }
        JointTables {
            islands, blocks, levels, entries, terms, rows, joints, bodies, ends, batches, island_count, block_count,
            entry_count, joint_count, direct_joints, body_count, direct_bodies, batch_count, wide_batches, pad_a
        }
        EditRecord { op, target, kind, generation, data }
        EditRange { first, count }
        TreeNode { min, child, max, escape }
        TreeInfo { slots, members, words, capacity }
        PlacedShape { position, shape, rotation, size, pad_a }
        QueryRay { origin, max_distance, direction, solid, inverse, pad_a }
        QueryVolume { min, pad_a, max, pad_b, placed }
        QueryPoint { point, max_squared }
        QueryAnswer { vector, distance, collider, pad_a, pad_b, pad_c }
        QueryInfo { count, collider_count, capacity, pad_a }
        StepParams {
            dt, h, inverse_h, substeps, gravity, step, bias_rate, mass_scale, impulse_scale, push_speed,
            speculative_distance, restitution_threshold, body_count, collider_count, pair_capacity, cell_table_bits,
            large_limit, edit_ranges, drop_pair, write_poses, batch_rounds, last_limit, wide_batches,
            static_bias_rate, static_mass_scale, static_impulse_scale, memory_gain, memory_limit,
            memory_band, blow_speed, solver, batching, sleep_distance, sleep_time, wake_all, iterations, slop,
            levels, level, tolerance, joint_scale, pad_a
        }
    })
}

/// (module or nothing, name) of a Rust constant, its name in WGSL, its value.
macro_rules! constants {
    ($($module:ident as $prefix:literal { $($name:ident),* $(,)? })* ; $($plain:ident),*) => {
        vec![
            $($((concat!(stringify!($module), "::", stringify!($name)), concat!($prefix, stringify!($name)),
                $module::$name)),*,)*
            $((stringify!($plain), stringify!($plain), $plain as u32)),*
        ]
    };
}

fn rust_constants() -> Vec<(&'static str, &'static str, u32)> {
    constants! {
        body_flags as "BODY_" { NONE, FIXED, KINEMATIC, DYNAMIC, KIND, FROZEN, ASLEEP, STAYS_AWAKE, POSED }
        locks as "LOCKED_" { TRANSLATIONS, ROTATIONS, FIRST_ROTATION }
        touched as "TOUCHED_" { CONTACT, JOINED, ANY, FIRST_LOCK }
        joint_bits as "JOINT_" {
            LOCKED, DRIVEN, LIMITED, MOTOR, ALIVE, COUPLED, IN_CYCLE, SOFT, APART, HELD, TWICE, OVERLOCKED,
            FORCE_BASED
        }
        solver as "SOLVER_" { ONE_PASS, SOFT, GAUSS_SEIDEL, JACOBI, PENALTY }
        shape_kind as "SHAPE_" { NONE, BALL, CUBOID, HALFSPACE }
        aabb_body as "AABB_" { INDEX, FIXED, DYNAMIC, LIVE, ASLEEP }
        pair_kind as "PAIR_" {
            NONE, BALL_BALL, BALL_CUBOID, CUBOID_CUBOID, BALL_HALFSPACE, CUBOID_HALFSPACE, COUNT, MASK, FRESH, ASLEEP
        }
        overflow as "OVERFLOW_" { NONE, PAIRS, TURNS, LAST_BATCH, UNBOUNDED, SWEEP }
        edit_op as "EDIT_" {
            SPAWN, PROPS, REMOVE, POSE, VELOCITY, IMPULSE, IMPULSE_AT, FORCE, FORCE_AT, FREEZE, WAKE, NEXT_POSE,
            COLLIDER, COLLIDER_REMOVE
        }
        query_word as "QUERY_" { UNBOUNDED, TURNS, TOTAL, COUNT }
        tree_members as "MEMBERS_" { MOVING, FIXED, LARGE, ALL }
        batching as "BATCHING_" { WRITE_AND_VERIFY, LOWEST_FREE, PERSISTENT, LAW, STATIC_LAST, SPLIT_LAST }
        ;
        BATCHES, LAST_BATCH, UNBATCHED, QUARANTINE_NAMES, BREAK_NAMES, NO_SLOT, NO_NODE, NO_COLLIDER,
        NO_BODY, LEVELS, LEVEL_HOLD, LEVEL_CALM, MOST_CREDIT
    }
}

fn modules() -> Vec<(&'static str, Module)> {
    let parse = |stem| {
        let composed = tumble_shaders::compose(stem).unwrap();
        (stem, naga::front::wgsl::parse_str(&composed.source).unwrap_or_else(|error| panic!("{stem}: {error}")))
    };
    LAYOUTS.iter().copied().map(parse).collect()
}

fn leaf(module: &Module, ty: Handle<Type>) -> String {
    let scalar = |scalar: naga::Scalar| match scalar.kind {
        ScalarKind::Float => format!("f{}", 8 * scalar.width),
        ScalarKind::Uint => format!("u{}", 8 * scalar.width),
        kind => format!("{kind:?}"),
    };
    match &module.types[ty].inner {
        TypeInner::Scalar(inner) => scalar(*inner),
        TypeInner::Vector { scalar: inner, .. } => scalar(*inner),
        TypeInner::Array { base, .. } => leaf(module, *base),
        TypeInner::Struct { .. } => module.types[ty].name.clone().unwrap(),
        other => format!("{other:?}"),
    }
}

fn wgsl_layouts(module: &Module) -> Vec<(String, Layout)> {
    let mut layouts = Vec::new();
    for (_, ty) in module.types.iter() {
        let TypeInner::Struct { members, span } = &ty.inner else { continue };
        let field = |member: &naga::StructMember| Field {
            name: member.name.clone().unwrap(),
            offset: member.offset as usize,
            bytes: module.types[member.ty].inner.size(module.to_ctx()) as usize,
            leaf: leaf(module, member.ty),
        };
        let layout = Layout { bytes: *span as usize, fields: members.iter().map(field).collect() };
        layouts.push((ty.name.clone().unwrap(), layout));
    }
    layouts
}

fn wgsl_constants(module: &Module) -> Vec<(String, u32)> {
    let value = |constant: &naga::Constant| match module.global_expressions[constant.init] {
        Expression::Literal(Literal::U32(value)) => value,
        ref other => panic!("{:?} is {other:?}, not a u32", constant.name),
    };
    module.constants.iter().map(|(_, constant)| (constant.name.clone().unwrap(), value(constant))).collect()
}

#[test]
fn structs_agree() {
    let rust = rust_layouts();
    let mut seen = BTreeSet::new();
    for (stem, module) in modules() {
        for (name, layout) in wgsl_layouts(&module) {
            let expected = rust.get(name.as_str()).unwrap_or_else(|| panic!("{stem}: no struct {name} in Rust"));
            for (ours, theirs) in layout.fields.iter().zip(&expected.fields) {
                assert_eq!(ours, theirs, "{stem}: {name} (left WGSL, right Rust)");
            }
            assert_eq!(layout.fields.len(), expected.fields.len(), "{stem}: number of fields of {name}");
            assert_eq!(layout.bytes, expected.bytes, "{stem}: size of {name}");
            assert!(seen.insert(name), "{stem}: a struct that another file has too");
        }
    }
    assert_eq!(seen.iter().map(String::as_str).collect::<Vec<_>>(), rust.keys().copied().collect::<Vec<_>>());
}

#[test]
fn constants_agree() {
    let mut wgsl = BTreeMap::new();
    for (stem, module) in modules() {
        for (name, value) in wgsl_constants(&module) {
            assert!(wgsl.insert(name, (stem, value)).is_none(), "{stem}: a constant that another file has too");
        }
    }
    let mut expected: BTreeMap<String, u32> =
        rust_constants().into_iter().map(|(_, name, value)| (name.to_owned(), value)).collect();
    for field in &rust_layouts()["Control"].fields {
        if !field.name.starts_with("pad_") {
            expected.insert(format!("CONTROL_{}", field.name.to_uppercase()), field.offset as u32 / 4);
        }
    }
    for (name, (stem, value)) in &wgsl {
        assert_eq!(Some(value), expected.get(name), "{stem}: {name} (left WGSL, right Rust)");
    }
    let missing: Vec<_> = expected.keys().filter(|name| !wgsl.contains_key(*name)).collect();
    assert!(missing.is_empty(), "not in WGSL: {missing:?}");
}

/// Bounds that both sides share. Oracle: the host's.
#[test]
fn limits_agree() {
    let composed = tumble_shaders::compose("shared/limits").unwrap();
    let module = naga::front::wgsl::parse_str(&composed.source).unwrap();
    let expected = [
        ("TURN_LIMIT", limits::TURN_LIMIT),
        ("UNBOUNDED_LIMIT", limits::UNBOUNDED_LIMIT),
        ("SWEEP_CHUNK", limits::SWEEP_CHUNK),
        ("SWEEP_ITEM_LIMIT", limits::SWEEP_ITEM_LIMIT),
    ];
    assert_eq!(wgsl_constants(&module), expected.map(|(name, value)| (name.to_owned(), value)));
}

/// The two tables above are written by hand: every public struct and constant of the layout files is in them.
#[test]
fn tables_are_complete() {
    let layouts = rust_layouts();
    let constants: BTreeSet<_> = rust_constants().into_iter().map(|(name, _, _)| name).collect();
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/crates/core/src/layout");
    let mut found = 0;
    for file in std::fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        let mut module = String::new();
        for line in std::fs::read_to_string(&path).unwrap().lines() {
            let words: Vec<_> = line.split([' ', ':', '{', '(']).filter(|word| !word.is_empty()).collect();
            match words.as_slice() {
                ["pub", "mod", name, ..] => module = format!("{name}::"),
                ["}"] if !line.starts_with(' ') => module.clear(),
                ["pub", "struct", name, ..] => {
                    assert!(layouts.contains_key(name), "{path:?}: struct {name} is in no table");
                    found += 1;
                }
                ["pub", "const", name, ..] if *name != "fn" => {
                    let name = format!("{module}{name}");
                    assert!(constants.contains(name.as_str()), "{path:?}: constant {name} is in no table");
                    found += 1;
                }
                _ => {}
            }
        }
    }
    assert_eq!(found, layouts.len() + constants.len());
}
