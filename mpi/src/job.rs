//! Work of one rank: its share of the shadow maps and of the picture.

use crate::Args;
use crate::exchange::Ranks;
use ndarray::Array3;
use serde::Serialize;
use std::sync::Arc;
use std::time::Instant;
use umbravox::files::loading::Loading;
use umbravox::files::output::check_output;
use umbravox::files::picture::{Backdrop, PICTURE_EXTENSIONS, write_picture_with};
use umbravox::open::SceneRequest;
use umbravox::render::{Renderer, Session, View};
use umbravox::scene::{LightSource, Scene};
use umbravox::shadow::{MapShare, Method, ShadowMap, mapped_lights};
use umbravox::{Error, Result};

/// Report of one rank.
#[derive(Debug, Default, Serialize)]
struct RankReport {
    rank: u32,
    /// Time to build the rank's share of the shadow maps, to exchange and merge them, and to draw its rows, ms.
    build_ms: f64,
    exchange_ms: f64,
    draw_ms: f64,
    /// Number of rows of the picture that the rank has drawn.
    rows: u32,
    /// Size of the rank's share of the shadow maps, and of all, bytes.
    share_bytes: u64,
    map_bytes: u64,
    /// Number of bytes that the rank has sent to others, without this report.
    sent_bytes: u64,
    /// Number of cells that the rank's light rays marched through, with `--count-work`.
    #[serde(skip_serializing_if = "Option::is_none")]
    cells: Option<u64>,
    /// Number of blocks of pages that became resident, and of pages that were uploaded.
    blocks: u64,
    pages: u64,
}

/// Draws the picture of a scene with all ranks. Rank 0 writes it.
///
/// # Errors
/// Bad input, or a failure of a device or of the exchange.
pub fn run(args: &Args, ranks: &Ranks<'_>) -> Result<()> {
    let SceneRequest { settings, run } = args.scene.clone().into_request()?;
    if ranks.rank() == 0 {
        check_output(&args.output, PICTURE_EXTENSIONS)?;
    }
    let spec = settings.method_spec();
    let method = spec.method()?;
    if !["dsm", "none"].contains(&method.name()) {
        let why = "the ranks of a job build dsm, and draw none";
        return Err(Error::input("cannot share the work of", method.name(), why));
    }
    let backdrop = if settings.is_transparent() { Backdrop::LeftOut } else { Backdrop::Drawn };
    let loaded = settings.load(&Loading::default())?;
    if ranks.rank() == 0 {
        loaded.diagnostics.iter().for_each(|d| eprintln!("{}: {}", d.level.name(), d.message));
    }
    let (volume, scene) = (&loaded.volume, &loaded.scene);
    let place = (volume.dims(), volume.value_range(), volume.world_from_index());
    let size = [scene.width, scene.height];
    ranks.check_same(&format!(
        "{place:?} {size:?} {:?} {:?} {spec} {:?}",
        scene.camera, scene.lights, loaded.tf
    ))?;
    let renderer = Arc::new(Renderer::new(run.gpu()?));
    let session = Session::on(&renderer, loaded.volume, &loaded.tf, settings.disabled_optimizations())?;
    let session = session.with_strands(loaded.strands);
    let mut report = RankReport { rank: ranks.rank(), ..RankReport::default() };
    let maps = shadow_maps(args, ranks, (&session, method.as_ref(), &loaded.scene), &mut report)?;
    let picture = picture(ranks, &session, &maps, &loaded.scene, &mut report)?;
    session.loaded.volume.check_reads()?;
    if let Some(usage) = session.transfer.stream().map(|stream| stream.usage()) {
        (report.blocks, report.pages) = (usage.blocks, usage.pages);
    }
    report.sent_bytes = ranks.sent_bytes();
    let text =
        serde_json::to_vec(&report).map_err(|e| Error::runtime("cannot report", "rank", e.to_string()))?;
    let reports = ranks.gather(&text)?;
    if let Some(picture) = picture {
        write_picture_with(&args.output, &picture, backdrop, &[])?;
    }
    for text in reports.into_iter().flatten().filter(|_| run.json || run.explain) {
        println!("{}", String::from_utf8_lossy(&text));
    }
    Ok(())
}

/// Builds the shadow maps of all lights of a scene: each rank its share, which all ranks then merge.
fn shadow_maps(
    args: &Args,
    ranks: &Ranks<'_>,
    (session, method, scene): (&Session, &dyn Method, &Scene),
    report: &mut RankReport,
) -> Result<Vec<ShadowMap>> {
    let Session { renderer, loaded, transfer } = session;
    let field = (loaded, transfer);
    let method = renderer.effective_method(loaded, transfer, method, scene);
    let view = View::of_shadows(scene);
    let one = |source: &LightSource, report: &mut RankReport| {
        if method.lookup().is_none() {
            return renderer.shadow_in(loaded, transfer, method, (scene, source), view.as_ref());
        }
        let start = Instant::now();
        let build = || renderer.shadow_share(field, method, source, view.as_ref(), ranks.share());
        let own = match args.count_work {
            false => build()?,
            true => {
                let (map, work) = renderer.kernels().counting_work(build)?;
                *report.cells.get_or_insert(0) += work.cells;
                map
            }
        };
        report.build_ms += start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let share = MapShare::of(renderer.gpu(), &own)?;
        drop(own);
        let words = share.unwrap_or_default().to_words();
        report.share_bytes += 4 * words.len() as u64;
        let all = ranks.all_gather(&words)?;
        report.map_bytes += 4 * all.iter().map(Vec::len).sum::<usize>() as u64;
        let shares = all.into_iter().map(|words| MapShare::from_words(&words)).collect::<Result<Vec<_>>>()?;
        let map = renderer.merged_shadow(field, method, source, view.as_ref(), &shares)?;
        report.exchange_ms += start.elapsed().as_secs_f64() * 1e3;
        Ok(map)
    };
    mapped_lights(method, scene).iter().map(|source| one(source, report)).collect()
}

/// Draws the rows of this rank, and returns the whole picture to rank 0.
fn picture(
    ranks: &Ranks<'_>,
    session: &Session,
    maps: &[ShadowMap],
    scene: &Scene,
    report: &mut RankReport,
) -> Result<Option<Array3<f32>>> {
    let Session { renderer, loaded, transfer } = session;
    let start = Instant::now();
    let rows = renderer.rows_of_share(loaded, transfer, scene, ranks.share());
    let own = match rows.is_empty() {
        true => Vec::new(),
        false => {
            let drawn = renderer.render_rows(loaded, transfer, maps, scene, rows.clone())?;
            drawn.pixels.into_raw_vec_and_offset().0
        }
    };
    report.draw_ms = start.elapsed().as_secs_f64() * 1e3;
    report.rows = rows.len() as u32;
    let Some(all) = ranks.gather(&own)? else { return Ok(None) };
    let shape = (scene.height as usize, scene.width as usize, 4);
    let broken = |e: ndarray::ShapeError| Error::runtime("cannot join", "rows of the picture", e.to_string());
    Array3::from_shape_vec(shape, all.concat()).map(Some).map_err(broken)
}
