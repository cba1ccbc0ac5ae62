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
        // Blanks in front of a number are for the order of the files.
        let name = name.split_whitespace().collect::<Vec<_>>().join(" ");
        Self { name, file, lines: Mutex::default() }
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
                (format!("as rapier; floor {}", number(small)), None, None)
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
    [('A', "Analytic"), ('B', "Stacks, structures and heaps"), ('C', "Ratios of mass, and joints"), ('D', "Extremes")];

const LEAD: &str = "dt 1/60 s, friction 0.6 and sleep off unless a row says otherwise; sub-steps are tumble's / rapier's, 8 and 4 \
    being what each takes of itself. Ratio: tumble's number over rapier's, of the side that does worse. Verdicts: an error \
    is *a tenth* of rapier's or less, *none* when it is below the row's floor, *better* or *no worse* (by 10 % or the \
    floor); what is asked in numbers is *held* or *missed*.";

/// Columns of the table, as they stand in its CSV.
const COLUMNS: [&str; 16] = [
    "section",
    "case",
    "quantity",
    "unit",
    "cpu",
    "gpu",
    "rapier",
    "ratio",
    "exact",
    "asked",
    "substeps",
    "rapier_substeps",
    "verdict",
    "machine",
    "commit",
    "date",
];

/// Reads what the cases left in `folder`, and writes `hard_cases.csv` and `hard_cases.md` to `out`; `closing` ends the
/// latter.
///
/// # Errors
/// When a file cannot be read or written, or is none of a case.
pub fn merge(folder: &Path, out: &Path, closing: &str) -> Result<(), String> {
    let rows = read(folder)?;
    let Machine { name: machine, commit, date } = Machine::this();
    let told = |e: &dyn std::fmt::Display| format!("cannot write to {}: {e}", out.display());
    let mut table = csv::Writer::from_path(out.join("hard_cases.csv")).map_err(|e| told(&e))?;
    table.write_record(COLUMNS).map_err(|e| told(&e))?;
    let mut text = format!("# Hard cases\n\n`scripts/hard_cases.sh` on {machine}, {date}, commit {commit}. {LEAD}\n\n");
    let mut verdicts: Vec<(&str, usize)> = Vec::new();
    for row in &rows {
        match verdicts.iter_mut().find(|(verdict, _)| *verdict == row.verdict()) {
            Some((_, count)) => *count += 1,
            None => verdicts.push((row.verdict(), 1)),
        }
    }
    verdicts.sort_by_key(|(_, count)| usize::MAX - count);
    let verdicts: Vec<String> = verdicts.into_iter().map(|(verdict, count)| format!("{verdict} {count}")).collect();
    let _ = writeln!(text, "{} rows: {}. [The table as CSV](hard_cases.csv).", rows.len(), verdicts.join(", "));
    for (letter, title) in SECTIONS {
        let _ = writeln!(text, "\n## {title}\n");
        let head =
            "| case | quantity | tumble CPU | tumble GPU | rapier | ratio | exact | asked | sub-steps | verdict |";
        let _ = writeln!(text, "{head}\n|---|---|---:|---:|---:|---:|---:|---|---:|---|");
        let mut last = "";
        for row in rows.iter().filter(|row| row.section == letter) {
            let Line { case, quantity, unit, exact, asked, substeps, .. } = &row.first;
            // Where there is an exact value, three digits would not tell how near the others are.
            let shown = if exact.is_some() { fine } else { number };
            let [cpu, gpu] = By::OURS.map(|by| row.cell(by, "not run", shown));
            let [ratio, exact] = [row.ratio().map(number), exact.map(shown)].map(Option::unwrap_or_default);
            let (rapier, verdict) = (row.cell(By::Rapier, "", shown), row.verdict());
            let theirs = row.by(By::Rapier).map_or(String::new(), |line| line.substeps.to_string());
            let plain = |by| row.cell(by, "", |value| value.to_string());
            let [plain_cpu, plain_gpu, plain_rapier] = By::ALL.map(plain);
            let [plain_ratio, plain_exact] =
                [row.ratio(), row.first.exact].map(|value| value.map(|value| value.to_string()).unwrap_or_default());
            let known = [title, case, quantity, unit, &plain_cpu, &plain_gpu, &plain_rapier];
            let known = known.into_iter().chain([plain_ratio.as_str(), &plain_exact, asked]);
            let rest = [&substeps.to_string(), &theirs, verdict.trim_matches('*'), &machine, &commit, &date];
            table.write_record(known.chain(rest)).map_err(|e| told(&e))?;
            let named = if case == last { "" } else { case };
            let quantity = if unit == "1" { quantity.clone() } else { format!("{quantity}, {unit}") };
            let substeps = if theirs.is_empty() { substeps.to_string() } else { format!("{substeps} / {theirs}") };
            let cells = [named, &quantity, &cpu, &gpu, &rapier, &ratio, &exact, asked, &substeps, verdict];
            let _ = writeln!(text, "| {} |", cells.map(|cell| if cell.is_empty() { " " } else { cell }).join(" | "));
            last = case;
        }
    }
    table.flush().map_err(|e| told(&e))?;
    std::fs::write(out.join("hard_cases.md"), text + "\n" + closing).map_err(|e| told(&e))
}

/// Up to five digits behind the point.
fn fine(value: f64) -> String {
    let text = format!("{value:.5}");
    if value != 0.0 && value.abs() < 0.01 {
        number(value)
    } else {
        text.trim_end_matches('0').trim_end_matches('.').into()
    }
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

    fn cell(&self, by: By, missing: &str, told: impl Fn(f64) -> String) -> String {
        self.by(by).map_or(missing.into(), |line| match line.value {
            v if v.is_nan() => "fell".into(),
            v if v.is_infinite() => "stands".into(),
            v => told(v),
        })
    }

    /// Numbers of our sides.
    fn ours(&self) -> impl Iterator<Item = f64> {
        self.lines.iter().filter(|line| line.by != By::Rapier).map(|line| line.value)
    }

    /// Of errors, which are better when they are smaller.
    fn ratio(&self) -> Option<f64> {
        let (theirs, _) = (self.by(By::Rapier)?.value, self.first.floor?);
        let ratios: Vec<f64> = self.ours().map(|ours| ours / theirs).collect();
        // Of what fell, and of nothing over nothing, there is none.
        if ratios.iter().all(|ratio| ratio.is_finite()) { ratios.into_iter().reduce(f64::max) } else { None }
    }

    fn verdict(&self) -> &'static str {
        if self.lines.iter().any(|line| line.held.is_some()) {
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
        let within = |limit: f64| self.ours().all(|ours| ours <= limit);
        match () {
            () if self.ours().any(f64::is_nan) => "**falls**",
            () if theirs.is_nan() => "rapier's falls",
            () if within(0.1 * theirs) => "a tenth",
            () if within(floor) => "none",
            () if within(theirs) => "better",
            () if within((1.1 * theirs).max(theirs + floor)) => "no worse",
            () => "**worse**",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(asked: Option<bool>, floor: Option<f64>, values: &[(By, f64)]) -> Row {
        let line = |&(by, value): &(By, f64)| Line {
            case: "case".into(),
            quantity: "quantity".into(),
            unit: "mm".into(),
            by,
            substeps: 8,
            value,
            exact: None,
            asked: String::new(),
            held: asked.filter(|_| by != By::Rapier),
            floor,
        };
        let lines: Vec<_> = values.iter().map(line).collect();
        Row { section: 'A', first: lines[0].clone(), lines }
    }

    /// Oracle: the rules that the table's lead tells.
    #[test]
    fn verdicts_follow_their_rules() {
        let beside = |cpu: f64, gpu: f64, rapier: f64| {
            let row = row(None, Some(0.1), &[(By::Cpu, cpu), (By::Gpu, gpu), (By::Rapier, rapier)]);
            (row.verdict(), row.ratio())
        };
        assert_eq!(beside(1.0, 0.5, 10.0), ("a tenth", Some(0.1)));
        assert_eq!(beside(0.05, 0.1, 0.01), ("none", Some(10.0)));
        assert_eq!(beside(1.0, 5.0, 10.0), ("better", Some(0.5)));
        assert_eq!(beside(10.0, 11.0, 10.0), ("no worse", Some(1.1)));
        assert_eq!(beside(0.2, 0.25, 0.15), ("no worse", Some(0.25 / 0.15)));
        assert_eq!(beside(1.0, 11.5, 10.0), ("**worse**", Some(1.15)));
        assert_eq!(beside(1.0, f64::NAN, 10.0), ("**falls**", None));
        assert_eq!(beside(1.0, 1.0, f64::NAN), ("rapier's falls", None));
        assert_eq!(beside(0.0, 0.0, 0.0), ("a tenth", None));
        assert_eq!(row(Some(true), None, &[(By::Cpu, 1.0), (By::Rapier, 9.0)]).verdict(), "held");
        assert_eq!(row(Some(false), None, &[(By::Gpu, 1.0)]).verdict(), "**missed on the GPU**");
        assert_eq!(row(None, None, &[(By::Cpu, 1.0)]).verdict(), "told");
    }
}
