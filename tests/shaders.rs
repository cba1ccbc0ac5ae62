//! Every shader: composes, is valid, translates to every backend's language, makes pipelines within wgpu's default
//! limits, and passes Chrome's compiler. None of it needs a GPU. Oracles: naga, wgpu's own checks, tint.

use std::process::Command;

use naga::ShaderStage;
use naga::back::pipeline_constants::process_overrides;
use naga::back::{hlsl, msl, spv};
use tumble_core::Error;
use tumble_gpu::{Gpu, Pipelines, Shader, pipelines::build_pass};

/// Every shader, parsed; all that is wrong with any of them is said at once.
fn shaders() -> Vec<(&'static str, Shader)> {
    let (mut shaders, mut errors) = (Vec::new(), Vec::new());
    for (stem, _) in tumble_shaders::SOURCES {
        match Shader::parse(&tumble_shaders::compose(stem).unwrap_or_else(|error| panic!("{error}"))) {
            Ok(shader) => shaders.push((*stem, shader)),
            Err(error) => errors.push(error.to_string()),
        }
    }
    assert!(errors.is_empty(), "{}", errors.join("\n"));
    shaders
}

#[test]
fn all_are_valid_and_used() {
    for (stem, shader) in shaders() {
        let entries = shader.entries().count();
        assert!(entries == 0 || !stem.starts_with("shared/"), "{stem}: a stage's pass is no shared file");
        let import = format!("//#import {stem}.wgsl");
        let is_imported = tumble_shaders::SOURCES.iter().any(|(_, text)| text.lines().any(|line| line == import));
        assert!(entries > 0 || is_imported, "{stem}: has no pass, and no shader imports it");
    }
}

#[test]
fn all_translate() {
    for (stem, shader) in shaders() {
        for entry in shader.entries() {
            let (module, info) = shader.module();
            let point = Some((ShaderStage::Compute, entry));
            let (module, info) = process_overrides(module, info, point, &Default::default()).unwrap();
            let what = format!("{stem}:{entry}");

            let pipeline = spv::PipelineOptions { shader_stage: ShaderStage::Compute, entry_point: entry.into() };
            let words = spv::write_vec(&module, &info, &spv::Options::default(), Some(&pipeline));
            assert!(!words.unwrap_or_else(|error| panic!("{what} to SPIR-V: {error}")).is_empty());

            let options = msl::Options { lang_version: (2, 4), ..Default::default() };
            let (text, _) = msl::write_string(&module, &info, &options, &Default::default())
                .unwrap_or_else(|error| panic!("{what} to MSL: {error}"));
            assert!(text.contains("kernel"), "{what}");

            let mut text = String::new();
            let special = hlsl::BindTarget { space: 255, register: 0, ..Default::default() };
            let options = hlsl::Options { special_constants_binding: Some(special), ..Default::default() };
            hlsl::Writer::new(&mut text, &options, &Default::default())
                .write(&module, &info, None)
                .unwrap_or_else(|error| panic!("{what} to HLSL: {error}"));
            assert!(text.contains("numthreads"), "{what}");
        }
    }
}

#[test]
fn all_pipelines_build_within_default_limits() {
    let gpu = Gpu::noop();
    let mut pipelines = Pipelines::new();
    for (stem, shader) in shaders() {
        for entry in shader.entries() {
            pipelines.pass(&gpu, stem, entry).unwrap_or_else(|error| panic!("{error}"));
        }
    }
}

#[test]
fn nine_storage_buffers_are_refused() {
    let mut text = String::new();
    for i in 0..9 {
        text += &format!("@group(0) @binding({i}) var<storage, read_write> b{i}: array<u32>;\n");
    }
    text += "@compute @workgroup_size(64) fn main() { b0[0] = b1[0] + b2[0] + b3[0] + b4[0] + b5[0] + b6[0] + b7[0]";
    for (all, is_refused) in [(format!("{text} + b8[0]; }}"), true), (format!("{text}; }}"), false)] {
        let shader = Shader::parse(&composed("wide", all)).unwrap();
        let built = build_pass(&Gpu::noop(), shader, "main", 0);
        assert_eq!(built.is_err(), is_refused, "{built:?}");
    }
}

fn composed(stem: &'static str, text: String) -> tumble_shaders::Composed {
    tumble_shaders::compose_from(&[(stem, text.leak())], stem).unwrap()
}

/// Chrome's compiler checks what naga does not: barriers in uniform control flow.
fn tint(text: &str) -> Result<(), String> {
    let file = tempfile::Builder::new().suffix(".wgsl").tempfile().unwrap();
    std::fs::write(file.path(), text).unwrap();
    let output = Command::new("tint").args(["--format", "wgsl"]).arg(file.path()).output().unwrap();
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).into_owned()) }
}

#[test]
fn all_pass_tint() {
    if Command::new("tint").arg("--help").output().is_err() {
        eprintln!("tint is not on PATH: skipped");
        return;
    }
    for (stem, shader) in shaders() {
        if shader.entries().next().is_some() {
            let composed = tumble_shaders::compose(stem).unwrap();
            // naga does not know the line, tint wants it.
            let uses_subgroups = composed.source.contains("subgroupBallot");
            let enable = if uses_subgroups { "enable subgroups;\n" } else { "" };
            tint(&format!("{enable}{}", composed.source)).unwrap_or_else(|error| panic!("{stem}: {error}"));
        }
    }
    let barrier = "@compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {
        if i < 3u { workgroupBarrier(); }
    }";
    assert!(tint(barrier).unwrap_err().contains("uniform control flow"));
    assert!(
        Shader::parse(&composed("barrier", barrier.into())).is_ok(),
        "naga checks barriers too: say so in the docs"
    );
}

#[test]
fn a_bad_shader_is_told_by_file_and_line() {
    let refused = |shared| {
        let main = "//#import shared/x.wgsl\n@compute @workgroup_size(1) fn main() { _ = f(1u); }\n";
        let sources = [("stage/main", main), ("shared/x", shared)];
        let composed = tumble_shaders::compose_from(&sources, "stage/main").unwrap();
        match Shader::parse(&composed) {
            Err(Error::Gpu { what, message }) => (what, message),
            other => panic!("{other:?}"),
        }
    };
    let (what, message) = refused("\nfn f(a: u32) -> u32 {\n    return b;\n}\n");
    assert_eq!(what, "shader shaders/shared/x.wgsl:3");
    assert!(message.contains("`b`"), "{message}");
    // Parses, and is not valid.
    let (what, message) = refused("fn f(a: u32) -> u32 {\n    if a > 0u {\n        return 1u;\n    }\n}\n");
    assert!(what.starts_with("shader shaders/shared/x.wgsl:"), "{what}: {message}");
    assert!(message.contains("return"), "{message}");
}
