//! What a run ran on.

use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

/// Machine, commit and day of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Machine {
    /// Processor, cores and system.
    pub name: String,
    /// Commit of tumble, with `+` behind it where files were changed.
    pub commit: String,
    /// As 2026-11-22, in UTC.
    pub date: String,
}

impl Machine {
    /// This one. The commit is that of the working directory; where there is none, as on a machine without the sources,
    /// the variable `TUMBLE_COMMIT` tells it, and else it is `unknown`.
    pub fn this() -> Self {
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
        let name = format!("{}, {cores} cores, {} {}", processor(), std::env::consts::OS, std::env::consts::ARCH);
        let commit = commit().or_else(|| std::env::var("TUMBLE_COMMIT").ok()).unwrap_or_else(|| "unknown".into());
        let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |past| past.as_secs());
        Self { name, commit, date: date(seconds / 86_400) }
    }
}

fn processor() -> String {
    let told = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = told.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    line.map_or_else(|| "unnamed processor".into(), |(_, name)| name.trim().to_owned())
}

fn commit() -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let commit = git(&["rev-parse", "--short=10", "HEAD"])?;
    // What a run writes changes no code.
    let changed = git(&["status", "--porcelain", "--untracked-files=no", "--", ":!docs"])?;
    Some(if changed.is_empty() { commit } else { commit + "+" })
}

/// The day of the Gregorian calendar that is so many days after 1970-01-01; by years of 365.2425 days from March on,
/// so that the odd day of February is the last.
fn date(days: u64) -> String {
    let days = days + 719_468;
    let era = days / 146_097;
    let day_of_era = days % 146_097;
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let (month, carry) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    format!("{:04}-{month:02}-{day:02}", year_of_era + era * 400 + carry)
}

/// Bytes that the system can give without swapping, where it tells (Linux).
pub fn free_memory() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = told.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::date;

    /// Oracle: the calendar.
    #[test]
    fn dates_are_those_of_the_calendar() {
        let days = [(0, "1970-01-01"), (59, "1970-03-01"), (789, "1972-02-29"), (11_016, "2000-02-29")];
        for (day, expected) in days.into_iter().chain([(20_779, "2026-11-22"), (47_540, "2100-02-28")]) {
            assert_eq!(date(day), expected);
        }
        assert_eq!(date(47_541), "2100-03-01");
    }
}
