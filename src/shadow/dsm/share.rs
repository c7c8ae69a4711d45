//! Shares of a deep shadow map that several processes build, and the map that they form together.

use super::DeepShadowMap;
use super::compact::MapNodes;
use super::layout::{BLOCK, NAME, QUAD_BYTES};
use crate::error::{Error, Result};
use crate::field::{BuildContext, TileMarch};
use crate::gpu::{Gpu, Group, Resource};
use crate::shadow::method::{BuildReport, Method, ShadowMap};

/// Bindings of the curve nodes and of the directory in bind group 1 of a deep shadow map.
const QUADS_BINDING: u32 = 3;
const DIRECTORY_BINDING: u32 = 4;
/// Flag in the first word of a head: its last word is the index of the first tail quad (`dsm/layout.wgsl`).
const CONTINUES: u32 = 1;
/// Number of words before the blocks of a share: number of blocks, and its counts.
const HEAD_WORDS: usize = 5;

/// Curve nodes of those texels of a deep shadow map that one process has built.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MapShare {
    /// Blocks of texels with curve nodes: index of the block, mask of its texels, and index of the first of their heads.
    pub blocks: Vec<[u32; 3]>,
    /// Quads (four words) of curve nodes.
    pub quads: Vec<[u32; 4]>,
    /// Number of all curve nodes, largest number in a texel, number of texels with nodes, and number of tiles that were
    /// built.
    counts: [u32; 4],
}

impl MapShare {
    /// Reads the curve nodes of a deep shadow map from the device; returns `None` for a shadow map of another method.
    ///
    /// # Errors
    /// The device is lost.
    pub fn of(gpu: &Gpu, map: &ShadowMap) -> Result<Option<Self>> {
        if map.method != NAME {
            return Ok(None);
        }
        let contents = |binding: u32| contents_of(gpu, &map.group, binding);
        let (columns, directory) = contents(DIRECTORY_BINDING)?;
        let blocks = BLOCK.map(|texels| map.light_space.map_size.div_ceil(texels));
        let rows = directory.chunks_exact(2 * columns).take(blocks[1] as usize);
        let entries = rows.flat_map(|row| row.chunks_exact(2).take(blocks[0] as usize));
        let numbered = (0..).zip(entries).filter(|(_, entry)| entry[0] != 0);
        let blocks: Vec<_> = numbered.map(|(index, entry)| [index, entry[0], entry[1]]).collect();
        let (_, words) = contents(QUADS_BINDING)?;
        let mut quads: Vec<[u32; 4]> = words.as_chunks().0.to_vec();
        // Every quad in use has a filler or a node behind depth 0.
        let used = quads.iter().rposition(|quad| *quad != [0; 4]).map_or(0, |last| last + 1);
        quads.truncate(used);
        let report = &map.report;
        let count = |n: Option<u64>| n.unwrap_or(0) as u32;
        let counts = [
            count(report.nodes_total),
            count(report.nodes_max),
            count(report.texels_hit),
            report.tiles - report.tiles_left_out,
        ];
        Ok(Some(Self { blocks, quads, counts }))
    }

    /// Returns the share as 32-bit words, for another process.
    pub fn to_words(&self) -> Vec<u32> {
        let [total, most, hit, tiles] = self.counts;
        let head = [self.blocks.len() as u32, total, most, hit, tiles];
        [&head, self.blocks.as_flattened(), self.quads.as_flattened()].concat()
    }

    /// Reads a share from its words ([`Self::to_words`]).
    ///
    /// # Errors
    /// The words are not those of a share.
    pub fn from_words(words: &[u32]) -> Result<Self> {
        let damaged = || Error::runtime("cannot merge", "shares of a shadow map", "their words are damaged");
        let (head, rest) = words.split_at_checked(HEAD_WORDS).ok_or_else(damaged)?;
        let (blocks, quads) = rest.split_at_checked(3 * head[0] as usize).ok_or_else(damaged)?;
        let (blocks, quads) = (blocks.as_chunks::<3>().0, quads.as_chunks::<4>());
        let is_stored = |&[_, mask, first]: &[u32; 3]| {
            mask != 0 && first as usize + mask.count_ones() as usize <= quads.0.len()
        };
        if !quads.1.is_empty() || !blocks.iter().all(is_stored) {
            return Err(damaged());
        }
        Ok(Self {
            blocks: blocks.to_vec(),
            quads: quads.0.to_vec(),
            counts: [head[1], head[2], head[3], head[4]],
        })
    }
}

/// Returns the width of a texture that a bind group binds, and its texels as words.
fn contents_of(gpu: &Gpu, group: &Group, binding: u32) -> Result<(usize, Vec<u32>)> {
    let entry = group.entries().find(|(entry, _)| entry.binding == binding);
    let Some((_, resource @ Resource::Texture(texture))) = entry else {
        return Err(Error::runtime("cannot share", "deep shadow map", format!("no texture at {binding}")));
    };
    Ok((texture.width() as usize, bytemuck::pod_collect_to_vec(&resource.contents(gpu)?)))
}

/// Forms a deep shadow map from the shares of all processes. The context is that of the whole map.
///
/// # Errors
/// The method is not `dsm`, or the adapter cannot hold the map.
pub fn merged_map(context: &BuildContext<'_>, method: &dyn Method, shares: &[MapShare]) -> Result<ShadowMap> {
    let dsm = DeepShadowMap::from_values(&method.values()).filter(|_| method.name() == NAME);
    let dsm = dsm.ok_or_else(|| {
        Error::input(
            "cannot share the work of",
            method.name(),
            "only dsm and none are built by several processes",
        )
    })?;
    let tiles = TileMarch::fit(context, dsm.map_shape())?;
    let mut quads = Vec::with_capacity(shares.iter().map(|share| share.quads.len()).sum());
    let mut blocks = Vec::new();
    for share in shares {
        let offset = quads.len() as u32;
        quads.extend_from_slice(&share.quads);
        for &[index, mask, first] in &share.blocks {
            let heads = quads.get_mut((offset + first) as usize..).unwrap_or_default();
            let has_tail = |head: &&mut [u32; 4]| head[0] & CONTINUES != 0;
            heads
                .iter_mut()
                .take(mask.count_ones() as usize)
                .filter(has_tail)
                .for_each(|head| head[3] += offset);
            blocks.push([index, mask, offset + first]);
        }
    }
    let nodes = MapNodes::new(context, (&dsm, &tiles), &quads, &blocks)?;
    let counts = shares.iter().map(|share| share.counts);
    let [total, most, hit, built] = counts.fold([0; 4], |sum, own| {
        [
            sum[0] + u64::from(own[0]),
            sum[1].max(own[1].into()),
            sum[2] + u64::from(own[2]),
            sum[3] + u64::from(own[3]),
        ]
    });
    if built != u64::from(tiles.built) {
        let why = format!("they have {built} tiles, and the map has {}", tiles.built);
        return Err(Error::runtime("cannot merge", "shares of a shadow map", why));
    }
    let mut report = BuildReport {
        tiles: tiles.tiles,
        tiles_left_out: tiles.tiles - tiles.built,
        nodes_total: Some(total),
        nodes_max: Some(most),
        texels_hit: Some(hit),
        ..Default::default()
    };
    nodes.add_to(&mut report);
    report.bytes += tiles.table_bytes();
    report.bytes_used += quads.len() as u64 * QUAD_BYTES;
    Ok(dsm.finished(context, tiles, nodes, report))
}
