//! The report as data, before it is Markdown or a page.

/// The whole.
pub(crate) struct Document {
    pub(crate) title: String,
    pub(crate) lead: String,
    pub(crate) sections: Vec<Section>,
}

/// A heading with what stands under it.
pub(crate) struct Section {
    /// Anchor, unique in the document.
    pub(crate) id: String,
    pub(crate) title: String,
    /// Whether it is part of the section before it.
    pub(crate) sub: bool,
    pub(crate) blocks: Vec<Block>,
}

pub(crate) enum Block {
    Text(String),
    List(Vec<String>),
    Table(Table),
    Figures(Vec<Figure>),
    /// Label and relative path of files.
    Links(Vec<(String, String)>),
}

/// Cells are plain text; each renderer escapes them.
pub(crate) struct Table {
    pub(crate) caption: String,
    pub(crate) head: Vec<Column>,
    pub(crate) rows: Vec<Vec<String>>,
}

pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) kind: Cells,
}

/// How cells of a column are set.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cells {
    /// On one line.
    Words,
    /// On one line, to the right.
    Numbers,
    /// On as many lines as it takes.
    Prose,
}

/// A column of words.
pub(crate) fn words(name: impl Into<String>) -> Column {
    Column { name: name.into(), kind: Cells::Words }
}

/// A column of numbers.
pub(crate) fn numbers(name: impl Into<String>) -> Column {
    Column { name: name.into(), kind: Cells::Numbers }
}

/// A column of sentences.
pub(crate) fn prose(name: impl Into<String>) -> Column {
    Column { name: name.into(), kind: Cells::Prose }
}

/// A picture, and its files beside the report.
pub(crate) struct Figure {
    /// Path of the files without their ending, relative to the report.
    pub(crate) stem: String,
    /// What a person who cannot see it is told.
    pub(crate) alt: String,
    /// SVG for wide screens and for the file.
    pub(crate) wide: String,
    /// SVG for phones.
    pub(crate) narrow: String,
}
