//! Runs a standard scene, and tells what a step costs and how good its result is:
//! `cargo run --release --example run -- pile --bodies 1000`.
//!
//! Every step is waited for. All steps count, the first ones too: there is no warm-up.

mod args;
#[path = "../common/asked.rs"]
mod asked;
mod outcome;
mod pictures;
mod trace;

use args::Args;
use asked::Failure;
use indicatif::{ProgressBar, ProgressStyle};
use outcome::Outcome;
use pictures::{Frames, Pictures};
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use trace::Trace;
use tumble::core::{measures, scenes};
use tumble::{Backend, World};

fn main() -> ExitCode {
    let failure = match asked::parse().and_then(|args: Args| if args.list { list() } else { run(&args) }) {
        Ok(()) => return ExitCode::SUCCESS,
        Err(failure) => failure,
    };
    let (code, message) = match failure {
        Failure::Argument(message) => (2, message),
        Failure::Run(message) => (1, message),
    };
    tell(&format!("error: {message}"));
    ExitCode::from(code)
}

/// A line on standard error. Unlike `eprintln!`, it does not panic when nobody can read it.
fn tell(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Text on standard output. A reader that had enough, as in `run --list | head -1`, is no error.
fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::Run(format!("cannot write to standard output: {error}")))
        }
        _ => Ok(()),
    }
}

fn list() -> Result<(), Failure> {
    let line = |s: &scenes::StandardScene| format!("{:<8} {:>5} bodies   {}\n", s.name, s.default_bodies, s.about);
    print(&scenes::ALL.iter().map(line).collect::<String>())
}

fn run(args: &Args) -> Result<(), Failure> {
    let params = args.params()?;
    let (standard, bodies) = args.asked.scene(None)?;
    // Before the run, so that a bad path costs no time.
    let size = args.picture_size()?;
    let mut json = args.json.as_deref().map(open).transpose()?;
    let mut trace_file = args.trace.as_deref().map(open).transpose()?;
    let mut png = args.png.as_deref().map(open).transpose()?;
    args.frames.as_deref().map(pictures::make_folder).transpose()?;
    let mut world = World::new((standard.build)(bodies), params, args.asked.backend())?;
    #[cfg(feature = "cpu")]
    if matches!((args.asked.backend(), &world), (Backend::Auto, World::Cpu(_))) {
        tell("no GPU can be used (software adapters do not count here): running on the CPU");
    }
    let mut outcome = Outcome::new(standard.name, args.steps, &params, world.scene());
    let mut pictures = size.map(|size| Pictures::new(&world, size)).transpose()?;
    let mut frames = match (&args.frames, &mut pictures) {
        (Some(folder), Some(pictures)) => Some(Frames::begin(folder, pictures, &mut world)?),
        _ => None,
    };
    // A full disk ends the pictures, and not the run.
    let mut framed = Ok(());
    let mut trace = args.trace.is_some().then(|| Trace::new(standard.name));
    take_steps(&mut world, &mut outcome, trace.as_mut(), |number, world| {
        if let (Ok(()), Some(frames), Some(pictures)) = (&framed, &mut frames, &mut pictures) {
            framed = frames.take(f64::from(number) * f64::from(params.dt), pictures, world);
        }
    })?;

    let spinner = ProgressBar::new_spinner().with_message("measuring the overlap");
    spinner.enable_steady_tick(Duration::from_millis(100));
    let (poses, velocities) = (world.poses()?, world.velocities()?);
    outcome.penetration = measures::penetration(world.scene(), &poses);
    outcome.kinetic_energy = measures::kinetic_energy(world.scene(), &poses, &velocities);
    outcome.state_hash = measures::state_hash(&poses, &velocities);
    spinner.finish_and_clear();

    // The table last and in any case: a full disk does not take the result of a long run away.
    let written = json.as_mut().map_or(Ok(()), |(file, path)| {
        let text = format!("{:#}\n", outcome.json());
        write(file, path, text.as_bytes())
    });
    let traced = trace_file
        .as_mut()
        .zip(trace)
        .map_or(Ok(()), |((file, path), trace)| write(file, path, trace.json().as_bytes()));
    let drawn = match (&mut png, &mut pictures) {
        (Some((file, path)), Some(pictures)) => {
            let camera = pictures.camera(&world, &poses);
            pictures.png(&mut world, &camera).and_then(|picture| write(file, path, &picture))
        }
        _ => Ok(()),
    };
    print(&outcome.table())?;
    written.and(traced).and(framed).and(drawn)
}

/// Runs the steps and notes what each took; calls `after` with the number of each, which does not count in its time.
fn take_steps(
    world: &mut World,
    outcome: &mut Outcome,
    mut trace: Option<&mut Trace>,
    mut after: impl FnMut(u32, &mut World),
) -> Result<(), Failure> {
    let bar = progress_bar(outcome.steps)?;
    for number in 1..=outcome.steps {
        let begin = Instant::now();
        let report = world.step().and_then(|()| world.sync());
        let milliseconds = begin.elapsed().as_secs_f64() * 1e3;
        match report {
            Ok(report) => {
                if let Some(trace) = &mut trace {
                    trace.add(begin, milliseconds, &report);
                }
                outcome.add(milliseconds, report);
            }
            Err(error) => {
                bar.finish_and_clear();
                return Err(Failure::Run(format!("step {number}: {error}")));
            }
        }
        after(number, world);
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(())
}

/// On standard error, and only if that is a terminal.
fn progress_bar(steps: u32) -> Result<ProgressBar, Failure> {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} steps, {eta} left")
        .map_err(|error| Failure::Run(error.to_string()))?;
    Ok(ProgressBar::new(steps.into()).with_style(style))
}

/// Opens a file to be written at the end; until then it keeps what is in it.
fn open(path: &Path) -> Result<(File, &Path), Failure> {
    match OpenOptions::new().write(true).create(true).truncate(false).open(path) {
        Ok(file) => Ok((file, path)),
        Err(error) => Err(cannot_write(path, &error)),
    }
}

fn write(file: &mut File, path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let mut replace = || {
        // What is no regular file, such as a pipe, has no length to cut.
        if file.metadata()?.is_file() {
            file.set_len(0)?;
        }
        file.write_all(bytes)?;
        file.flush()
    };
    replace().map_err(|error| cannot_write(path, &error))
}

fn cannot_write(path: &Path, error: &io::Error) -> Failure {
    Failure::Run(format!("cannot write {}: {error}", path.display()))
}
