//! The table of hard cases: tests record what they measure, line by line, and [`merge`] makes one table of it.
//!
//! Where the environment variable `HARD_CASES` names a folder, each [`Case`] writes a file of its own there, so that tests
//! in threads and programs of their own do not meet.

use crate::machine::Machine;
use crate::report::number;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Sub-steps that rapier takes of itself.
pub const RAPIER_SUBSTEPS: u32 = 4;

/// Who measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum By {
    /// tumble on the CPU.
    Cpu,
    /// tumble on a GPU.
    Gpu,
    /// rapier.
    Rapier,
}

impl By {
    /// Both sides of tumble.
    pub const OURS: [Self; 2] = [Self::Cpu, Self::Gpu];
    /// Both sides of tumble, and rapier.
    pub const ALL: [Self; 3] = [Self::Cpu, Self::Gpu, Self::Rapier];
    /// Where the GPU side would take minutes on a software adapter.
    pub const WITHOUT_GPU: [Self; 2] = [Self::Cpu, Self::Rapier];
}

/// What is asked of a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ask {
    /// Nothing; the number is told.
    Said,
    /// Within so much of the exact value, on either side.
    Near(f64, f64),
    /// No more than this.
    AtMost(f64),
    /// No less than this.
    AtLeast(f64),
    /// An error, to be small beside rapier's; below this it counts as none, whatever rapier's is.
    Beside(f64),
}

/// One number of the table.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Line {
    case: String,
    quantity: String,
    unit: String,
    by: By,
    substeps: u32,
    /// Infinite: it stands to the end. Not a number: what should stand has fallen, and the number would mean nothing.
    value: f64,
    exact: Option<f64>,
    asked: String,
    held: Option<bool>,
    /// Of [`Ask::Beside`].
    floor: Option<f64>,
}

/// One case of the table.
pub struct Case {
    name: String,
    file: Option<PathBuf>,
    lines: Mutex<Vec<Line>>,
}

impl Case {
    /// `row` is a letter, A to D for a section of the table, and two digits, the place in it; cases of one row follow each
    /// other by name. Row and name together name the case's file, so no two cases share them.
    pub fn new(row: &str, name: &str) -> Self {
        let plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
        let folder = std::env::var_os("HARD_CASES").map(PathBuf::from);
        let file = folder.map(|folder| folder.join(format!("{row}-{plain}.csv")));
        Self { name: name.into(), file, lines: Mutex::default() }
    }

    /// Its name in the table.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Prints and records a number, and says whether it is what is asked. [`Ask::Beside`] holds here: it is judged by
    /// [`merge`], which knows rapier's, and by the test.
    ///
    /// # Panics
    /// When the folder cannot be written to.
    pub fn row(&self, by: By, substeps: u32, quantity: &str, unit: &str, value: f64, ask: Ask) -> bool {
        let mut floor = None;
        let (asked, exact, held) = match ask {
            Ask::Said => (String::new(), None, None),
            Ask::Near(exact, within) => {
                (format!("± {}", number(within)), Some(exact), Some((value - exact).abs() <= within))
            }
            Ask::AtMost(limit) => (format!("at most {}", number(limit)), None, Some(value <= limit)),
            Ask::AtLeast(limit) => (format!("at least {}", number(limit)), None, Some(value >= limit)),
            Ask::Beside(small) => {
                floor = Some(small);
                (format!("as rapier, floor {}", number(small)), None, None)
            }
        };
        let (case, quantity, unit) = (self.name.clone(), quantity.to_owned(), unit.to_owned());
        println!("{case:<30} {by:<6?} n {substeps:<2} {quantity:<28} {value:>12.6} {unit:<6} {exact:?} {asked}");
        let mut lines = self.lines.lock().expect("no test panics while it records");
        lines.push(Line { case, quantity, unit, by, substeps, value, exact, asked, held, floor });
        if let Some(file) = &self.file {
            let mut writer = csv::Writer::from_path(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
            for line in lines.iter() {
                writer.serialize(line).and_then(|()| Ok(writer.flush()?)).expect("a file that was just made");
            }
        }
        held.unwrap_or(true)
    }
}

/// A row of the table: one quantity of one case by all who measured it.
struct Row {
    section: char,
    first: Line,
    lines: Vec<Line>,
}

const SECTIONS: [(char, &str); 4] =
    [('A', "Analytic"), ('B', "Stacks, structures and heaps"), ('C', "Ratios of mass"), ('D', "Extremes")];

/// Reads what the cases left in `folder`, and writes `hard_cases.csv` and `hard_cases.md` to `out`; `closing` ends the
/// latter.
///
/// # Errors
/// When a file cannot be read or written, or is none of a case.
pub fn merge(folder: &Path, out: &Path, closing: &str) -> Result<(), String> {
    let rows = read(folder)?;
    let machine = Machine::this();
    let told = |e: &dyn std::fmt::Display| format!("cannot write to {}: {e}", out.display());
    let mut table = csv::Writer::from_path(out.join("hard_cases.csv")).map_err(|e| told(&e))?;
    let head = "section,case,quantity,unit,cpu,gpu,rapier,exact,asked,ratio,substeps,rapier_substeps,verdict,machine,commit,date";
    table.write_record(head.split(',')).map_err(|e| told(&e))?;
    let mut text = format!(
        "# Hard cases\n\nMade by `scripts/hard_cases.sh` on {}, {}, commit {}; a software adapter is the GPU. dt 1/60 s, \
         friction 0.6, sleep off, one thread, unless a row says otherwise; tumble takes the sub-steps of the column (8 of \
         itself), rapier its default of {RAPIER_SUBSTEPS}. Of chaotic scenes: medians of five seeds, or as the row says. Ratio: \
         tumble's over rapier's, of the side that does worse. \"A tenth\": no more than a tenth of rapier's error, or \
         than the row's floor (what counts as none); \"no worse\": by no more than 10 % or the floor. [All numbers](hard_cases.csv).\n",
        machine.name, machine.date, machine.commit
    );
    for (letter, title) in SECTIONS {
        let _ = writeln!(text, "\n## {title}\n");
        text.push_str(
            "| case | quantity | tumble CPU | tumble GPU | rapier | ratio | exact | asked | sub-steps | verdict |\n",
        );
        text.push_str("|---|---|---:|---:|---:|---:|---:|---|---:|---|\n");
        let mut last = "";
        for row in rows.iter().filter(|row| row.section == letter) {
            let Line { case, quantity, unit, exact, asked, substeps, .. } = &row.first;
            let none = if exact.is_some() || row.by(By::Rapier).is_none() { "–" } else { "not run" };
            let [cpu, gpu] = By::OURS.map(|by| row.cell(by, "not run"));
            let rapier = row.cell(By::Rapier, none);
            let (ratio, exact) = (row.ratio().map(number).unwrap_or_default(), exact.map(number).unwrap_or_default());
            let name = if case == last { "" } else { case };
            let (dash, verdict) = (|x: &String| if x.is_empty() { "–".to_owned() } else { x.clone() }, row.verdict());
            let unit_told = if unit == "1" { String::new() } else { format!(", {unit}") };
            let _ = writeln!(
                text,
                "| {name} | {quantity}{unit_told} | {cpu} | {gpu} | {rapier} | {} | {} | {} | {substeps} | {verdict} |",
                dash(&ratio),
                dash(&exact),
                dash(asked)
            );
            last = case;
            let (ours, theirs) = (substeps.to_string(), row.by(By::Rapier).map(|l| l.substeps.to_string()));
            let cells = [title, case, quantity, unit, &cpu, &gpu, &rapier, &exact, asked, &ratio, &ours];
            let tail = [&theirs.unwrap_or_default(), verdict, &machine.name, &machine.commit, &machine.date];
            let cells = cells.into_iter().chain(tail).map(|cell| if cell == "–" { "" } else { cell });
            table.write_record(cells).map_err(|e| told(&e))?;
        }
    }
    table.flush().map_err(|e| told(&e))?;
    text.push('\n');
    text.push_str(closing);
    std::fs::write(out.join("hard_cases.md"), text).map_err(|e| told(&e))
}

fn read(folder: &Path) -> Result<Vec<Row>, String> {
    let told = |e: std::io::Error| format!("cannot read {}: {e}", folder.display());
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).and_then(|all| all.map(|f| f.map(|f| f.path())).collect()).map_err(told)?;
    files.sort();
    let mut rows: Vec<Row> = Vec::new();
    for file in files {
        let section = file.file_name().and_then(|name| name.to_str()?.chars().next()).unwrap_or(' ');
        let reader = csv::Reader::from_path(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        for line in reader.into_deserialize() {
            let line: Line = line.map_err(|e| format!("{}: {e}", file.display()))?;
            let same = |row: &&mut Row| row.first.case == line.case && row.first.quantity == line.quantity;
            match rows.iter_mut().find(same) {
                Some(row) => row.lines.push(line),
                None => rows.push(Row { section, first: line.clone(), lines: vec![line] }),
            }
        }
    }
    Ok(rows)
}

impl Row {
    fn by(&self, by: By) -> Option<&Line> {
        self.lines.iter().find(|line| line.by == by)
    }

    fn cell(&self, by: By, missing: &str) -> String {
        self.by(by).map_or(missing.into(), |line| match line.value {
            v if v.is_nan() => "fell".into(),
            v if v.is_infinite() => "stands".into(),
            v => number(v),
        })
    }

    /// The largest of ours: errors are what is set beside rapier's, and a fallen side has the worst. The lowest of times
    /// for which something stood.
    fn ours(&self) -> impl Iterator<Item = f64> {
        self.lines.iter().filter(|line| line.by != By::Rapier).map(|line| line.value)
    }

    fn ratio(&self) -> Option<f64> {
        let (theirs, _) = (self.by(By::Rapier)?.value, self.first.floor?);
        let worst = self.ours().map(|ours| ours / theirs).fold(f64::MIN, |a, b| if b.is_nan() { b } else { a.max(b) });
        worst.is_finite().then_some(worst)
    }

    fn verdict(&self) -> &'static str {
        let held = |line: &&Line| line.by != By::Rapier && line.held.is_some();
        if self.lines.iter().filter(held).count() > 0 {
            let fails = |by| self.by(by).is_some_and(|line| line.held == Some(false));
            return match (fails(By::Cpu), fails(By::Gpu)) {
                (false, false) => "held",
                (true, true) => "**missed**",
                (true, false) => "**missed on the CPU**",
                (false, true) => "**missed on the GPU**",
            };
        }
        let (Some(theirs), Some(floor)) = (self.by(By::Rapier).map(|line| line.value), self.first.floor) else {
            return "told";
        };
        // Where rapier's fell, standing is better.
        let within = |share: f64, more: f64| {
            self.ours().all(|ours| !ours.is_nan() && (theirs.is_nan() || ours <= (share * theirs).max(more)))
        };
        let fell = self.ours().any(f64::is_nan);
        match () {
            () if fell && theirs.is_nan() => "both fall",
            () if fell => "**falls, rapier's stands**",
            () if within(0.1, floor) => "a tenth",
            () if within(0.5, floor) => "a half",
            () if within(1.1, theirs + floor) => "no worse",
            () => "**worse**",
        }
    }
}
