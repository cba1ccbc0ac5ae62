//! The report as Markdown.

use super::document::{Block, Cells, Document, Table};
use super::text::markdown as escape;
use std::fmt::Write;

pub(crate) fn render(document: &Document) -> String {
    let mut out = format!("# {}\n\n{}\n", escape(&document.title), escape(&document.lead));
    for section in &document.sections {
        let marks = if section.sub { "###" } else { "##" };
        let _ = write!(out, "\n{marks} {}\n", escape(&section.title));
        for block in &section.blocks {
            out.push('\n');
            match block {
                Block::Text(text) => out.push_str(&format!("{}\n", escape(text))),
                Block::List(items) => items.iter().for_each(|i| out.push_str(&format!("- {}\n", escape(i)))),
                Block::Table(rows) => table(&mut out, rows),
                Block::Figures(figures) => {
                    for figure in figures {
                        let _ = writeln!(out, "![{}]({}.svg)", escape(&figure.alt), figure.stem);
                    }
                }
                Block::Links(links) => {
                    let all: Vec<String> = links.iter().map(|(l, path)| format!("[{}]({path})", escape(l))).collect();
                    let _ = writeln!(out, "{}", all.join(" · "));
                }
            }
        }
    }
    out
}

fn table(out: &mut String, table: &Table) {
    let _ = writeln!(out, "{}\n", escape(&table.caption));
    let head: Vec<String> = table.head.iter().map(|c| escape(&c.name)).collect();
    let rule: Vec<&str> = table.head.iter().map(|c| if c.kind == Cells::Numbers { "---:" } else { "---" }).collect();
    let _ = writeln!(out, "| {} |\n|{}|", head.join(" | "), rule.join("|"));
    for row in &table.rows {
        let cells: Vec<String> = row.iter().map(|cell| escape(cell)).collect();
        let _ = writeln!(out, "| {} |", cells.join(" | "));
    }
}
