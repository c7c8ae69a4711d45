//! `report.html` in a headless browser, if one is installed: it opens without a network, shows plots and pictures,
//! and its table sorts.

use crate::browser::browser;
use crate::common::Requirement;
use ndarray::{Array2, arr2};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use umbravox::measure::table::Row;
use umbravox::report::html::{Conditions, Pictured, html};
use umbravox::shadow::NodeMap;

/// Time limit for the browser, long enough for a busy machine.
const PATIENCE: Duration = Duration::from_secs(180);

/// Returns the document after the browser has loaded it; `None` and a printed line if the browser cannot even show an
/// empty page.
fn dom(browser: &Path, page: &Path) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    let empty = folder.path().join("empty.html");
    std::fs::write(&empty, "<!DOCTYPE html><title>empty</title>").unwrap();
    dump(browser, &empty)?;
    Some(dump(browser, page).expect("the browser shows an empty page but not this one"))
}

fn dump(browser: &Path, page: &Path) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("dom.html");
    let mut child = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--dump-dom"])
        .args(["--no-first-run", "--disable-background-networking", "--window-size=1280,900"])
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("file://{}", page.display()))
        .stdin(Stdio::null())
        .stdout(std::fs::File::create(&out).unwrap())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > PATIENCE {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{} did not answer in {} s", browser.display(), PATIENCE.as_secs());
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    let text = std::fs::read_to_string(&out).unwrap();
    // A browser that cannot start (a stub of a package manager, a sandbox) counts as missing.
    if !status.success() && text.is_empty() {
        Requirement::Browser.missing(&format!("{} does not run here: {status}", browser.display()));
        return None;
    }
    Some(text)
}

/// Creates a report with four rows with a picture each, one with an error picture and one with curve nodes.
fn report() -> String {
    let mut png = Vec::new();
    let picture = image::RgbImage::from_fn(8, 8, |x, y| image::Rgb([x as u8 * 30, y as u8 * 30, 99]));
    let mut cursor = std::io::Cursor::new(&mut png);
    picture.write_to(&mut cursor, image::ImageFormat::Png).unwrap();
    let row = |method: &str, frame_ms: f64, error: Option<f64>| Row {
        scene: "slab <&> \"haze\"".into(),
        adapter: "test".into(),
        method: method.into(),
        bytes: Some(frame_ms as u64 * 1000),
        frame_ms: Some(frame_ms),
        fps_moving: Some(1000.0 / frame_ms),
        point_err_rms: error,
        ray_err_max: error,
        image_psnr: error.map(|e| if e == 0.0 { f64::INFINITY } else { -20.0 * e.log10() }),
        ..Row::default()
    };
    let rows = [
        row("none", 9.0, Some(0.5)),
        row("rays", 1000.0, Some(0.0)),
        row("dsm", 80.0, Some(0.001)),
        row("osm", 10.0, None),
    ];
    let mut pictured: Vec<Pictured> = rows
        .into_iter()
        .map(|row| Pictured { row, picture_png: Some(png.clone()), ..Pictured::default() })
        .collect();
    pictured[0].error_png = Some(png);
    pictured[1].row.note = "much to say ".repeat(20);
    pictured[2].nodes = Some(NodeMap { nodes: Array2::from_elem((16, 16), 3), stored: arr2(&[[true]]) });
    let conditions = Conditions { title: "A & B".into(), ..Conditions::default() };
    html(&conditions, &pictured).unwrap()
}

/// Opens a page with an additional script, and returns the resulting document.
fn open(page: &str, script: &str) -> Option<String> {
    let browser = browser()?;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    let more = format!("<script>{script}</script></body>");
    std::fs::write(&path, page.replace("</body>", &more)).unwrap();
    dom(&browser, &path)
}

fn attribute<'a>(dom: &'a str, name: &str) -> &'a str {
    let root = &dom[dom.find("<html").unwrap()..];
    let root = &root[..root.find('>').unwrap()];
    let key = format!(" {name}=\"");
    root.find(&key).map_or("", |at| root[at + key.len()..].split('"').next().unwrap())
}

#[test]
fn the_report_opens_and_shows_its_table_plots_and_pictures() {
    let Some(dom) = open(&report(), "") else { return };
    assert_eq!(attribute(&dom, "data-ready"), "yes");
    assert_eq!(attribute(&dom, "data-rows"), "4");
    // Two plots and a histogram; four pictures, an error and a map of tiles.
    assert_eq!(attribute(&dom, "data-plots"), "3");
    assert_eq!(attribute(&dom, "data-pictures"), "6");
    assert!(dom.contains("<title>A &amp; B</title>"));
}

#[test]
fn pictures_that_are_broken_do_not_count() {
    // The test itself works: it detects a damaged picture and a missing plot.
    let page = report();
    let at = page.find("data:image/png;base64,").unwrap() + 40;
    let broken = format!("{}!{}", &page[..at], &page[at + 1..]);
    let hide = "document.querySelector('figure svg').style.display = 'none';";
    let Some(dom) = open(&broken, hide) else { return };
    assert_eq!((attribute(&dom, "data-ready"), attribute(&dom, "data-pictures")), ("yes", "5"));
    assert_eq!(attribute(&dom, "data-plots"), "2");
}

#[test]
fn main_columns_are_visible_and_all_on_request() {
    let script = "
        // A row with many settings, and one with many notes.
        const long = 'dsm epsilon=0.005 prefilter=5 march=samples step=0.5 filter=bilinear fit=view map=512';
        document.querySelectorAll('#rows tbody th a')[2].textContent = long;
        const cell = document.querySelector('#rows td.long > div');
        if (cell) cell.textContent = 'words '.repeat(400);
        const scroll = document.querySelector('.scroll');
        const data = document.documentElement.dataset;
        const seen = () => [...document.querySelectorAll('#rows thead th')].filter((h) => h.offsetWidth > 0);
        data.few = seen().map((h) => h.title).join(' ');
        data.fits = scroll.scrollWidth <= scroll.clientWidth && document.body.scrollWidth <= innerWidth;
        document.getElementById('every-column').click();
        data.many = seen().length;
        data.tallest = Math.max(...[...document.querySelectorAll('#rows tbody tr')].map((r) => r.offsetHeight));";
    let Some(dom) = open(&report(), script) else { return };
    let few = attribute(&dom, "data-few").to_owned();
    for name in ["frame_ms", "bytes", "ray_err_max", "point_err_rms", "image_psnr"] {
        assert!(few.split(' ').any(|n| n == name), "{name}: {few}");
    }
    assert!(!few.contains("note") && !few.contains("driver"), "{few}");
    assert_eq!(attribute(&dom, "data-fits"), "true", "wider than a window of 1280 pixels");
    let number = |name: &str| attribute(&dom, name).parse::<usize>().unwrap();
    assert_eq!(number("data-many"), 1 + umbravox::measure::table::COLUMNS.len());
    assert!(number("data-tallest") < 130, "{} pixels", number("data-tallest"));
}

#[test]
fn headings_sort_numbers_as_numbers_with_gaps_last() {
    let script = "
        const order = () => [...document.querySelectorAll('#rows tbody tr')].map((r) => r.cells[0].innerText).join(' ');
        const click = (title) => document.querySelector(`#rows th[title=\"${title}\"] button`).click();
        const seen = [];
        for (const title of ['frame_ms', 'frame_ms', 'point_err_rms', 'point_err_rms', 'image_psnr', 'method']) {
            click(title);
            seen.push(order());
        }
        document.documentElement.dataset.order = seen.join('|');
        document.documentElement.dataset.sorts = [...document.querySelectorAll('#rows th[aria-sort]')]
            .map((h) => h.title + ' ' + h.getAttribute('aria-sort')).join('|');";
    let Some(dom) = open(&report(), script) else { return };
    let expected = [
        "none osm dsm rays",
        "rays dsm osm none",
        "rays dsm none osm",
        "none dsm rays osm",
        "none dsm rays osm",
        "dsm none osm rays",
    ];
    assert_eq!(attribute(&dom, "data-order"), expected.join("|"));
    assert_eq!(attribute(&dom, "data-sorts"), "method ascending");
}

#[test]
fn no_request_goes_to_the_network() {
    // The content security policy blocks even added scripts.
    let script = "
        const p = new Image();
        document.addEventListener('securitypolicyviolation', (e) => {
            document.documentElement.dataset.refused = e.effectiveDirective;
        });
        p.src = 'http://127.0.0.1:9/x.png';";
    let Some(dom) = open(&report(), script) else { return };
    assert_eq!(attribute(&dom, "data-refused"), "img-src");
}
