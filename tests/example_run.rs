//! The program `examples/run`: what it prints and writes, how it refuses, and what README.md says of it. Oracles: its
//! documented fields, and the library run on the same scene.

mod common;
#[path = "common/program.rs"]
mod program;

use program::program;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use tumble::core::{measures, scenes};
use tumble::{Accuracy, Backend, Broadphase, Params, World};

const FIELDS: [&str; 24] = [
    "scene",
    "backend",
    "adapter",
    "bodies",
    "steps",
    "dt",
    "accuracy",
    "substeps",
    "spent",
    "ms_per_step",
    "passes",
    "pairs",
    "contacts",
    "batches",
    "penetration",
    "kinetic_energy_j",
    "memory_bytes",
    "broadphase",
    "broadphase_bytes_per_body",
    "growths",
    "lost",
    "quarantined",
    "broken_joints",
    "state_hash",
];

fn run(arguments: &[&str]) -> Output {
    Command::new(program("run")).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// What it says on standard error; drivers may say things there too.
fn error_line(output: &Output) -> &str {
    let told: Vec<_> = text(&output.stderr).lines().filter(|line| !line.contains("XDG_RUNTIME_DIR")).collect();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].starts_with("error: ") && !told[0].contains("panicked"), "{told:?}");
    told[0]
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

/// Oracle: the same run through the library.
#[test]
fn a_tolerance_is_kept_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.json");
    let arguments = ["pyramid", "--bodies", "55", "--steps", "120", "--backend", "cpu", "--joint-tolerance", "0.0005"];
    let output = run(&[&arguments[..], &["--json", file.to_str().unwrap()]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let json: Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    // Each of the two takes the other's value.
    let accuracy = Accuracy::Tolerance { penetration: 5e-4, joint: 5e-4, most: 32 };
    let scene = scenes::pyramid(10);
    let mut world = World::new(scene, Params { accuracy, ..Params::default() }, Backend::Cpu).unwrap();
    (0..120).for_each(|_| world.step().unwrap());
    let spent = world.sync().unwrap().accuracy.unwrap();
    assert_eq!(json["spent"]["visits"], spent.visits);
    assert_eq!(json["spent"]["substeps"], spent.substeps);
    assert_eq!(json["spent"]["joint_residual_m"], 0.0);
    assert!(text(&output.stdout).contains("sub-steps on the mean"), "{}", text(&output.stdout));
}

#[test]
fn list_names_the_scenes() {
    let output = run(&["--list"]);
    assert!(output.status.success() && output.stderr.is_empty());
    let told: Vec<_> = text(&output.stdout).lines().collect();
    assert_eq!(told.len(), scenes::ALL.len());
    for (line, scene) in told.iter().zip(scenes::ALL) {
        assert!(line.starts_with(scene.name) && line.ends_with(scene.about), "{line}");
    }
}

#[test]
fn json_has_the_documented_fields() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("out.json");
    // What was there is replaced, however long.
    std::fs::write(&file, "x".repeat(1 << 16)).unwrap();
    let path = file.to_str().unwrap();
    let output = run(&[
        "pile",
        "--bodies",
        "50",
        "--steps",
        "90",
        "--dt",
        "0.01",
        "--substeps",
        "3",
        "--threads",
        "2",
        "--backend",
        "cpu",
        "--broadphase",
        "grid",
        "--profile",
        "--json",
        path,
    ]);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    let json: Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    let mut expected = FIELDS;
    expected.sort_unstable();
    let mut found = keys(&json);
    found.sort_unstable();
    assert_eq!(found, expected);

    let params =
        Params { dt: 0.01, accuracy: Accuracy::Substeps(3), broadphase: Broadphase::Grid, ..Params::default() };
    let mut world = World::new(scenes::pile(50), params, Backend::Cpu).unwrap();
    for _ in 0..90 {
        world.step().unwrap();
    }
    let (report, poses, velocities) = (world.sync().unwrap(), world.poses().unwrap(), world.velocities().unwrap());
    let overlap = measures::penetration(world.scene(), &poses);
    let hash = format!("{:016x}", measures::state_hash(&poses, &velocities));
    assert_eq!(json["state_hash"], hash);
    assert_eq!(json["penetration"]["max_m"].as_f64().unwrap().to_bits(), overlap.max_m.to_bits());
    assert_eq!(json["penetration"]["mean_m"].as_f64().unwrap().to_bits(), overlap.mean_m.to_bits());
    let energy = measures::kinetic_energy(world.scene(), &poses, &velocities);
    assert_eq!(json["kinetic_energy_j"].as_f64().unwrap().to_bits(), energy.to_bits());
    let counts = [
        ("bodies", 50),
        ("steps", 90),
        ("substeps", 3),
        ("pairs", report.pairs.into()),
        ("contacts", report.contacts.into()),
        ("batches", report.batches.into()),
        ("memory_bytes", report.memory_bytes),
        ("lost", 0),
        ("quarantined", 0),
    ];
    for (field, count) in counts {
        assert_eq!(json[field], count, "{field}");
    }
    assert!(report.contacts > 0);
    assert_eq!((&json["accuracy"], &json["spent"]), (&"3 sub-steps".into(), &Value::Null));
    assert_eq!(json["broadphase"], "grid");
    assert!(json["broadphase_bytes_per_body"].as_f64().unwrap() > 10.0);
    assert_eq!((&json["scene"], &json["backend"]), (&"pile".into(), &"cpu".into()));
    assert!(json["adapter"].as_str().unwrap().contains(" lanes, 2 threads"));
    assert_eq!(json["dt"].as_f64().unwrap() as f32, 0.01);
    assert!(keys(&json["growths"]).is_empty());
    let (median, p95) = (json["ms_per_step"]["median"].as_f64().unwrap(), json["ms_per_step"]["p95"].as_f64().unwrap());
    assert!(median > 0.0 && p95 >= median);
    assert!(keys(&json["passes"]).contains(&"solver"));
    assert!(json["passes"].as_object().unwrap().values().all(|ms| ms.as_f64().is_some_and(|ms| ms >= 0.0)), "{json}");
    // The table says the same.
    let table = text(&output.stdout);
    for told in ["pile", "cpu (", "50 dynamic", "90 of 0.01 s", "ms a step", "ms a pass", "  solver", &hash] {
        assert!(table.contains(told), "{told}: {table}");
    }
}

#[test]
fn runs_on_an_adapter() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("out.json");
    let output =
        run(&["column", "--bodies", "5", "--steps", "3", "--backend", "gpu", "--json", file.to_str().unwrap()]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let json: Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    assert_eq!((&json["backend"], &json["bodies"], &json["lost"]), (&"gpu".into(), &5.into(), &0.into()));
    assert_eq!((&json["contacts"], &json["passes"]), (&20.into(), &Value::Null));
    eprintln!("adapter: {}", json["adapter"]);
}

#[test]
fn bad_arguments_are_refused_in_one_line() {
    let cases: [(&[&str], &[&str]); 33] = [
        (&[], &["no scene", "pile", "pyramid", "hub"]),
        (&["pyramd"], &["'pyramd'", "pile", "balls", "mixed", "column", "hub", "similar", "'pyramid'"]),
        (&["pile", "--bodies", "0"], &["'0'", "--bodies", "1 to 5000000"]),
        (&["pile", "--bodies", "-5"], &["'-5'", "--bodies", "1 to 5000000"]),
        (&["pile", "--bodies", "1e12"], &["'1e12'", "--bodies", "1 to 5000000"]),
        (&["pile", "--bodies", "1000000000000"], &["--bodies", "1 to 5000000"]),
        (&["pile", "--bodies", "5000001"], &["'5000001'", "--bodies", "1 to 5000000"]),
        (&["pile", "--bodies"], &["--bodies"]),
        (&["pile", "--steps", "0"], &["'0'", "--steps", "1 to 10000000"]),
        (&["pile", "--dt", "-0.1"], &["dt is -0.1", "1e-6 to 1 s"]),
        (&["pile", "--dt", "0"], &["dt is 0", "1e-6 to 1 s"]),
        (&["pile", "--dt", "NaN"], &["dt is NaN", "1e-6 to 1 s"]),
        (&["pile", "--dt", "-inf"], &["dt is -inf", "1e-6 to 1 s"]),
        (&["pile", "--dt", "fast"], &["'fast'", "--dt"]),
        (&["pile", "--substeps", "0"], &["'0'", "--substeps", "1 to 256"]),
        (&["pile", "--substeps", "257"], &["'257'", "--substeps", "1 to 256"]),
        (&["pile", "--tolerance", "0"], &["accuracy.penetration is 0", "1e-6 to 1 m"]),
        (&["pile", "--tolerance", "NaN"], &["accuracy.penetration is NaN", "1e-6 to 1 m"]),
        (&["pile", "--joint-tolerance", "NaN"], &["accuracy.joint is NaN", "1e-6 to 1 m"]),
        (
            &["pile", "--tolerance", "NaN", "--joint-tolerance", "0.001"],
            &["accuracy.penetration is NaN", "1e-6 to 1 m"],
        ),
        (&["pile", "--tolerance", "0.001", "--substeps", "12"], &["accuracy.most is 12", "a multiple of 8"]),
        (&["pile", "--threads", "0"], &["'0'", "--threads", "1 to 1024"]),
        (&["pile", "--backend", "metal"], &["'metal'", "--backend", "auto", "cpu", "gpu"]),
        (&["pile", "--broadphase", "sweep"], &["'sweep'", "--broadphase", "auto", "grid"]),
        (&["pile", "hub"], &["'hub'"]),
        (&["pile", "--fast"], &["'--fast'"]),
        (&["pile", "--size", "0x720"], &["'0x720'", "--size", "1280x720", "1 to 8192"]),
        (&["pile", "--size", "1280x8193"], &["'1280x8193'", "--size", "1 to 8192"]),
        (&["pile", "--size", "99999999999x1"], &["'99999999999x1'", "--size"]),
        (&["pile", "--size", "-1x5"], &["'-1x5'", "--size"]),
        (&["pile", "--size", "1280"], &["'1280'", "--size", "1280x720"]),
        (&["pile", "--size", "1280x720x3"], &["'1280x720x3'", "--size"]),
        (&["pile", "--png"], &["--png"]),
    ];
    for (arguments, told) in cases {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(output.stdout.is_empty());
        let line = error_line(&output);
        assert!(told.iter().all(|word| line.contains(word)), "{arguments:?}: {line}");
    }
}

/// The limits that the program names are those of the library.
#[test]
fn limits_agree_with_the_library() {
    for (substeps, threads) in [(1, 1), (256, 1024)] {
        Params { accuracy: Accuracy::Substeps(substeps), threads: Some(threads), ..Params::default() }
            .validate()
            .unwrap();
    }
    for (substeps, threads) in [(0, 1), (257, 1), (1, 0), (1, 1025)] {
        Params { accuracy: Accuracy::Substeps(substeps), threads: Some(threads), ..Params::default() }
            .validate()
            .unwrap_err();
    }
}

#[test]
fn a_path_that_cannot_be_written_costs_no_run() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("none").join("out");
    let file = folder.path().join("file");
    std::fs::write(&file, "kept").unwrap();
    let below_file = file.join("frames");
    for (option, path) in [
        ("--json", missing.as_path()),
        ("--json", folder.path()),
        ("--png", missing.as_path()),
        ("--png", folder.path()),
        ("--frames", file.as_path()),
        ("--frames", below_file.as_path()),
    ] {
        let output = run(&["column", "--backend", "cpu", "--steps", "10000000", option, path.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(1));
        let line = error_line(&output);
        assert!(line.contains("cannot write") && line.contains(path.to_str().unwrap()), "{option}: {line}");
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "kept");
    let output = run(&["column", "--backend", "cpu", "--frames", file.to_str().unwrap()]);
    assert!(error_line(&output).contains("it is a file"));
}

/// Width, height, and red, green and blue of each pixel.
fn read_png(path: &Path) -> (u32, u32, Vec<u8>) {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
    (info.width, info.height, pixels)
}

/// Oracle: the pictures that the library makes of the same states.
#[test]
fn pictures_show_the_states_of_the_run() {
    use tumble_draw::{Bounds, Camera, Offscreen, PoseUpload, Renderer, Style};
    let folder = tempfile::tempdir().unwrap();
    let (png, frames) = (folder.path().join("last.png"), folder.path().join("new").join("frames"));
    std::fs::write(&png, "x".repeat(1 << 20)).unwrap();
    let (png_path, frames_path) = (png.to_str().unwrap(), frames.to_str().unwrap());
    // 0, 0.04, 0.08 (beyond 2/30), 0.12, 0.16, 0.2 s: 1/30 s has passed in each step.
    let run_with = |dt: &str, steps: &str, backend: &str| {
        let _ = std::fs::remove_dir_all(&frames);
        let output = run(&[
            "pile",
            "--bodies",
            "30",
            "--steps",
            steps,
            "--dt",
            dt,
            "--backend",
            backend,
            "--size",
            "101x60",
            "--png",
            png_path,
            "--frames",
            frames_path,
        ]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let mut names: Vec<_> = std::fs::read_dir(&frames)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort_unstable();
        names
    };
    let names = |count: u32| (0..count).map(|i| format!("frame_{i:04}.png")).collect::<Vec<_>>();
    assert_eq!(run_with("0.04", "5", "cpu"), names(6));
    // Every second step.
    assert_eq!(run_with("0.0166666", "9", "gpu"), names(5));
    // 0, 0.035 to 0.07 to 0.1 to 0.135: the first state at or after each thirtieth.
    assert_eq!(run_with("0.005", "28", "cpu"), names(5));

    let gpu = common::gpu();
    let mut world = World::new(scenes::pile(30), Params { dt: 0.005, ..Params::default() }, Backend::Cpu).unwrap();
    let mut upload = PoseUpload::new(&gpu.device, &gpu.queue);
    let mut renderer = Renderer::new(&gpu.device, Offscreen::FORMAT, world.scene()).unwrap();
    let offscreen = Offscreen::new(&gpu.device, &gpu.queue, 101, 60).unwrap();
    let poses = world.poses().unwrap();
    let first = Bounds::of(world.scene(), &poses);
    let mut done = 0;
    for (steps, file) in [
        (0, frames.join("frame_0000.png")),
        (7, frames.join("frame_0001.png")),
        (14, frames.join("frame_0002.png")),
        (20, frames.join("frame_0003.png")),
        (27, frames.join("frame_0004.png")),
        (28, png.clone()),
    ] {
        while done < steps {
            world.step().unwrap();
            done += 1;
        }
        let poses = world.poses().unwrap();
        let bounds = if file == png { Bounds::of(world.scene(), &poses) } else { first };
        let camera = Camera::framing(&bounds, 0.5, 0.36, 0.6, 101.0 / 60.0);
        let buffer = upload.write(world.scene(), &poses).unwrap();
        let expected = offscreen.picture(&mut renderer, &camera, buffer, &Style::default()).unwrap();
        let expected: Vec<u8> = expected.chunks(4).flat_map(|pixel| pixel[..3].to_vec()).collect();
        assert!(read_png(&file) == (101, 60, expected), "{}", file.display());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told_and_the_table_still_comes() {
    use std::fs::OpenOptions;
    let run = ["column", "--backend", "cpu", "--steps", "2"];
    let output = Command::new(program("run")).args(run).args(["--json", "/dev/full"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let line = error_line(&output);
    assert!(line.contains("cannot write /dev/full") && line.contains("No space left"), "{line}");
    assert!(text(&output.stdout).contains("state hash"));

    let full = || OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output =
        Command::new(program("run")).args(run).args(["--png", "/dev/full", "--size", "64x36"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(error_line(&output).contains("cannot write /dev/full"));
    assert!(text(&output.stdout).contains("state hash"));
    // The first picture can be written, the second cannot.
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink("/dev/full", folder.path().join("frame_0001.png")).unwrap();
    let frames = ["--frames", folder.path().to_str().unwrap(), "--dt", "0.04", "--size", "64x36"];
    let output = Command::new(program("run")).args(run).args(frames).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let line = error_line(&output);
    assert!(line.contains("frame_0001.png") && line.contains("No space left"), "{line}");
    assert!(text(&output.stdout).contains("state hash"));

    for arguments in [run.as_slice(), &["--list"]] {
        let output = Command::new(program("run")).args(arguments).stdout(full()).output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        assert!(error_line(&output).contains("standard output"));
    }
    // Nowhere left to tell it.
    let status = Command::new(program("run")).arg("nothing").stderr(full()).status().unwrap();
    assert_eq!(status.code(), Some(2));
}

#[cfg(target_os = "linux")]
#[test]
fn a_machine_without_an_adapter() {
    let run = |backend: &str, more: &[&str]| {
        let mut command = Command::new(program("run"));
        for variable in ["VK_ICD_FILENAMES", "VK_DRIVER_FILES"] {
            command.env(variable, "/nonexistent");
        }
        command.args(["column", "--steps", "2", "--backend", backend]).args(more).output().unwrap()
    };
    // Nothing draws there.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out").to_str().unwrap().to_owned();
    for option in ["--png", "--frames"] {
        let output = run("cpu", &[option, &path]);
        assert_eq!(output.status.code(), Some(1));
        let line = error_line(&output);
        assert!(line.contains("adapter") && line.contains("mesa-vulkan-drivers") && line.contains(option), "{line}");
        let _ = std::fs::remove_file(&path);
    }
    let output = run("gpu", &[]);
    assert_eq!(output.status.code(), Some(1));
    let line = error_line(&output);
    assert!(line.contains("no GPU adapter was found") && line.contains("mesa-vulkan-drivers"), "{line}");
    let output = run("auto", &[]);
    assert!(output.status.success());
    assert!(text(&output.stderr).contains("running on the CPU"), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("cpu ("));
}

/// README.md names every field, and its example is the one that the documentation tests run.
#[test]
fn the_readme_agrees() {
    let readme = include_str!("../README.md");
    for field in FIELDS.iter().chain(&["median", "p95", "max_m", "mean_m"]) {
        assert!(readme.contains(&format!("`{field}`")), "{field}");
    }
    let library: Vec<_> = include_str!("../src/lib.rs")
        .lines()
        .skip_while(|line| *line != "//! ```")
        .skip(1)
        .take_while(|line| *line != "//! ```")
        .map(|line| line.trim_start_matches("//!").strip_prefix(' ').unwrap_or(""))
        .filter(|line| !line.starts_with("# "))
        .collect();
    assert!(!library.is_empty() && readme.contains(&format!("```rust\n{}\n```", library.join("\n"))), "{library:?}");
}
