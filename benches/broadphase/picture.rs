//! Two pictures side by side: time against count, and against the ratio of sizes. Both axes are logarithmic.

use crate::Row;

const WIDTH: f64 = 420.0;
const HEIGHT: f64 = 360.0;
const LEFT: f64 = 60.0;
const TOP: f64 = 50.0;
const COLORS: [(&str, &str); 9] = [
    ("brute force", "#8c564b"),
    ("grid, list", "#1f77b4"),
    ("grid, tree", "#17becf"),
    ("sliced, list", "#9467bd"),
    ("sliced, tree", "#c5b0d5"),
    ("lbvh", "#2ca02c"),
    ("sweep", "#bcbd22"),
    ("parry bvh", "#ff7f0e"),
    ("rapier, first update", "#d62728"),
];

/// One panel.
struct Panel<'a> {
    title: &'a str,
    left: f64,
    x: [f64; 2],
    y: [f64; 2],
}

impl Panel<'_> {
    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let share = |value: f64, [low, high]: [f64; 2]| (value / low).ln() / (high / low).ln();
        (self.left + WIDTH * share(x, self.x), TOP + HEIGHT * (1.0 - share(y, self.y)))
    }

    fn draw(&self, points: &[(f64, &Row)]) -> String {
        let (left, bottom) = (self.left, TOP + HEIGHT);
        let mut text = format!(
            "<text x=\"{left}\" y=\"{}\" font-weight=\"bold\">{}</text>\n<rect x=\"{left}\" y=\"{TOP}\" width=\"{WIDTH}\" \
             height=\"{HEIGHT}\" fill=\"none\" stroke=\"#888\"/>\n",
            TOP - 14.0,
            self.title
        );
        for x in decades(self.x) {
            let (at, _) = self.at(x, self.y[0]);
            text += &format!("<path d=\"M{at:.1} {TOP}V{bottom}\" stroke=\"#ddd\"/>\n");
            text += &format!("<text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{x}</text>\n", bottom + 18.0);
        }
        for y in decades(self.y) {
            let (_, at) = self.at(self.x[0], y);
            text += &format!("<path d=\"M{left} {at:.1}h{WIDTH}\" stroke=\"#ddd\"/>\n");
            text += &format!("<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{y} ms</text>\n", left - 6.0, at + 4.0);
        }
        for (what, color) in COLORS {
            let line: Vec<_> = points.iter().filter(|(_, row)| row.what == what).collect();
            let path: Vec<String> =
                line.iter().map(|(x, row)| self.at(*x, row.total)).map(|(x, y)| format!("{x:.1} {y:.1}")).collect();
            text += &format!("<path d=\"M{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>\n", path.join("L"));
        }
        text
    }
}

fn decades([low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
    (-6..9).map(|power| 10f64.powi(power)).filter(move |x| (low * 0.999..=high * 1.001).contains(x))
}

/// Lowest and highest of some numbers, with room.
fn range(values: impl Iterator<Item = f64> + Clone, room: f64) -> [f64; 2] {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    [low / room, values.fold(0.0, f64::max).max(low * 1.1) * room]
}

/// Build and pairs of fresh runs.
pub(crate) fn svg(rows: &[Row]) -> String {
    let by_count: Vec<_> =
        rows.iter().filter(|row| row.crowd == "uniform").map(|row| (row.count as f64, row)).collect();
    let most = rows.iter().filter(|row| row.crowd == "1:3").map(|row| row.count).max();
    let ratio = |row: &Row| row.crowd.strip_prefix("1:").and_then(|ratio| ratio.parse().ok());
    let by_ratio: Vec<_> =
        rows.iter().filter(|row| Some(row.count) == most).filter_map(|row| Some((ratio(row)?, row))).collect();
    let width = 2.0 * (WIDTH + LEFT) + 200.0;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        TOP + HEIGHT + 40.0
    );
    let ratios = format!("Build and pairs against size ratio, {} bodies", most.unwrap_or(0));
    let panels = [("Build and pairs against bodies, uniform", LEFT, by_count), (&ratios, 2.0 * LEFT + WIDTH, by_ratio)];
    for (title, left, points) in panels {
        if !points.is_empty() {
            let x = range(points.iter().map(|p| p.0), 1.0);
            let y = range(points.iter().map(|p| p.1.total), 1.2);
            text += &Panel { title, left, x, y }.draw(&points);
        }
    }
    for (i, (what, color)) in COLORS.into_iter().enumerate() {
        let (x, y) = (2.0 * (WIDTH + LEFT) + 20.0, TOP + 20.0 + 20.0 * i as f64);
        text += &format!("<path d=\"M{x} {y}h24\" stroke=\"{color}\" stroke-width=\"3\"/>\n");
        text += &format!("<text x=\"{}\" y=\"{}\">{what}</text>\n", x + 32.0, y + 4.0);
    }
    text + "</svg>\n"
}
