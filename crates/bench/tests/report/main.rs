//! The report: its numbers against formulas, tables that no run should leave, and its page in a real browser.

mod browser;
mod hostile;
mod numbers;
mod sample;

use std::path::{Path, PathBuf};
use tumble_bench::{record, report};

/// Writes table and report of the sample, and gives their paths.
fn sample_in(folder: &Path) -> Vec<PathBuf> {
    let records = sample::table();
    let table = folder.join("speed_vs_error.csv");
    record::write(&table, &records).unwrap();
    let records = record::read(&table).unwrap();
    report::write(&records, folder, "speed_vs_error").unwrap()
}

/// Left in target/tmp for whoever wants to look at it.
#[test]
fn the_same_records_give_the_same_bytes() {
    let one = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report");
    let two = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(one.join("speed_vs_error")).unwrap();
    let stale = one.join("speed_vs_error").join("of-an-earlier-run.svg");
    std::fs::write(&stale, "").unwrap();
    let (first, second) = (sample_in(&one), sample_in(two.path()));
    assert!(!stale.exists(), "a picture of an earlier report is left");
    assert_eq!(first.len(), second.len());
    for (a, b) in first.iter().zip(&second) {
        assert_eq!(a.file_name(), b.file_name());
        let (left, right) = (std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
        assert!(left == right, "{} differs", a.display());
        assert!(left.len() > 1000, "{} is all but empty", a.display());
    }
    // Beside the table the two texts, in the folder the pictures, each as SVG and as PNG.
    let ends = |end: &str| first.iter().filter(|p| p.extension().is_some_and(|e| e == end)).count();
    let in_folder = first.iter().filter(|p| p.parent().unwrap().ends_with("speed_vs_error")).count();
    assert_eq!((ends("md"), ends("html")), (1, 1));
    assert!(ends("svg") > 10 && ends("svg") == ends("png") && in_folder == 2 * ends("svg"));
    let overview = first.iter().find(|p| p.ends_with("speed_vs_error/overview.png")).unwrap();
    // Width and height of a PNG, in its head.
    let head = std::fs::read(overview).unwrap();
    assert_eq!(&head[16..24], [0, 0, 4, 176, 0, 0, 3, 32], "1200 by 800");
}
