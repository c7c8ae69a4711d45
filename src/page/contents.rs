//! Data of a page: resources of bind groups, layouts, shaders and pipelines, each stored once.

use crate::error::{Error, Result};
use crate::gpu::{Group, Kernels, Resource, ShaderVariant, StructLayout};
use serde::Serialize;
use std::collections::BTreeMap;

/// Alignment of resources in the data of a page, bytes.
const ALIGNMENT: usize = 16;

/// Resource of a bind group, as the script of a page creates it. `at` is the offset of its bytes in the data of the page;
/// `None`: all bytes are 0.
#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum ResourceRecord {
    Buffer {
        at: Option<usize>,
        size: usize,
    },
    Texture {
        at: Option<usize>,
        size: [u32; 3],
        format: String,
        dimension: &'static str,
        bytes_per_row: u32,
        /// Whether a shader writes the texture.
        stored: bool,
    },
    Sampler {
        filter: &'static str,
    },
}

/// Entry of a bind group layout, in the form of `GPUBindGroupLayoutEntry` without its visibility.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct LayoutEntry {
    binding: u32,
    #[serde(flatten)]
    kind: BTreeMap<&'static str, BTreeMap<&'static str, String>>,
}

/// Bind group of a page: index of its layout, and pairs of `@binding` number and index of the resource.
#[derive(Debug, Serialize)]
struct GroupRecord {
    layout: usize,
    entries: Vec<(u32, usize)>,
}

/// Compute pipeline of a page: index of its shader, and indices of its bind group layouts.
#[derive(Debug, PartialEq, Serialize)]
struct PipelineRecord {
    shader: usize,
    layouts: Vec<usize>,
}

/// Resources, layouts, shaders and pipelines of a page, each stored once.
#[derive(Serialize)]
pub(super) struct Contents<'a> {
    #[serde(skip)]
    kernels: &'a Kernels,
    /// Handles of the resources, in the order of their records.
    #[serde(skip)]
    handles: Vec<(Resource, bool)>,
    /// Resources that shaders write, and whether the page holds their contents. Without, they hold zeros at first.
    #[serde(skip)]
    written: Vec<(Resource, bool)>,
    /// Bytes of all resources.
    #[serde(skip)]
    pub bytes: Vec<u8>,
    /// Whether the device has to filter textures of 32-bit floats.
    filters_float32: bool,
    resources: Vec<ResourceRecord>,
    layouts: Vec<Vec<LayoutEntry>>,
    groups: Vec<GroupRecord>,
    shaders: Vec<String>,
    pipelines: Vec<PipelineRecord>,
}

impl<'a> Contents<'a> {
    pub fn new(kernels: &'a Kernels) -> Self {
        let (resources, handles, bytes, written) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (layouts, groups, shaders, pipelines) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self {
            kernels,
            handles,
            written,
            bytes,
            filters_float32: false,
            resources,
            layouts,
            groups,
            shaders,
            pipelines,
        }
    }

    /// Adds a resource that shaders write, before the first bind group that has it. `has_contents`: the page holds its contents.
    pub fn add_written(&mut self, resource: &Resource, has_contents: bool) {
        if self.written.iter().all(|(known, _)| known != resource) {
            self.written.push((resource.clone(), has_contents));
        }
    }

    /// Returns the index of a resource that some bind group of the page has.
    pub fn known(&self, resource: &Resource) -> Option<usize> {
        self.handles.iter().position(|(known, _)| known == resource)
    }

    /// Returns the index of the layout of a bind group.
    ///
    /// # Errors
    /// A binding has a type that no shader of this program has.
    pub fn layout(&mut self, group: &Group) -> Result<usize> {
        let entries = group.entries().map(|(entry, _)| layout_entry(entry)).collect::<Result<Vec<_>>>()?;
        Ok(index_of(&mut self.layouts, entries))
    }

    /// Returns the index of a bind group, whose resources are stored with their contents.
    ///
    /// # Errors
    /// The device is lost.
    pub fn group(&mut self, group: &Group) -> Result<usize> {
        let layout = self.layout(group)?;
        let mut entries = Vec::with_capacity(group.entries().len());
        for (entry, resource) in group.entries() {
            self.filters_float32 |= filters_float32(entry, resource);
            entries.push((entry.binding, self.resource(entry, resource)?));
        }
        self.groups.push(GroupRecord { layout, entries });
        Ok(self.groups.len() - 1)
    }

    /// Returns the index of a resource, which is stored with its contents.
    ///
    /// # Errors
    /// The device is lost.
    fn resource(&mut self, entry: &wgpu::BindGroupLayoutEntry, resource: &Resource) -> Result<usize> {
        let filters = entry.ty == wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let handle = (resource.clone(), filters);
        if let Some(known) = self.handles.iter().position(|known| *known == handle) {
            return Ok(known);
        }
        let written = self.written.iter().find(|(written, _)| written == resource).map(|(_, kept)| *kept);
        let at = match written {
            Some(false) => None,
            _ => self.push(&resource.contents(self.kernels.gpu())?),
        };
        let record = match resource {
            Resource::Buffer { size, .. } => {
                ResourceRecord::Buffer { at, size: (*size as usize).next_multiple_of(4) }
            }
            Resource::Sampler => {
                ResourceRecord::Sampler { filter: if filters { "linear" } else { "nearest" } }
            }
            Resource::Texture(texture) => {
                let wgpu::Extent3d { width, height, depth_or_array_layers } = texture.size();
                let solid = texture.dimension() == wgpu::TextureDimension::D3;
                ResourceRecord::Texture {
                    at,
                    size: [width, height, depth_or_array_layers],
                    format: name_of(texture.format()),
                    dimension: if solid { "3d" } else { "2d" },
                    bytes_per_row: width * texture.format().block_copy_size(None).unwrap_or(0),
                    stored: written.is_some(),
                }
            }
        };
        self.handles.push(handle);
        self.resources.push(record);
        Ok(self.resources.len() - 1)
    }

    /// Appends bytes to the data of the page, and returns their offset; `None` if all are 0.
    pub fn push(&mut self, bytes: &[u8]) -> Option<usize> {
        if bytes.iter().all(|byte| *byte == 0) {
            return None;
        }
        let at = self.bytes.len().next_multiple_of(ALIGNMENT);
        self.bytes.resize(at, 0);
        self.bytes.extend(bytes);
        Some(at)
    }

    /// Returns the index of a compute pipeline with the layouts of the given bind groups.
    ///
    /// # Errors
    /// The shader does not compile, which is a fault of this program.
    pub fn pipeline(&mut self, variant: &ShaderVariant, groups: &[&Group]) -> Result<usize> {
        let layouts = groups.iter().map(|group| self.layout(group)).collect::<Result<_>>()?;
        let shader = index_of(&mut self.shaders, self.kernels.wgsl(variant)?);
        Ok(index_of(&mut self.pipelines, PipelineRecord { shader, layouts }))
    }

    /// Returns the size and the offsets of the members of a struct of a shader; `None` if the shader has no such struct.
    ///
    /// # Errors
    /// The shader does not compile, which is a fault of this program.
    pub fn uniform(&self, variant: &ShaderVariant, name: &str) -> Result<Option<UniformRecord>> {
        let layout = StructLayout::of(&self.kernels.composed(variant)?, name);
        Ok(layout.map(|StructLayout { size, members }| UniformRecord {
            size,
            offsets: members.into_iter().collect(),
        }))
    }
}

/// Size of a uniform, and offsets of its members by name, bytes.
#[derive(Debug, Serialize)]
pub(super) struct UniformRecord {
    size: usize,
    offsets: BTreeMap<String, usize>,
}

impl UniformRecord {
    /// Returns the offset of a member, bytes; `None` if there is no such member.
    pub fn offset(&self, member: &str) -> Option<usize> {
        self.offsets.get(member).copied()
    }
}

/// Returns the name of a texture format in WebGPU, which names the formats of its core like wgpu, in lower case.
fn name_of(format: wgpu::TextureFormat) -> String {
    format!("{format:?}").to_lowercase()
}

/// Whether a shader filters a texture of 32-bit floats.
fn filters_float32(entry: &wgpu::BindGroupLayoutEntry, resource: &Resource) -> bool {
    use wgpu::{BindingType::Texture, TextureFormat, TextureSampleType::Float};
    let is_single = |format| {
        matches!(format, TextureFormat::R32Float | TextureFormat::Rg32Float | TextureFormat::Rgba32Float)
    };
    let filters = matches!(entry.ty, Texture { sample_type: Float { filterable: true }, .. });
    filters && matches!(resource, Resource::Texture(texture) if is_single(texture.format()))
}

/// Returns the index of a value in a list, to which it is appended if it is not there.
fn index_of<T: PartialEq>(list: &mut Vec<T>, value: T) -> usize {
    list.iter().position(|known| *known == value).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}

fn layout_entry(entry: &wgpu::BindGroupLayoutEntry) -> Result<LayoutEntry> {
    use wgpu::{BindingType, BufferBindingType, SamplerBindingType, TextureSampleType, TextureViewDimension};
    let (kind, members) = match entry.ty {
        BindingType::Buffer { ty, .. } => {
            let name = match ty {
                BufferBindingType::Uniform => "uniform",
                BufferBindingType::Storage { read_only: true } => "read-only-storage",
                BufferBindingType::Storage { read_only: false } => "storage",
            };
            ("buffer", vec![("type", name.to_owned())])
        }
        BindingType::Texture {
            sample_type,
            view_dimension: view_dimension @ (TextureViewDimension::D2 | TextureViewDimension::D3),
            ..
        } => {
            let name = match sample_type {
                TextureSampleType::Float { filterable: true } => "float",
                TextureSampleType::Float { filterable: false } => "unfilterable-float",
                TextureSampleType::Depth => "depth",
                TextureSampleType::Sint => "sint",
                TextureSampleType::Uint => "uint",
            };
            let dimension = if view_dimension == TextureViewDimension::D3 { "3d" } else { "2d" };
            ("texture", vec![("sampleType", name.to_owned()), ("viewDimension", dimension.to_owned())])
        }
        BindingType::StorageTexture { format, view_dimension: TextureViewDimension::D2, .. } => {
            ("storageTexture", vec![("access", "write-only".to_owned()), ("format", name_of(format))])
        }
        BindingType::Sampler(SamplerBindingType::Filtering) => {
            ("sampler", vec![("type", "filtering".to_owned())])
        }
        BindingType::Sampler(_) => ("sampler", vec![("type", "non-filtering".to_owned())]),
        other => {
            let why = format!("binding {} is {other:?}", entry.binding);
            return Err(Error::runtime("cannot write page", "bind group", why));
        }
    };
    let kind = BTreeMap::from([(kind, members.into_iter().collect())]);
    Ok(LayoutEntry { binding: entry.binding, kind })
}
