//! The report: its numbers against formulas, and its page in a real browser.

mod sample;

use std::path::Path;

#[test]
fn a_run_becomes_files() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report");
    std::fs::create_dir_all(&folder).unwrap();
    let records = sample::table();
    tumble_bench::record::write(&folder.join("speed_vs_error.csv"), &records).unwrap();
    let paths = tumble_bench::report::write(&records, &sample::differs(), &folder, "speed_vs_error").unwrap();
    println!("{paths:#?}");
}
