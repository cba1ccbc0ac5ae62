//! Makes `hard_cases.csv` and `hard_cases.md` of what the tests left: `hard_cases FOLDER OUT`. See `scripts/hard_cases.sh`.

use std::path::Path;

const CLOSING: &str = include_str!("hard_cases.md");

fn main() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, out] = arguments.as_slice() else { return Err("usage: hard_cases FOLDER OUT".into()) };
    tumble_bench::hard_cases::merge(Path::new(folder), Path::new(out), CLOSING)
}
