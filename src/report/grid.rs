//! Figure that shows the pictures of all shadow methods for one scene side by side. Method and settings are above
//! each picture, errors and costs below, and one colour bar is at the bottom.

use super::canvas::{Anchor, BLACK, Drawing, INK, Point, Rect, srgb_picture, text_width};
use super::heat::{bar_height, colour_bar, false_colour};
use super::number::significant;
use super::plot::shorten;
use crate::error::Result;
use crate::measure::table::Row;
use ndarray::{Array2, Array3};

/// Largest height of the figure of all methods' pictures, points, so that it fits on a page.
const MOST_HEIGHT: f64 = 650.0;
/// Smallest width of a column in the figure of all methods' pictures, points, so that settings stay readable.
const LEAST_CELL: f64 = 64.0;
/// Largest width of a column in the figure of all methods' pictures, points.
const MOST_CELL: f64 = 220.0;
/// Smallest factor by which the columns in the figure of all methods' pictures are narrowed to fit a page.
const MOST_NARROWED: f64 = 0.85;
/// Ratio of height to width above which a picture may be narrower than its column in the figure of all pictures.
const UPRIGHT: f64 = 1.2;
/// Largest height of an upright picture in the figure of all methods' pictures, points.
const MOST_HIGH: f64 = 0.4 * MOST_HEIGHT;
const MOST_ACROSS: usize = 7;
const GAP: f64 = 6.0;
/// Gap between a picture and the difference image below it in the figure of all methods' pictures, points.
const SEAM: f64 = 2.0;
const NAME: f64 = 8.5;
const TEXT: f64 = 7.0;
const LINE: f64 = 8.6;
/// Height of the colour bar without labels in the figure of all methods' pictures, points.
const BAR: f64 = 7.0;
const GREY: super::canvas::Rgb = [130, 130, 130];
/// Smallest and largest resolution of the figure of all methods' pictures as PNG, pixels per point of 1/72 inch.
const PIXELS_PER_POINT: [f64; 2] = [2.0, 4.0];
/// Largest number of pixels in the PNG file of the figure of all methods' pictures.
const MOST_PIXELS: f64 = 1e8;

/// Entry in the figure of all methods' pictures: the picture of one shadow method with its captions.
#[derive(Debug, Clone)]
pub struct GridCell<'a> {
    /// Name of the shadow method whose picture is shown in the figure of all methods' pictures.
    pub name: String,
    /// Settings of the shadow method, each as `key=value`.
    pub settings: Vec<String>,
    /// Times, memory and error of a shadow method, one text line each, printed below its picture in the figure.
    pub figures: Vec<String>,
    /// Pixels of the picture that a shadow method drew: `height x width x 4`, linear RGBA.
    pub picture: &'a Array3<f32>,
    /// Absolute difference of each pixel from the reference picture: `height x width`, not negative. `None` for the
    /// reference itself.
    pub difference: Option<&'a Array2<f32>>,
}

impl<'a> GridCell<'a> {
    /// Creates the entry of one comparison-table row in the figure of all methods' pictures.
    pub fn of(row: &Row, picture: &'a Array3<f32>, difference: Option<&'a Array2<f32>>) -> Self {
        let map = row.map.map(|map| format!("map={map}"));
        let settings =
            row.params.split(' ').filter(|s| !s.is_empty()).map(str::to_owned).chain(map).collect();
        let times = row.build_ms.zip(row.frame_ms);
        let figures = [
            times.map(|(build, frame)| format!("{} + {} ms", significant(build, 3), significant(frame, 3))),
            row.bytes.map(|bytes| format!("{} MiB", significant(bytes as f64 / f64::from(1 << 20), 3))),
            row.point_err_rms.map(|error| format!("rms error {}", significant(error, 3))),
        ];
        let figures = figures.into_iter().flatten().collect();
        Self { name: row.method.clone(), settings, figures, picture, difference }
    }

    /// Creates the entry of the reference picture (one shadow ray per sample) in the figure of all pictures.
    pub fn reference(picture: &'a Array3<f32>) -> Self {
        let settings = vec!["(not in the table)".into()];
        Self { name: "rays".into(), settings, figures: Vec::new(), picture, difference: None }
    }

    /// Settings of a shadow method as text lines of at most `width` points; lines are broken only between settings.
    fn lines(&self, width: f64) -> Vec<String> {
        wrapped(self.settings.iter().cloned(), ", ", width)
    }
}

/// Joins words or settings with a separator into text lines of at most `width` points.
fn wrapped(pieces: impl Iterator<Item = String>, separator: &str, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for piece in pieces {
        let longer = lines.last().map(|last| format!("{last}{separator}{piece}"));
        match (longer.filter(|longer| text_width(longer, TEXT) <= width), lines.last_mut()) {
            (Some(longer), Some(last)) => *last = longer,
            _ => lines.push(shorten(piece, TEXT, width)),
        }
    }
    lines
}

/// Draws the figure of all methods' pictures, `width` points wide, and returns it as PNG and PDF. In difference
/// images black is zero; their colour bar ends at `max` and has the title `label`.
///
/// # Errors
/// The figure cannot be drawn or encoded.
pub fn files(shown: &[GridCell], width: f64, max: f32, label: &str) -> Result<[Vec<u8>; 2]> {
    let (drawing, wide) = figure(shown, width, max, label);
    let widest = shown.iter().map(|s| s.picture.dim().1).max().unwrap_or(1) as f64;
    let png =
        super::canvas::encode_png(&drawing.bitmap_of(pixels_per_point(widest / wide, drawing.size()))?)?;
    Ok([png, drawing.pdf()?])
}

/// Resolution of the figure of all methods' pictures as PNG, pixels per point. `own` is the resolution at which every
/// picture keeps its pixels.
fn pixels_per_point(own: f64, [width, height]: [f64; 2]) -> f64 {
    let [least, most] = PIXELS_PER_POINT;
    own.clamp(least, most).min((MOST_PIXELS / (width * height)).sqrt())
}

/// Layout of the figure that shows the pictures of all shadow methods.
#[derive(Debug, Clone, PartialEq)]
struct Layout {
    width: f64,
    across: usize,
    cell: f64,
    /// Width and height of one picture in the figure of all methods' pictures, points.
    picture: [f64; 2],
    /// Number of text lines with settings above each row of pictures, in the figure of all methods' pictures.
    lines: Vec<usize>,
}

impl Layout {
    /// Layout with wide pictures and few empty places for the figure of all methods' pictures. If none fits on a
    /// page, the figure is higher than a page.
    fn of(shown: &[GridCell], width: f64) -> Self {
        let all = 1..=shown.len().clamp(1, MOST_ACROSS);
        let all = all.filter_map(|across| Self::across(shown, width, across));
        let worth = |layout: &Self| {
            layout.picture[0] * shown.len() as f64 / (layout.across * layout.lines.len().max(1)) as f64
        };
        let best = all.reduce(|a, b| if worth(&b) > worth(&a) { b } else { a });
        best.unwrap_or_else(|| {
            let most = ((width + GAP) / (LEAST_CELL + GAP)).floor().clamp(1.0, MOST_ACROSS as f64) as usize;
            let across = shown.len().clamp(1, most);
            let (cell, shape) = (column(width, across), shape(shown));
            let high = if shape > UPRIGHT { (cell * shape).min(2.0 * LEAST_CELL) } else { cell * shape };
            let picture = [cell.min(high / shape), high];
            Self { width, across, cell, picture, lines: lines(shown, across, cell) }
        })
    }

    /// Layout of the figure of all methods' pictures with `across` pictures per row; `None` if it cannot fit on a
    /// page with readable pictures.
    fn across(shown: &[GridCell], width: f64, across: usize) -> Option<Self> {
        let (column, shape) = (column(width, across), shape(shown));
        let upright = shape > UPRIGHT;
        let (mut cell, mut high) =
            (column, if upright { (column * shape).min(MOST_HIGH) } else { column * shape });
        // Narrower columns may need more lines of settings.
        for _ in 0..8 {
            if cell < LEAST_CELL.max(MOST_NARROWED * column) || upright && high < LEAST_CELL {
                break;
            }
            let picture = [cell.min(high / shape), high];
            let layout = Self { width, across, cell, picture, lines: lines(shown, across, cell) };
            let (height, rows) = (layout.height(shown), layout.lines.len() as f64);
            if height <= MOST_HEIGHT {
                return Some(layout);
            }
            let over = (height - MOST_HEIGHT) / (2.0 * rows);
            if upright {
                high -= over + 0.01;
            } else {
                cell -= over / shape.max(1e-3) + 0.01;
                high = cell * shape;
            }
        }
        None
    }

    /// Height of the captions above one row of pictures in the figure of all methods' pictures, points.
    fn above(&self, row: usize) -> f64 {
        NAME + 3.0 + LINE * self.lines[row] as f64
    }

    /// Height of one row in the figure of all methods' pictures, points: captions, pictures, difference images, text
    /// lines below them, and the gap to the next row.
    fn row_height(&self, shown: &[GridCell], row: usize) -> f64 {
        let figures = shown.iter().map(|s| s.figures.len()).max().unwrap_or(0) as f64;
        self.above(row) + 2.0 * self.picture[1] + SEAM + 2.0 + LINE * figures + GAP
    }

    fn height(&self, shown: &[GridCell]) -> f64 {
        let rows: f64 = (0..self.lines.len()).map(|row| self.row_height(shown, row)).sum();
        rows + bar_height(BAR, TEXT) + LINE * explanation(shown, self.width).len() as f64 + 0.4 * LINE
    }
}

/// Width of a column in the figure of all methods' pictures, points. `width` is that of the whole figure.
fn column(width: f64, across: usize) -> f64 {
    ((width - GAP * (across - 1) as f64) / across as f64).min(MOST_CELL)
}

/// Ratio of height to width of the pictures in the figure of all methods' pictures.
fn shape(shown: &[GridCell]) -> f64 {
    let dims = shown.first().map_or((1, 1), |s| (s.picture.dim().0, s.picture.dim().1));
    dims.0 as f64 / dims.1.max(1) as f64
}

fn lines(shown: &[GridCell], across: usize, cell: f64) -> Vec<usize> {
    let most = |row: &[GridCell]| row.iter().map(|s| s.lines(cell).len()).max().unwrap_or(0);
    shown.chunks(across).map(most).collect()
}

/// Text lines of the legend that explains times, memory and errors in the figure of all methods' pictures; empty if
/// the figure has none of these.
fn explanation(shown: &[GridCell], width: f64) -> Vec<String> {
    if shown.iter().all(|s| s.figures.is_empty()) {
        return Vec::new();
    }
    let words = "Below each: time to build its shadows + to draw, memory of its shadows, error of transmittance where the \
                 camera looks.";
    wrapped(words.split(' ').map(str::to_owned), " ", width)
}

/// Draws the figure of all methods' pictures. Returns the drawing and the width of one picture in points.
fn figure(shown: &[GridCell], width: f64, max: f32, label: &str) -> (Drawing, f64) {
    let layout = Layout::of(shown, width);
    let (cell, picture) = (layout.cell, layout.picture);
    let mut drawing = Drawing::new(width, layout.height(shown).ceil());
    let used = layout.across as f64 * (cell + GAP) - GAP;
    let mut top = 0.0;
    for (row, cells) in shown.chunks(layout.across).enumerate() {
        let above = layout.above(row);
        for (i, s) in cells.iter().enumerate() {
            let left = 0.5 * (width - used) + i as f64 * (cell + GAP);
            put(&mut drawing, s, Point(left, top), [cell, above], picture, max);
        }
        top += layout.row_height(shown, row);
    }
    // The numbers below the colour bar extend beyond its ends.
    let half = 0.5 * used.max(200.0).min(width) - 16.0;
    let bar = Rect { left: 0.5 * width - half, top, right: 0.5 * width + half, bottom: top + BAR };
    colour_bar(&mut drawing, bar, max, &shorten(label.into(), TEXT, width), TEXT);
    for (i, line) in explanation(shown, width).iter().enumerate() {
        let place = Point(0.5 * width, top + bar_height(BAR, TEXT) + (i as f64 + 0.7) * LINE);
        drawing.text(place, Anchor::Middle, TEXT, INK, line);
    }
    (drawing, picture[0])
}

/// Draws one entry in the figure of all methods' pictures: captions, picture, difference image, text lines. `cell` is
/// the column width, `above` the height of the captions, `wide` and `high` the size of the picture.
fn put(
    drawing: &mut Drawing,
    s: &GridCell,
    Point(left, top): Point,
    [cell, above]: [f64; 2],
    [wide, high]: [f64; 2],
    max: f32,
) {
    let name = shorten(s.name.clone(), NAME, cell);
    drawing.text(Point(left, top + 0.5 * NAME), Anchor::Start, NAME, BLACK, &name);
    for (i, line) in s.lines(cell).iter().enumerate() {
        let place = Point(left, top + NAME + 1.0 + (i as f64 + 0.5) * LINE);
        drawing.text(place, Anchor::Start, TEXT, INK, line);
    }
    let place = |top: f64| Rect { left, top, right: left + wide, bottom: top + high };
    let (upper, lower) = (place(top + above), place(top + above + high + SEAM));
    drawing.picture(upper, srgb_picture(s.picture));
    match s.difference {
        Some(difference) => drawing.picture(lower, false_colour(difference, max)),
        None if high < LINE => {}
        None => {
            let word = "reference";
            let half = 0.5 * wide.max(text_width(word, TEXT));
            let middle = Point(left + half, 0.5 * (lower.top + lower.bottom));
            drawing.text(middle, Anchor::Middle, TEXT, GREY, word);
        }
    }
    for (i, figure) in s.figures.iter().enumerate() {
        let place = Point(left, lower.bottom + 2.0 + (i as f64 + 0.5) * LINE);
        drawing.text(place, Anchor::Start, TEXT, INK, &shorten(figure.clone(), TEXT, cell));
    }
}

#[cfg(test)]
mod tests {
    use super::super::heat::inferno;
    use super::*;
    use image::Rgb;

    const WIDTH: f64 = 455.0;

    fn shown<'a>(picture: &'a Array3<f32>, settings: &[&str]) -> GridCell<'a> {
        let row = Row {
            method: "dsm".into(),
            params: settings.join(" "),
            map: Some(512),
            build_ms: Some(1234.5),
            frame_ms: Some(67.89),
            bytes: Some(3 << 19),
            point_err_rms: Some(0.012_345),
            ..Row::default()
        };
        GridCell::of(&row, picture, None)
    }

    #[test]
    fn grid_cells_show_times_memory_and_error() {
        let picture = Array3::zeros((2, 2, 4));
        let s = shown(&picture, &["epsilon=0.06"]);
        assert_eq!((s.name.as_str(), s.settings), ("dsm", vec!["epsilon=0.06".to_owned(), "map=512".into()]));
        assert_eq!(s.figures, ["1234 + 67.9 ms", "1.50 MiB", "rms error 0.0123"]);
        let none = Row { method: "none".into(), ..Row::default() };
        assert!(GridCell::of(&none, &picture, None).settings.is_empty());
    }

    #[test]
    fn settings_are_broken_between_each_other() {
        let picture = Array3::zeros((2, 2, 4));
        let s = shown(&picture, &["epsilon=0.06", "prefilter=5", "lookup=each"]);
        assert_eq!(s.lines(400.0), ["epsilon=0.06, prefilter=5, lookup=each, map=512"]);
        let broken = s.lines(75.0);
        assert!(broken.len() > 1 && broken.iter().all(|l| text_width(l, TEXT) <= 75.0), "{broken:?}");
        assert_eq!(broken.join(", "), s.lines(400.0)[0]);
    }

    #[test]
    fn pictures_fill_a_page_and_few_places_stay_empty() {
        let (square, low) = (Array3::zeros((300, 300, 4)), Array3::zeros((100, 400, 4)));
        let layout = |picture, count| Layout::of(&vec![shown(picture, &["epsilon=0.06"]); count], WIDTH);
        let across = |picture, count| layout(picture, count).across;
        assert_eq!([1, 2, 3, 4, 5, 8].map(|n| across(&square, n)), [1, 2, 3, 4, 5, 4]);
        assert_eq!([9, 10, 12].map(|n| across(&square, n)), [5, 5, 6]);
        // Low pictures are fewer a row, and wider.
        assert!(across(&low, 9) <= 3);
        for count in 1..=14 {
            let layout = layout(&square, count);
            let all = vec![shown(&square, &["epsilon=0.06"]); count];
            assert!(layout.cell >= LEAST_CELL && layout.height(&all) <= MOST_HEIGHT, "{count}: {layout:?}");
            assert!(layout.across as f64 * (layout.cell + GAP) - GAP <= WIDTH + 1e-9);
        }
        // More than a page holds, and a column of two, a narrow one and a poster.
        let many = layout(&square, 40);
        assert!(many.cell >= LEAST_CELL && many.lines.len() == 40_usize.div_ceil(many.across));
        let all = vec![shown(&square, &["epsilon=0.06"]); 4];
        let across = [100.0, 220.0, 5000.0].map(|width| Layout::of(&all, width).across);
        assert_eq!(across, [1, 2, 4]);
        assert!(explanation(&all, WIDTH).len() == 1 && explanation(&all, 220.0).len() == 2);
        assert!(explanation(&all, 100.0).iter().all(|line| text_width(line, TEXT) <= 100.0));
    }

    #[test]
    fn each_picture_has_its_difference_below_on_the_one_scale() {
        let picture = |grey: f32| Array3::from_elem((60, 80, 4), grey);
        let (dark, bright) = (picture(0.0), picture(1.0));
        let (half, full) = (Array2::from_elem((60, 80), 0.05), Array2::from_elem((60, 80), 0.1));
        let of = |name: &str, picture, difference| GridCell {
            name: name.into(),
            settings: vec!["map=256".into()],
            figures: vec!["1 MiB".into()],
            picture,
            difference,
        };
        let all =
            [GridCell::reference(&bright), of("osm", &dark, Some(&half)), of("dom", &dark, Some(&full))];
        let layout = Layout::of(&all, WIDTH);
        let (drawing, cell) = figure(&all, WIDTH, 0.1, "how wrong");
        assert_eq!((layout.across, cell), (3, column(WIDTH, 3)));
        let page = drawing.bitmap_of(2.0).unwrap();
        let (above, high) = (layout.above(0), 0.75 * cell);
        let at = |i: usize, down: f64| {
            let (x, y) = (i as f64 * (cell + GAP) + 0.2 * cell, above + down);
            *page.get_pixel((2.0 * x) as u32, (2.0 * y) as u32)
        };
        let [white, black] = [Rgb([255; 3]), Rgb([0; 3])];
        assert_eq!([0, 1, 2].map(|i| at(i, 0.5 * high)), [white, black, black]);
        let lower = [0, 1, 2].map(|i| at(i, 1.5 * high + SEAM));
        assert_eq!(lower, [white, inferno(0.5), inferno(1.0)], "the reference has no difference");
        let svg = drawing.svg(None).into_string();
        for text in
            ["rays", "(not in the table)", "reference", "osm", "map=256", "1 MiB", "how wrong", "≥ 0.1"]
        {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn the_pdf_has_every_pixel_and_text_as_text() {
        let picture = Array3::from_shape_fn((300, 301, 4), |(j, i, c)| (i * j * (c + 1)) as f32 / 3e5);
        let difference = Array2::from_elem((300, 301), 0.01);
        let all = [
            GridCell { difference: None, ..shown(&picture, &[]) },
            GridCell { difference: Some(&difference), ..shown(&picture, &["epsilon=0.06"]) },
        ];
        let [png, pdf] = files(&all, WIDTH, 0.02, "difference").unwrap();
        assert!(image::load_from_memory(&png).unwrap().width() >= 2 * 455);
        let text = String::from_utf8_lossy(&pdf);
        assert!(
            pdf.starts_with(b"%PDF") && text.contains("/MediaBox [0 0 455 "),
            "the page is 455 points wide"
        );
        let count = |part: &str| text.matches(part).count();
        assert_eq!((count("/Subtype /Image"), count("/Width 301"), count("/Height 300")), (3, 3, 3));
        assert!(count("/FontFile") >= 1 && count("/ToUnicode") >= 1, "letters are of a font");
        assert!(files(&[], WIDTH, 1.0, "").is_ok());
    }

    #[test]
    fn pictures_of_any_shape_are_shown_on_a_page() {
        for (height, width) in [(4096, 1), (1, 4096), (600, 20), (60, 20), (150, 100), (120, 100)] {
            let picture = Array3::zeros((height, width, 4));
            let difference = Array2::zeros((height, width));
            for count in [1, 3, 8] {
                let one = GridCell { difference: Some(&difference), ..shown(&picture, &["epsilon=0.06"]) };
                let all: Vec<_> = std::iter::once(GridCell::reference(&picture))
                    .chain(std::iter::repeat_n(one, count))
                    .collect();
                let layout = Layout::of(&all, WIDTH);
                let [wide, high] = layout.picture;
                assert!(layout.height(&all) <= MOST_HEIGHT, "{count} of {height} x {width}: {layout:?}");
                assert!(
                    wide <= layout.cell + 1e-9
                        && (high / wide * width as f64 / height as f64 - 1.0).abs() < 1e-9
                );
                let [png, _] = files(&all, WIDTH, 0.02, "difference").unwrap();
                assert!(image::load_from_memory(&png).unwrap().height() <= 4 * MOST_HEIGHT as u32);
            }
        }
    }

    #[test]
    fn a_reference_is_named_where_there_is_room() {
        let svg = |height, width| {
            let picture = Array3::zeros((height, width, 4));
            let all = [GridCell::reference(&picture), shown(&picture, &[])];
            figure(&all, WIDTH, 0.1, "").0.svg(None).into_string()
        };
        assert!(svg(40, 40).contains("reference") && !svg(2, 600).contains("reference"));
        // Beside a narrow one it begins where that begins, and is whole.
        let page = svg(600, 8);
        let tag = &page[..page.find("reference").unwrap()];
        let x: f64 = tag[tag.rfind(" x=\"").unwrap() + 4..].split('"').next().unwrap().parse().unwrap();
        assert!(x - 0.5 * text_width("reference", TEXT) >= -1e-9, "{x}");
    }

    #[test]
    fn a_page_of_very_many_has_fewer_pixels_a_point() {
        assert_eq!([0.1, 3.0, 9.0].map(|own| pixels_per_point(own, [455.0, 650.0])), [2.0, 3.0, 4.0]);
        let bound = pixels_per_point(9.0, [455.0, 50_000.0]);
        assert!((bound * bound * 455.0 * 50_000.0 / MOST_PIXELS - 1.0).abs() < 1e-9 && bound < 4.0);
    }
}
