//! The WGSL compute shaders of `tumble`, one folder a stage, and the few lines that put them together.
//!
//! A shader imports what it shares with others by a comment line of its own, `//#import shared/aabb.wgsl`; each file
//! is taken once, wherever it is first asked for. [`compose`] resolves the imports and remembers where every line
//! came from, so that an error in the composed text is told as file and line.

use std::fmt;

/// Every shader of this crate: its stem (path below `shaders/` without `.wgsl`) and its text.
pub const SOURCES: &[(&str, &str)] = &[
    ("batch", include_str!("../batch.wgsl")),
    ("bounds", include_str!("../bounds.wgsl")),
    ("broadphase/brute_force", include_str!("../broadphase/brute_force.wgsl")),
    ("broadphase/grid", include_str!("../broadphase/grid.wgsl")),
    ("broadphase/lbvh/build", include_str!("../broadphase/lbvh/build.wgsl")),
    ("broadphase/lbvh/walk", include_str!("../broadphase/lbvh/walk.wgsl")),
    ("broadphase/pairs", include_str!("../broadphase/pairs.wgsl")),
    ("broadphase/sweep", include_str!("../broadphase/sweep.wgsl")),
    ("contact", include_str!("../contact.wgsl")),
    ("continuous", include_str!("../continuous.wgsl")),
    ("edit", include_str!("../edit.wgsl")),
    ("island", include_str!("../island.wgsl")),
    ("joint/batches", include_str!("../joint/batches.wgsl")),
    ("joint/drive", include_str!("../joint/drive.wgsl")),
    ("joint/frame", include_str!("../joint/frame.wgsl")),
    ("joint/held", include_str!("../joint/held.wgsl")),
    ("joint/inertia", include_str!("../joint/inertia.wgsl")),
    ("joint/island", include_str!("../joint/island.wgsl")),
    ("joint/rows", include_str!("../joint/rows.wgsl")),
    ("level", include_str!("../level.wgsl")),
    ("motion", include_str!("../motion.wgsl")),
    ("narrowphase/ball_ball", include_str!("../narrowphase/ball_ball.wgsl")),
    ("narrowphase/ball_cuboid", include_str!("../narrowphase/ball_cuboid.wgsl")),
    ("narrowphase/ball_halfspace", include_str!("../narrowphase/ball_halfspace.wgsl")),
    ("narrowphase/cuboid_cuboid", include_str!("../narrowphase/cuboid_cuboid.wgsl")),
    ("narrowphase/cuboid_halfspace", include_str!("../narrowphase/cuboid_halfspace.wgsl")),
    ("primitives/args", include_str!("../primitives/args.wgsl")),
    ("primitives/compact", include_str!("../primitives/compact.wgsl")),
    ("primitives/scan", include_str!("../primitives/scan.wgsl")),
    ("primitives/sort", include_str!("../primitives/sort.wgsl")),
    ("primitives/sort_subgroup", include_str!("../primitives/sort_subgroup.wgsl")),
    ("query/bounds", include_str!("../query/bounds.wgsl")),
    ("query/closest", include_str!("../query/closest.wgsl")),
    ("query/overlap", include_str!("../query/overlap.wgsl")),
    ("shared/aabb", include_str!("../shared/aabb.wgsl")),
    ("shared/body", include_str!("../shared/body.wgsl")),
    ("shared/cast", include_str!("../shared/cast.wgsl")),
    ("shared/clip", include_str!("../shared/clip.wgsl")),
    ("shared/collider", include_str!("../shared/collider.wgsl")),
    ("shared/constraint", include_str!("../shared/constraint.wgsl")),
    ("shared/control", include_str!("../shared/control.wgsl")),
    ("shared/couple", include_str!("../shared/couple.wgsl")),
    ("shared/edit", include_str!("../shared/edit.wgsl")),
    ("shared/graph", include_str!("../shared/graph.wgsl")),
    ("shared/joint", include_str!("../shared/joint.wgsl")),
    ("shared/level", include_str!("../shared/level.wgsl")),
    ("shared/limits", include_str!("../shared/limits.wgsl")),
    ("shared/manifold", include_str!("../shared/manifold.wgsl")),
    ("shared/math", include_str!("../shared/math.wgsl")),
    ("shared/narrowphase", include_str!("../shared/narrowphase.wgsl")),
    ("shared/pair", include_str!("../shared/pair.wgsl")),
    ("shared/pairs", include_str!("../shared/pairs.wgsl")),
    ("shared/project", include_str!("../shared/project.wgsl")),
    ("shared/query", include_str!("../shared/query.wgsl")),
    ("shared/recycle", include_str!("../shared/recycle.wgsl")),
    ("shared/sort", include_str!("../shared/sort.wgsl")),
    ("shared/step", include_str!("../shared/step.wgsl")),
    ("shared/thread", include_str!("../shared/thread.wgsl")),
    ("shared/tree", include_str!("../shared/tree.wgsl")),
    ("shared/workgroup", include_str!("../shared/workgroup.wgsl")),
    ("sleep", include_str!("../sleep.wgsl")),
    ("solver/classic", include_str!("../solver/classic.wgsl")),
    ("solver/gauss_seidel", include_str!("../solver/gauss_seidel.wgsl")),
    ("solver/iterate", include_str!("../solver/iterate.wgsl")),
    ("solver/jacobi", include_str!("../solver/jacobi.wgsl")),
    ("solver/one_pass", include_str!("../solver/one_pass.wgsl")),
    ("solver/parts", include_str!("../solver/parts.wgsl")),
    ("solver/passes", include_str!("../solver/passes.wgsl")),
    ("solver/penalty", include_str!("../solver/penalty.wgsl")),
    ("solver/prepare", include_str!("../solver/prepare.wgsl")),
    ("solver/push", include_str!("../solver/push.wgsl")),
    ("solver/resist", include_str!("../solver/resist.wgsl")),
    ("solver/soft", include_str!("../solver/soft.wgsl")),
    ("solver/split", include_str!("../solver/split.wgsl")),
    ("solver/store", include_str!("../solver/store.wgsl")),
    ("solver/sweep", include_str!("../solver/sweep.wgsl")),
    ("solver/visit", include_str!("../solver/visit.wgsl")),
];

const IMPORT: &str = "//#import ";

/// A shader with its imports in place.
#[derive(Debug, Clone)]
pub struct Composed {
    /// The stem that was asked for.
    pub stem: String,
    /// The whole text, valid WGSL.
    pub source: String,
    origin: Vec<(&'static str, u32)>,
}

impl Composed {
    /// Where a line of `source` (from 1) came from: the stem of the file, and the line there (from 1). A line past
    /// the end gives the last one.
    pub fn locate(&self, line: u32) -> (&'static str, u32) {
        let index = (line.max(1) as usize - 1).min(self.origin.len().saturating_sub(1));
        self.origin.get(index).copied().unwrap_or(("", line))
    }
}

/// Why a shader could not be composed.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum ComposeError {
    /// No shader has this stem.
    UnknownShader {
        /// The stem that was asked for.
        stem: String,
    },
    /// A file imports one that is not there.
    UnknownImport {
        /// Stem of the file that imports.
        stem: String,
        /// The line there, from 1.
        line: u32,
        /// What follows `//#import`.
        import: String,
    },
}

impl fmt::Display for ComposeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownShader { stem } => write!(f, "no shader is called `{stem}`"),
            Self::UnknownImport { stem, line, import } => {
                write!(f, "shaders/{stem}.wgsl:{line}: imports `{import}`, and there is no such file")
            }
        }
    }
}

impl std::error::Error for ComposeError {}

/// Composes the shader of this stem out of [`SOURCES`].
///
/// # Errors
/// [`ComposeError`] when the stem, or a file that it imports, is not in the table.
pub fn compose(stem: &str) -> Result<Composed, ComposeError> {
    compose_from(SOURCES, stem)
}

/// Like [`compose`], out of another table of (stem, text).
///
/// # Errors
/// As for [`compose`].
pub fn compose_from(sources: &[(&'static str, &'static str)], stem: &str) -> Result<Composed, ComposeError> {
    let mut composed = Composed { stem: stem.to_owned(), source: String::new(), origin: Vec::new() };
    let file = find(sources, stem).ok_or_else(|| ComposeError::UnknownShader { stem: stem.to_owned() })?;
    append(sources, file, &mut vec![file.0], &mut composed)?;
    Ok(composed)
}

fn find(sources: &[(&'static str, &'static str)], stem: &str) -> Option<(&'static str, &'static str)> {
    sources.iter().copied().find(|(name, _)| *name == stem)
}

/// Appends a file line by line; an import line gives way to the file that it names, unless that was `taken` before.
fn append(
    sources: &[(&'static str, &'static str)],
    (stem, text): (&'static str, &'static str),
    taken: &mut Vec<&'static str>,
    composed: &mut Composed,
) -> Result<(), ComposeError> {
    for (number, line) in (1..).zip(text.lines()) {
        if let Some(import) = line.strip_prefix(IMPORT).map(str::trim) {
            let unknown = || ComposeError::UnknownImport { stem: stem.into(), line: number, import: import.into() };
            let name = import.strip_suffix(".wgsl").ok_or_else(unknown)?;
            let file = find(sources, name).ok_or_else(unknown)?;
            if !taken.contains(&file.0) {
                taken.push(file.0);
                append(sources, file, taken, composed)?;
            }
        } else {
            composed.source.push_str(line);
            composed.source.push('\n');
            composed.origin.push((stem, number));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn stems(folder: &Path, root: &Path, found: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                stems(&path, root, found);
            } else if path.extension().is_some_and(|extension| extension == "wgsl") {
                let stem = path.with_extension("");
                found.push(stem.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/"));
            }
        }
    }

    #[test]
    fn every_file_is_in_the_table_in_order() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut found = Vec::new();
        stems(root, root, &mut found);
        found.sort();
        let table: Vec<&str> = SOURCES.iter().map(|(stem, _)| *stem).collect();
        assert_eq!(table, found);
    }

    #[test]
    fn imports_are_taken_once_and_lines_are_traced() {
        let sources =
            [("a", "//#import b.wgsl\n//#import c.wgsl\na2\n"), ("b", "b1\n//#import c.wgsl\n"), ("c", "c1\nc2\n")];
        let composed = compose_from(&sources, "a").unwrap();
        assert_eq!(composed.source, "b1\nc1\nc2\na2\n");
        assert_eq!([1, 2, 3, 4].map(|line| composed.locate(line)), [("b", 1), ("c", 1), ("c", 2), ("a", 3)]);
        assert_eq!(composed.locate(99), ("a", 3));
    }

    #[test]
    fn a_missing_import_is_told_with_its_place() {
        let sources = [("a", "\n//#import nowhere.wgsl\n")];
        let error = compose_from(&sources, "a").unwrap_err();
        assert_eq!(error.to_string(), "shaders/a.wgsl:2: imports `nowhere.wgsl`, and there is no such file");
        assert!(matches!(compose("nothing"), Err(ComposeError::UnknownShader { .. })));
    }
}
