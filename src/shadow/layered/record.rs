//! Packing of a layered shadow map's texels into memory, as in `shaders/shadow/layered/layout.wgsl`.

/// Width, in its own texels, of the GPU texture that stores the texels of a layered shadow map.
pub const RECORD_TEXTURE_WIDTH: u32 = 8192;

/// Memory layout of one texel of a layered shadow map: first its depths and the index of its layer division, then one
/// optical depth for each layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Record {
    pub layers: u32,
    /// Number of bits of the optical depth stored for each layer of the shadow map: 8 (a share of `kappa`), 16 or 32
    /// (floats).
    pub bits: u32,
    /// Number of depths stored in a shadow map texel: 0, 1 (start of matter) or 2 (start and end).
    pub depths: u32,
    /// Number of bits of each depth stored in a shadow map texel: 8 or 16 (steps of the map's depth range) or 32
    /// (float, mm).
    pub depth_bits: u32,
    /// Whether each shadow map texel stores the index of its own division of depth into layers, in 8 bits.
    pub own_split: bool,
}

impl Record {
    /// Returns the index of the first layer's entry in the stored data of a shadow map texel; the entries before it
    /// hold depths and the layer division.
    pub fn first_slot(self) -> u32 {
        (self.depths * self.depth_bits + 8 * u32::from(self.own_split)).div_ceil(self.bits)
    }

    fn words(self) -> u32 {
        ((self.first_slot() + self.layers) * self.bits).div_ceil(32)
    }

    /// Returns the number of 32-bit words in one texel of the storage texture: the largest of 4, 2 and 1 that divides
    /// the data of a shadow map texel. It is raised if the depths at the start of the data, which are read at once,
    /// need more.
    pub fn block_words(self) -> u32 {
        let header = (self.first_slot() * self.bits).div_ceil(32).next_power_of_two();
        let fits = |words: &u32| self.words().is_multiple_of(*words);
        [4, 2, 1].into_iter().find(fits).unwrap_or(1).max(header)
    }

    /// Returns the number of texels of the storage texture that one shadow map texel occupies.
    pub fn blocks(self) -> u32 {
        self.words().div_ceil(self.block_words())
    }

    pub fn bytes(self) -> u64 {
        4 * u64::from(self.block_words()) * u64::from(self.blocks())
    }

    /// Returns the format of the texture that stores a layered shadow map: 32-bit unsigned integers. Storage textures
    /// of WebGPU have no single channels of 8 or 16 bits, and hardware does not filter this texture.
    pub fn format(self) -> wgpu::TextureFormat {
        match self.block_words() {
            1 => wgpu::TextureFormat::R32Uint,
            2 => wgpu::TextureFormat::Rg32Uint,
            _ => wgpu::TextureFormat::Rgba32Uint,
        }
    }

    /// Returns the width and height of a texture that can store `records` shadow map texels; at least one line of
    /// texels.
    pub fn texture_size(self, records: u64) -> [u32; 2] {
        let blocks = (records * u64::from(self.blocks())).max(1);
        let lines = blocks.div_ceil(u64::from(RECORD_TEXTURE_WIDTH));
        [RECORD_TEXTURE_WIDTH, u32::try_from(lines).unwrap_or(u32::MAX)]
    }

    /// Returns the size in bytes of the texture that stores `records` shadow map texels.
    pub fn texture_bytes(self, records: u64) -> u64 {
        let [width, height] = self.texture_size(records);
        u64::from(width) * u64::from(height) * 4 * u64::from(self.block_words())
    }

    /// Returns the preprocessor definitions of shaders that write layered shadow maps.
    pub fn write_defs(self) -> Vec<&'static str> {
        let mut defs = self.read_defs();
        defs.extend(match self.block_words() {
            1 => Some("WORDS_1"),
            2 => Some("WORDS_2"),
            _ => None,
        });
        defs.extend((self.depths > 0).then_some("STARTS"));
        defs
    }

    /// Returns the preprocessor definitions of shaders that read layered shadow maps.
    pub fn read_defs(self) -> Vec<&'static str> {
        let mut defs = Vec::new();
        defs.extend((self.depths > 1).then_some("ENDS"));
        defs.extend(self.own_split.then_some("SPLIT_ROWS"));
        defs.extend(match self.bits {
            8 => Some("BITS_8"),
            16 => Some("BITS_16"),
            _ => None,
        });
        defs
    }

    /// Returns the number of quantization steps of stored depths over the shadow map's depth range; 1 if depths are
    /// floats.
    pub fn depth_steps(self) -> f64 {
        // The stored value 0 stands for a texel without matter, the largest value for the end of the range.
        if self.depth_bits < 32 { (1_u64 << self.depth_bits) as f64 - 2.0 } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_no_larger_than_their_content() {
        let record =
            |layers, bits, depths, depth_bits| Record { layers, bits, depths, depth_bits, own_split: false };
        // Three layers and a depth are four channels (Yuksel & Keyser 2008, 3).
        for (bits, bytes) in [(8, 4), (16, 8), (32, 16)] {
            assert_eq!(record(3, bits, 1, bits).bytes(), bytes);
        }
        assert_eq!(record(128, 16, 0, 16).bytes(), 256);
        assert_eq!(record(128, 8, 0, 16).bytes(), 128);
        assert_eq!(record(512, 32, 0, 16).bytes(), 2048);
        assert_eq!(record(1, 8, 0, 16).bytes(), 4);
        let with_depths = record(7, 16, 1, 32);
        assert_eq!((with_depths.first_slot(), with_depths.bytes()), (2, 20));
        let own = Record { own_split: true, ..record(31, 16, 2, 16) };
        assert_eq!((own.first_slot(), own.block_words(), own.blocks(), own.bytes()), (3, 2, 9, 72));
        assert_eq!(own.texture_size(0), [8192, 1]);
        assert_eq!(own.texture_size(512 * 512), [8192, 288]);
        // The header is one block, even if that wastes some bits.
        let exact = Record { own_split: true, ..record(2, 8, 2, 32) };
        assert_eq!((exact.first_slot(), exact.block_words(), exact.bytes()), (9, 4, 16));
    }
}
