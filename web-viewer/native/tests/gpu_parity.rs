//! The shader puts vertices where the CPU reference does, and equal vertices of different charts on equal floats.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use marquetry_engine::camera::View;
use marquetry_engine::gpu_types::{Frame, Instance};
use marquetry_engine::lod::animate::Drawn;
use marquetry_engine::lod::edge_morph::{morph_of, side_modes};
use marquetry_engine::lod::mesh::Patch;
use marquetry_engine::lod::residency::{needed_pages, restrict};
use marquetry_engine::lod::{Cut, balance};
use marquetry_engine::passes::atlas::AtlasTextures;
use marquetry_engine::passes::grid::SHADER;
use marquetry_engine::residency::upload::{Slot, SlotAllocator, Upload};
use marquetry_engine::testing::{Random, Shape, random_cut, random_finest, random_rest};
use marquetry_engine::{Camera, Shade, Viewport, wgpu};
use marquetry_format::{ByteSource, Document, PageId, PageSamples};
use marquetry_native::Headless;
use std::collections::{BTreeMap, HashMap};

const ENTRY: &str = "
struct Call { place: vec4<u32>, sides: vec4<f32>, own_morph: f32, first: u32 }
@group(1) @binding(0) var<storage, read> calls: array<Call>;
@group(1) @binding(1) var<storage, read_write> offsets: array<vec4<f32>>;
@compute @workgroup_size(64)
fn run_patch_vertex(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let call = calls[id.y];
    let side = (1u << (call.place.w & 0xffu)) + 1u;
    if id.x < side * side {
        let vertex = patch_vertex(call.place, call.sides, call.own_morph, id.x);
        offsets[call.first + id.x] = vec4<f32>(vertex.offset, 1.0);
    }
}
";

#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Call {
    place: [u32; 4],
    sides: [f32; 4],
    morph: f32,
    first: u32,
    unused: [u32; 2],
}

/// Samples of everything a cut needs, decoded, with their places on the GPU.
struct Resident {
    base: Vec<Slot>,
    pages: HashMap<PageId, (PageSamples, Slot)>,
    uploads: Vec<Upload>,
    layers: u32,
}

fn load(document: &Document, source: &dyn ByteSource, cut: &Cut) -> Resident {
    let mut slots = SlotAllocator::default();
    let mut uploads = Vec::new();
    let mut place = |samples: &PageSamples| {
        let slot = slots.allocate(samples.resolution).unwrap();
        uploads.push(Upload::pack(slot, samples));
        slot
    };
    let base = document.base.iter().map(&mut place).collect();
    let mut pages: HashMap<PageId, (PageSamples, Slot)> = HashMap::new();
    for needed in needed_pages(cut, document) {
        let bytes = source
            .read(document.page_range(needed.page).unwrap())
            .unwrap();
        let samples = match needed.node.parent() {
            None => document.decode_root(needed.node.chart, &bytes),
            Some((_, quadrant)) => {
                let parent = needed
                    .parent
                    .map_or(&document.base[needed.node.chart.0 as usize], |page| {
                        &pages[&page].0
                    });
                document.decode_child(needed.page, quadrant, parent, &bytes)
            }
        };
        let samples = samples.unwrap();
        let slot = place(&samples);
        pages.insert(needed.page, (samples, slot));
    }
    Resident {
        base,
        pages,
        uploads,
        layers: slots.layers(),
    }
}

/// Offsets from the eye of all vertices of all calls.
fn run(
    headless: &Headless,
    frame: &Frame,
    resident: &Resident,
    calls: &[Call],
    vertices: usize,
) -> Vec<[f32; 4]> {
    let (device, queue) = (headless.device(), headless.queue());
    let atlas = AtlasTextures::new(device, resident.layers, true).unwrap();
    resident
        .uploads
        .iter()
        .for_each(|upload| atlas.write(queue, upload));
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(format!("{SHADER}{ENTRY}").into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("run_patch_vertex"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let buffer = |size: usize, usage| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: size as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    };
    let uniform = buffer(size_of::<Frame>(), wgpu::BufferUsages::UNIFORM);
    let input = buffer(size_of_val(calls), wgpu::BufferUsages::STORAGE);
    let output = buffer(
        16 * vertices,
        wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
    );
    let readable = buffer(16 * vertices, wgpu::BufferUsages::MAP_READ);
    queue.write_buffer(&uniform, 0, bytemuck::bytes_of(frame));
    queue.write_buffer(&input, 0, bytemuck::cast_slice(calls));
    let [positions, normals, colours] = atlas.views();
    let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
    let view = |binding, view| entry(binding, wgpu::BindingResource::TextureView(view));
    let group = |index, entries: &[wgpu::BindGroupEntry<'_>]| {
        let layout = pipeline.get_bind_group_layout(index);
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries,
        })
    };
    let samples = group(
        0,
        &[
            entry(0, uniform.as_entire_binding()),
            view(1, &positions),
            view(2, &normals),
            view(3, &colours),
        ],
    );
    let data = group(
        1,
        &[
            entry(0, input.as_entire_binding()),
            entry(1, output.as_entire_binding()),
        ],
    );
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &samples, &[]);
        pass.set_bind_group(1, &data, &[]);
        pass.dispatch_workgroups(33 * 33 / 64 + 1, u32::try_from(calls.len()).unwrap(), 1);
    }
    encoder.copy_buffer_to_buffer(&output, 0, &readable, 0, 16 * vertices as u64);
    queue.submit([encoder.finish()]);
    readable
        .slice(..)
        .map_async(wgpu::MapMode::Read, |result| result.unwrap());
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    bytemuck::cast_slice(&readable.slice(..).get_mapped_range().unwrap()).to_vec()
}

#[test]
fn shader_agrees_with_the_reference_and_closes_every_border() {
    let headless = match Headless::new() {
        Ok(headless) => headless,
        Err(error) => {
            println!("ignored: {error}");
            return;
        }
    };
    let mut random = Random::new(21);
    for shape in [Shape::Cube, Shape::Torus] {
        let charts = shape.charts(5);
        let (document, source) = shape
            .open(&random_finest(&mut random, &charts, 2, 4))
            .unwrap();
        let mut drawn = Drawn::of(Cut::coarsest(charts.len()));
        for round in 0..6 {
            let mut wanted = random_cut(&mut random, &charts, 2);
            balance::coarsen(&mut wanted, &charts);
            let target = restrict(&wanted, &document, |_| true);
            let target = random_rest(&mut random, &charts, target);
            for _ in 0..5 {
                drawn.advance(&target, &charts, 0.37);
            }
            let eye = Camera::parse(
                &document.metadata,
                &format!("0.3,{},1.7,0,0,0", f64::from(round) - 2.5),
            )
            .unwrap();
            compare(&headless, &document, &source, &drawn, &eye);
        }
    }
}

fn compare(
    headless: &Headless,
    document: &Document,
    source: &dyn ByteSource,
    drawn: &Drawn,
    camera: &Camera,
) {
    let resident = load(document, source, &drawn.cut);
    let view = View::new(camera, &document.metadata, Viewport::new(640, 480));
    let frame = Frame::new(&view, Shade::Lit, true);
    let (mut calls, mut patches, mut vertices) = (Vec::new(), Vec::new(), 0usize);
    for leaf in drawn.cut.leaves() {
        let chart = leaf.node.chart.0 as usize;
        let base = &document.base[chart];
        let (samples, slot) = if leaf.node.level == 0 && leaf.resolution <= base.resolution {
            (base, resident.base[chart])
        } else {
            let (samples, slot) = &resident.pages[&document.page_of_node(leaf.node).unwrap()];
            (samples, *slot)
        };
        let sides = side_modes(&drawn.cut, &drawn.morphs, &document.charts, leaf);
        let morph = morph_of(&drawn.morphs, leaf);
        let Instance {
            place,
            sides: packed,
            morph: _,
            tiles: _,
        } = Instance::new(leaf, slot, morph, sides);
        calls.push(Call {
            place,
            sides: packed,
            morph,
            first: u32::try_from(vertices).unwrap(),
            unused: [0; 2],
        });
        patches.push((
            Patch {
                leaf,
                samples,
                morph,
                sides,
            },
            vertices,
        ));
        vertices += ((1usize << leaf.grid_resolution()) + 1).pow(2);
    }
    let offsets = run(headless, &frame, &resident, &calls, vertices);

    let eye = glam::DVec3::from_array(view.eye.whole.map(f64::from))
        + glam::DVec3::from_array(view.eye.fraction);
    let mut edges: BTreeMap<([u32; 3], [u32; 3]), i64> = BTreeMap::new();
    for (patch, first) in patches {
        let cells = 1usize << patch.leaf.grid_resolution();
        let side = cells + 1;
        let bits = |n: usize| [0, 1, 2].map(|axis| offsets[first + n][axis].to_bits());
        for n in 0..side * side {
            let expected = patch.vertex(n % side, n / side).unwrap().position - eye;
            let [x, y, z, _] = offsets[first + n].map(f64::from);
            let error = (glam::DVec3::new(x, y, z) - expected).length();
            assert!(
                error <= 2e-7 * expected.length() + 1e-3,
                "{error} at {expected}"
            );
        }
        for (j, i) in (0..cells).flat_map(|j| (0..cells).map(move |i| (j, i))) {
            let n = j * side + i;
            for triangle in [[n, n + 1, n + side + 1], [n, n + side + 1, n + side]] {
                let [a, b, c] = triangle.map(bits);
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    if from != to {
                        *edges.entry((from.min(to), from.max(to))).or_default() +=
                            if from < to { 1 } else { -1 };
                    }
                }
            }
        }
    }
    assert_eq!(
        edges.values().filter(|balance| **balance != 0).count(),
        0,
        "a border is open on the GPU"
    );
}
