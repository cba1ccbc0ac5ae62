//! The page in a real browser. Oracle: the browser's own layout.

use crate::sample;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::process::Command;
use tumble_bench::record;
use tumble_bench::report;

const CHECK: &str = include_str!("check.js");

/// What check.js found.
#[derive(Debug, Deserialize)]
struct Findings {
    width: u32,
    scroll: u32,
    errors: Vec<String>,
    broken: Vec<String>,
    wide: Vec<String>,
    empty: Vec<String>,
    small: Vec<String>,
    cut: Vec<String>,
    links: Vec<String>,
    outside: Vec<String>,
    hidden: Vec<String>,
    plots: usize,
    tables: usize,
}

fn browser() -> PathBuf {
    let names = ["chromium-headless-shell", "chromium", "google-chrome", "chrome"];
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path)
        .flat_map(|folder| names.map(|name| folder.join(name)))
        .find(|file| file.is_file())
        .unwrap_or_else(|| {
            panic!("no browser on PATH (looked for {names:?}); on Debian: apt-get install chromium-headless-shell")
        })
}

/// The page's text after its scripts, and what the browser wrote to its log.
fn load(page: &Path, width: u32, dark: bool) -> (String, String) {
    let profile = tempfile::tempdir().unwrap();
    let output = Command::new(browser())
        // A container has no sandbox to give; the page is our own.
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("--window-size={width},844"))
        .arg(format!("--blink-settings=preferredColorScheme={}", if dark { 0 } else { 1 }))
        .arg(format!("file://{}", page.display()))
        .output()
        .unwrap();
    let (dom, log) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "the browser ended with {}: {log}", output.status);
    (dom.into_owned(), log.into_owned())
}

/// Makes the report of these records, and a copy of its page with `script` at its end.
fn page(folder: &Path, records: &[record::Record], script: &str) -> PathBuf {
    record::write(&folder.join("speed_vs_error.csv"), records).unwrap();
    let files = report::write(records, folder, "speed_vs_error").unwrap();
    let html = std::fs::read_to_string(files.iter().find(|f| f.extension().is_some_and(|e| e == "html")).unwrap());
    let head =
        "<script>window.findings = []; addEventListener('error', e => findings.push(String(e.message)));</script>";
    let copy = html.unwrap().replacen("<head>", &format!("<head>{head}"), 1).replacen(
        "</body>",
        &format!("<script>{script}</script></body>"),
        1,
    );
    let path = folder.join("checked.html");
    std::fs::write(&path, copy).unwrap();
    path
}

fn findings(page: &Path, width: u32, dark: bool) -> Findings {
    let (dom, log) = load(page, width, dark);
    assert!(!log.contains(":CONSOLE"), "the console says: {log}");
    let json = dom.split("<pre id=\"findings\">").nth(1).and_then(|t| t.split("</pre>").next());
    let json = json.expect("the check left no findings").replace("&lt;", "<").replace("&gt;", ">");
    serde_json::from_str(&json.replace("&amp;", "&")).unwrap()
}

/// The check's own two scripts are the only ones.
const SCRIPTS: usize = 2;

#[test]
fn report_page_in_a_real_browser() {
    let folder = tempfile::tempdir().unwrap();
    let path = page(folder.path(), &sample::table(), CHECK);
    for (width, dark) in [(320, false), (390, true), (390, false), (768, false), (1440, true)] {
        let found = findings(&path, width, dark);
        assert_eq!(found.width, width);
        assert!(found.scroll <= width, "at {width} px the page is {} px wide: {:#?}", found.scroll, found.wide);
        let none: Vec<String> = Vec::new();
        assert_eq!(found.wide, none, "past the edge at {width} px");
        assert_eq!(found.errors, none);
        assert_eq!(found.broken, none, "anchors without their element");
        assert_eq!(found.empty, none, "pictures without a size at {width} px");
        assert_eq!(found.cut, none, "text past its picture at {width} px");
        assert_eq!(found.hidden, none, "each picture is there once, at {width} px");
        assert_eq!(found.outside.len(), SCRIPTS, "fetched from elsewhere: {:?}", found.outside);
        // On a phone, where nobody can step nearer.
        if width <= 390 {
            assert_eq!(found.small, none, "text below 12 px at {width} px");
        }
        assert!(found.plots > 10 && found.tables > 20, "{} plots, {} tables", found.plots, found.tables);
        assert!(found.links.len() > 2 * found.plots);
        for link in &found.links {
            assert!(folder.path().join(link).is_file(), "{link} leads nowhere");
        }
    }
}

/// Texts of a table that try to leave their cell.
#[test]
fn hostile_names_stay_text() {
    let folder = tempfile::tempdir().unwrap();
    let path = page(folder.path(), &crate::hostile::records(), CHECK);
    for width in [320, 1440] {
        let found = findings(&path, width, false);
        let none: Vec<String> = Vec::new();
        assert!(found.scroll <= width, "at {width} px the page is {} px wide: {:#?}", found.scroll, found.wide);
        assert_eq!((&found.errors, &found.broken, &found.wide, &found.cut), (&none, &none, &none, &none));
        assert_eq!(found.outside.len(), SCRIPTS, "{:?}", found.outside);
        for link in &found.links {
            assert!(folder.path().join(link).is_file(), "{link} leads nowhere");
        }
    }
}
