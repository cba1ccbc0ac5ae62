//! The report as one page that needs nothing else: pictures and style are within it.

use super::document::{Block, Cells, Document, Figure, Table};
use super::text::html as escape;
use std::fmt::Write;

const PAGE: &str = include_str!("page.html");
/// Letters that a cell of words may have on one line.
const LONG: usize = 32;
const STYLE: &str = include_str!("page.css");

pub(crate) fn render(document: &Document) -> String {
    let mut body = String::new();
    let mut open = false;
    for section in &document.sections {
        if !section.sub {
            body.push_str(if open { "</section>\n" } else { "" });
            open = true;
            let _ = writeln!(body, "<section aria-labelledby=\"{}\">", escape(&section.id));
        }
        let level = if section.sub { 3 } else { 2 };
        let id = escape(&section.id);
        let _ = writeln!(body, "<h{level} id=\"{id}\"><a href=\"#{id}\">{}</a></h{level}>", escape(&section.title));
        section.blocks.iter().for_each(|b| block(&mut body, b));
    }
    body.push_str(if open { "</section>\n" } else { "" });
    // The page's parts go in by one pass, so that no text of the table is taken for a part.
    let mut page = String::new();
    let mut rest = PAGE;
    while let Some((before, (name, after))) = rest.split_once("{{").and_then(|(b, r)| Some((b, r.split_once("}}")?))) {
        page.push_str(before);
        match name {
            "title" => page.push_str(&escape(&document.title)),
            "lead" => page.push_str(&escape(&document.lead)),
            "style" => page.push_str(STYLE),
            "contents" => contents(&mut page, document),
            _ => page.push_str(&body),
        }
        rest = after;
    }
    page + rest
}

fn contents(out: &mut String, document: &Document) {
    out.push_str("<ol>\n");
    let mut sections = document.sections.iter().peekable();
    while let Some(section) = sections.next() {
        let _ = write!(out, "<li><a href=\"#{}\">{}</a>", escape(&section.id), escape(&section.title));
        if sections.peek().is_some_and(|next| next.sub) {
            out.push_str("\n<ul>\n");
            while let Some(sub) = sections.next_if(|next| next.sub) {
                let _ = writeln!(out, "<li><a href=\"#{}\">{}</a></li>", escape(&sub.id), escape(&sub.title));
            }
            out.push_str("</ul>\n");
        }
        out.push_str("</li>\n");
    }
    out.push_str("</ol>\n");
}

fn block(out: &mut String, block: &Block) {
    match block {
        Block::Text(text) => out.push_str(&format!("<p>{}</p>\n", escape(text))),
        Block::List(items) => {
            out.push_str("<ul>\n");
            items.iter().for_each(|i| out.push_str(&format!("<li>{}</li>\n", escape(i))));
            out.push_str("</ul>\n");
        }
        Block::Table(rows) => table(out, rows),
        Block::Figures(figures) => {
            out.push_str("<div class=\"figures\">\n");
            figures.iter().for_each(|f| figure(out, f));
            out.push_str("</div>\n");
        }
        Block::Links(links) => {
            let all: Vec<String> =
                links.iter().map(|(l, path)| format!("<a href=\"{}\">{}</a>", escape(path), escape(l))).collect();
            let _ = writeln!(out, "<p class=\"links\">{}</p>", all.join(" · "));
        }
    }
}

fn table(out: &mut String, table: &Table) {
    let caption = escape(&table.caption);
    // What scrolls must be reachable by the keyboard, and so needs a name.
    let _ = writeln!(
        out,
        "<p class=\"caption\">{caption}</p>\n<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{caption}\">\n\
         <table>\n<thead><tr>"
    );
    let class = |kind: Cells| match kind {
        Cells::Words => "",
        Cells::Numbers => " class=\"number\"",
        Cells::Prose => " class=\"prose\"",
    };
    for column in &table.head {
        let _ = write!(out, "<th scope=\"col\"{}>{}</th>", class(column.kind), escape(&column.name));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for row in &table.rows {
        out.push_str("<tr>");
        for (cell, column) in row.iter().zip(&table.head) {
            // Words are few as a rule; where they are not, they may take several lines.
            let long = column.kind == Cells::Words && cell.chars().count() > LONG;
            let kind = if long { Cells::Prose } else { column.kind };
            let _ = write!(out, "<td{}>{}</td>", class(kind), escape(cell));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody>\n</table>\n</div>\n");
}

/// The SVG without a size of its own, so that the page's style sets it, and with a name.
fn inline(svg: &str, class: &str, alt: &str) -> String {
    let (head, rest) = svg.split_once('>').unwrap_or((svg, ""));
    let view = head.split("viewBox=\"").nth(1).and_then(|v| v.split('"').next()).unwrap_or("0 0 1 1");
    format!("<svg class=\"{class}\" role=\"img\" aria-label=\"{}\" viewBox=\"{view}\">{rest}", escape(alt))
}

fn figure(out: &mut String, figure: &Figure) {
    let _ = write!(
        out,
        "<figure>\n{}{}<figcaption><a href=\"{stem}.svg\">SVG</a> · <a href=\"{stem}.png\">PNG</a></figcaption>\n</figure>\n",
        inline(&figure.wide, "wide", &figure.alt),
        inline(&figure.narrow, "narrow", &figure.alt),
        stem = escape(&figure.stem),
    );
}
